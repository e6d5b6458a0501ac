"""Name the types of arrays in annotations, and define `Record`.

At run time all types are `typing.Any`, so that naming one imports nothing. A type checker sees Dr.Jit's declarations.

A loop traced by `dr.syntax` carries every visible dataclass as loop state and writes its fields back, which frozen
dataclasses refuse. Tables that a loop only reads are therefore a `Record`, a plain object.
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
    # three components: Array3f, or Mitsuba's points and vectors
    Vector: TypeAlias = ArrayBase[Any, Any, Float, Any, Float, Any, Any]
    Vector64: TypeAlias = ArrayBase[Any, Any, Float64, Any, Float64, Any, Any]

    # three components in a tuple, an array (3,) or a vector on the device
    Triple: TypeAlias = Sequence[Any] | np.ndarray | Vector | Vector64

    class Upload(Protocol):
        """Copy values to a device array of a type, as `device.arrays.upload` does."""

        def __call__(self, kind: Any, values: np.ndarray, /) -> Any: ...

    class ArrayTypes(ModuleType):
        """Hold the array types of one backend, such as the module `drjit.llvm.ad`."""

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
        Array3f: type[ad.Array3f]
        Array4f: type[ad.Array4f]
        Array4f64: type[ad.Array4f64]
        Array4u: type[ad.Array4u]
        Matrix3f64: type[ad.Matrix3f64]
else:
    Array2f = Array2f64 = Array2u = Array3f = Array3f64 = Array4f = Array4f64 = Array4u = Any
    Bool = Float = Float64 = Int32 = UInt32 = UInt64 = Any
    ArrayTypes = DrJitArray = Real = Triple = Upload = Vector = Vector64 = Any


class Record:
    """Hold keyword values for exactly the annotated names, frozen."""

    def __init__(self, **values: Any):
        expected = set(type(self).__annotations__)
        if set(values) != expected:
            raise TypeError(f"{type(self).__name__} takes {sorted(expected)}, got {sorted(values)}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen; make a new one to change {name}")


# numbers, NumPy arrays or Dr.Jit arrays: arguments and results of laws written once for all
Numbers: TypeAlias = Any
