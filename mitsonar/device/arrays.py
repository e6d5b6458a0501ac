"""NumPy arrays to the device, always at the same alignment.

Dr.Jit compiles the alignment of its inputs into a kernel and reads aligned rows of four as one packet. A NumPy buffer
may lie anywhere. Used in place, it would make the same code compile again and again, and run without packets at times.

Places in tables that are never outside the table, NaN included.

Dr.Jit's `clip`, `minimum` and `maximum` let NaN through, and `UInt32(NaN)` is 4294967295: a gather there reads whatever
lies outside the table, or ends the process. A comparison with NaN is false; `held` relies on that.
"""
import importlib
from collections.abc import Callable, Iterable
from typing import Any, TypeVar, cast

import drjit as dr
import numpy as np

from .types import ArrayTypes, Bool, DrJitArray, Float, Float64, UInt32

Place = TypeVar("Place", Float, Float64)


def held(value: Place, low: Place | float, high: Place | float) -> Place:
    """Keep values within [low, high], a Dr.Jit array of the same type; NaN becomes `low`."""
    return cast(Place, dr.select(value > low, dr.minimum(value, high), low))


Kept = TypeVar("Kept")              # the type of array that goes in comes out
ALIGNMENT = 256                    # [bytes], the widest row any backend reads at once


def arrays_of(array: DrJitArray | type) -> ArrayTypes:
    """Return the Dr.Jit namespace (`drjit.llvm.ad`, `drjit.cuda.ad`, ...) that an array or its type belongs to."""
    kind = array if isinstance(array, type) else type(array)
    module = next(base.__module__ for base in kind.__mro__ if base.__module__.startswith("drjit."))
    return cast(ArrayTypes, importlib.import_module(module))


def compressed(mask: Bool) -> UInt32:
    """Return the numbers of the entries that are true: `drjit.compress`, which is declared to give any object."""
    return cast(UInt32, dr.compress(mask))


def looped(state: tuple, condition: Callable[..., Bool], body: Callable[..., tuple], label: str | None = None) -> tuple:
    """Run a loop within one kernel: `body` gives the next state from the state, as long as `condition` holds of it.

    As `drjit.while_loop`, whose declarations allow one state variable alone.
    """
    return cast(Any, dr.while_loop)(state, condition, body, mode="symbolic", label=label)


def opaque_vector(kind: type[Kept], vector: Iterable[float]) -> Kept:
    """Return a vector of a Dr.Jit or Mitsuba type whose components are opaque: they change without a new kernel."""
    component: Any = dr.value_t(cast(Any, kind))
    return cast(Any, kind)(*(dr.opaque(component, float(part)) for part in vector))


def picked(value: Kept, index: UInt32) -> Kept:
    """Return the values at these indices; an array of one value gives it for every index."""
    return dr.gather(type(value), value, index if dr.width(value) > 1 else dr.zeros(type(index), dr.width(index)))


def reinterpreted(kind: type[Kept], array: DrJitArray) -> Kept:
    """Return the same bits as another type: `drjit.reinterpret_array`, which is declared to give any object."""
    return cast(Any, dr.reinterpret_array)(kind, array)


def upload(kind: type[Kept], values: np.ndarray) -> Kept:
    """Copy values (any shape, flattened) to a device array of type `kind`, whose NumPy type they must have."""
    values = np.ravel(values)
    raw = np.empty(values.nbytes + ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    place = raw[start:start + values.nbytes].view(values.dtype)
    place[:] = values
    return cast(Any, kind)(place)


def where_any(mask: Bool, work: Callable[[Bool], None]) -> None:
    """Do work that only scatters, `work(mask)`, within a kernel: left out in packets where no entry is true."""
    def leave(_: Bool) -> None:
        pass

    cast(Any, dr.if_stmt)((mask,), mask, work, leave, mode="symbolic")
