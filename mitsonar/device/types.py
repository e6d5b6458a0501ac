"""Names for the types of arrays in annotations: Dr.Jit's, whatever the backend, and those of code written for both.

At run time all are `typing.Any`: naming a type imports nothing. A type checker sees Dr.Jit's own declarations.

Frozen records that Dr.Jit's symbolic loops leave alone.

A loop traced by `dr.syntax` carries every dataclass it can see as loop state and writes it back field by field, which
frozen dataclasses refuse. Tables that a loop only reads are therefore plain objects.
"""
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import ModuleType

    import numpy as np
    from drjit import ArrayBase
    from drjit.auto import ad
    from drjit.auto.ad import (
        Array2f,
        Array2f64,
        Array2u,
        Array3f,
        Array3f64,
        Array4f,
        Array4f64,
        Array4u,
        Bool,
        Float,
        Float64,
        Int32,
        UInt32,
        UInt64,
    )

    Real: TypeAlias = float | np.ndarray
    DrJitArray: TypeAlias = ArrayBase[Any, Any, Any, Any, Any, Any, Any]
    # Three components of any class: Array3f, or Mitsuba's points and vectors.
    Vector: TypeAlias = ArrayBase[Any, Any, Float, Any, Float, Any, Any]
    Vector64: TypeAlias = ArrayBase[Any, Any, Float64, Any, Float64, Any, Any]

    # Three components of anything: a tuple, an array (3,), a vector on the device.
    Triple: TypeAlias = Sequence[Any] | np.ndarray | Vector | Vector64

    class Upload(Protocol):
        """Copy values to a device array of a type: `device.arrays.upload`."""

        def __call__(self, kind: Any, values: np.ndarray, /) -> Any: ...

    class ArrayTypes(ModuleType):
        """The array types of one backend, such as the module `drjit.llvm.ad`."""

        Bool: type[ad.Bool]
        Float: type[ad.Float]
        Float64: type[ad.Float64]
        Int32: type[ad.Int32]
        UInt32: type[ad.UInt32]
        UInt64: type[ad.UInt64]
        Complex2f: type[ad.Complex2f]
        ArrayXf: type[ad.ArrayXf]
        Array2f: type[ad.Array2f]
        Array2f64: type[ad.Array2f64]
        Array2u: type[ad.Array2u]
        Array3f64: type[ad.Array3f64]
        Array4f: type[ad.Array4f]
        Array4f64: type[ad.Array4f64]
        Array4u: type[ad.Array4u]
else:
    Array2f = Array2f64 = Array2u = Array3f = Array3f64 = Array4f = Array4f64 = Array4u = Any
    Bool = Float = Float64 = Int32 = UInt32 = UInt64 = Any
    ArrayTypes = DrJitArray = Real = Triple = Upload = Vector = Vector64 = Any


class Record:
    """Keep keyword values, exactly the annotated ones, and refuse changes."""

    def __init__(self, **values: Any):
        expected = set(type(self).__annotations__)
        if set(values) != expected:
            raise TypeError(f"{type(self).__name__} takes {sorted(expected)}, got {sorted(values)}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen; make a new one to change {name}")


# Numbers, NumPy arrays or Dr.Jit arrays: what a law takes and gives that is written once for all of them.
Numbers: TypeAlias = Any
