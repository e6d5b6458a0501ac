"""Copy NumPy arrays to the device, and wrap Dr.Jit functions whose declarations are too narrow.

Dr.Jit compiles the alignment of its inputs into a kernel. A NumPy buffer may have any alignment; `upload` copies each
to the same one, so that kernels are not compiled again and read aligned rows of four as one packet. It also converts
their type, because what Dr.Jit converts has any alignment. `held` maps NaN into a table's range: Dr.Jit's `clip`,
`minimum` and `maximum` keep NaN, and a gather at `UInt32(NaN)` = 4294967295 reads outside the table or ends the
process.
"""
import ctypes
import functools
import importlib
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

import drjit as dr
import numpy as np

from .types import ArrayTypes, Bool, DrJitArray, Float, Float64, UInt32

Place = TypeVar("Place", Float, Float64)


def held(value: Place, low: Place | float, high: Place | float) -> Place:
    """Return values clamped to [low, high]; NaN becomes `low`, because comparisons with NaN are false."""
    return cast(Place, dr.select(value > low, dr.minimum(value, high), low))


Kept = TypeVar("Kept")
ALIGNMENT = 256                    # [bytes], the widest row any backend reads at once


def arrays_of(array: DrJitArray | type) -> ArrayTypes:
    """Return the Dr.Jit namespace (`drjit.llvm.ad`, `drjit.cuda.ad`, ...) of an array or its type."""
    kind = array if isinstance(array, type) else type(array)
    module = next(base.__module__ for base in kind.__mro__ if base.__module__.startswith("drjit."))
    return cast(ArrayTypes, importlib.import_module(module))


def compressed(mask: Bool) -> UInt32:
    """Return the indices of the true entries."""
    lib = arrays_of(mask)
    if dr.backend_v(lib.Bool) != dr.JitBackend.LLVM:
        return cast(UInt32, dr.compress(mask))
    # the same in a half to a sixth of the time, in memory that both share
    return upload(lib.UInt32, np.flatnonzero(mask.numpy()))


def looped(state: tuple, condition: Callable[..., Bool], body: Callable[..., tuple], label: str | None = None) -> tuple:
    """Run a symbolic loop, `drjit.while_loop`, over several state variables."""
    return cast(Any, dr.while_loop)(state, condition, body, mode="symbolic", label=label)


def opaque_vector(kind: type[Kept], vector: Iterable[float]) -> Kept:
    """Return a vector of a Dr.Jit or Mitsuba type whose components can change without a new kernel."""
    component: Any = dr.value_t(cast(Any, kind))
    return cast(Any, kind)(*(dr.opaque(component, float(part)) for part in vector))


def picked(value: Kept, index: UInt32) -> Kept:
    """Return the values at these indices; an array of one value is broadcast."""
    return dr.gather(type(value), value, index if dr.width(value) > 1 else dr.zeros(type(index), dr.width(index)))


def entries(value: Kept, index: UInt32) -> Kept:
    """Return the entries with these numbers of all arrays in a record, list or tuple."""
    return mapped(lambda part: picked(part, index), value)


def mapped(work: Callable[..., Any], value: Kept, *others: Kept) -> Kept:
    """Return a record, list or tuple with the results of `work` for its arrays, and for those of others like it."""
    part: Any = value
    if isinstance(part, (list, tuple)):
        part = type(part)(mapped(work, *items) for items in zip(part, *others))
    elif dr.is_array_v(part):
        part = work(part, *others)
    elif is_dataclass(value):
        part = replace(part, **{field.name: mapped(work, *(getattr(record, field.name) for record in (part, *others)))
                                for field in fields(part)})
    return part


def filled(value: Any, count: int) -> bool:
    """Return True if all arrays in a record, list or tuple have this many entries."""
    if isinstance(value, (list, tuple)):
        return all(filled(item, count) for item in value)
    if dr.is_array_v(value):
        return dr.width(value) == count
    return not is_dataclass(value) or all(filled(getattr(value, field.name), count) for field in fields(value))


def reinterpreted(kind: type[Kept], array: DrJitArray) -> Kept:
    """Return the same bits as another type (`drjit.reinterpret_array`)."""
    return cast(Any, dr.reinterpret_array)(kind, array)


def upload(kind: type[Kept], values: np.ndarray) -> Kept:
    """Copy values (any shape, flattened) to a device array of type `kind`."""
    values = np.ravel(values).astype(dr.type_v(cast(Any, kind)).name.lower(), copy=False)
    raw = np.empty(values.nbytes + ALIGNMENT, np.uint8)
    start = -raw.ctypes.data % ALIGNMENT
    place = raw[start:start + values.nbytes].view(values.dtype)
    place[:] = values
    return cast(Any, kind)(place)


def give_back_memory() -> None:
    """Return memory that Dr.Jit and the C library keep for later arrays to the system."""
    dr.flush_malloc_cache()
    if (trim := _trim()) is not None:
        trim(0)


@functools.cache
def _trim() -> Callable[[int], int] | None:
    """Return glibc's `malloc_trim`; None with another C library."""
    try:
        return ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):
        return None


def where_any(mask: Bool, work: Callable[[Bool], None]) -> None:
    """Call `work(mask)`, which only scatters, in a kernel; packets without a true entry skip it."""
    cast(Any, dr.if_stmt)((mask,), mask, work, lambda _: None, mode="symbolic")
