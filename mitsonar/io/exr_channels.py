"""How the values of a variable stand in the channels of an OpenEXR file, which holds float32, float16 and uint32.

Integers up to 32 bits become uint32. Complex numbers become two channels, ``image.real`` and ``image.imag``. A float64
becomes the nearest float32 in the channel of its own name, which viewers show, and in ``x.rest`` what is missing: the
difference of the two as the integers that their bits are, so that nothing is lost.
"""
from collections.abc import Mapping

import numpy as np

__all__ = ["parts_of", "suffixes", "whole"]

REAL, IMAG, REST = ".real", ".imag", ".rest"
STORED = {"f4": np.float32, "f2": np.float16, "b1": np.uint32, **{f"u{n}": np.uint32 for n in (1, 2, 4)},
          **{f"i{n}": np.int32 for n in (1, 2, 4)}}


def suffixes(kind: np.dtype) -> tuple[str, ...]:
    """Give what the channels of a type have behind the variable's name; none if channels cannot hold it."""
    if kind.str[1:] == "c8":
        return REAL, IMAG
    if kind.str[1:] == "f8":
        return "", REST
    return ("",) if kind.str[1:] in STORED else ()


def parts_of(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Give the channels of values by their `suffixes`.

    Raises
    ------
    ValueError
        If channels cannot hold them; ``name`` is what the error calls them.
    """
    kind = values.dtype
    if not suffixes(kind):
        raise ValueError(f"cannot write {name} as EXR: its type is {kind}, and channels hold float16, float32, "
                         "float64, complex64 and integers of up to 32 bits; cast it with .astype.")
    if kind.kind == "c":
        return {REAL: np.real(values), IMAG: np.imag(values)}
    if kind.str[1:] == "f8":
        return _near_and_rest(name, values)
    stored = STORED[kind.str[1:]]
    values = values.astype(stored, copy=False)
    return {"": values.view(np.uint32) if stored is np.int32 else values}


def whole(parts: Mapping[str, np.ndarray], kind: np.dtype) -> np.ndarray:
    """Give back the values of that type of which `parts_of` made channels."""
    if kind.str[1:] == "c8":
        values = np.empty(parts[REAL].shape, kind)
        values.real, values.imag = parts[REAL], parts[IMAG]
        return values
    if kind.str[1:] == "f8":
        near = parts[""].astype(np.float64).view(np.int64)
        return (near + parts[REST].view(np.int32)).view(np.float64).astype(kind, copy=False)
    values = parts[""]
    return (values.view(np.int32) if kind.kind == "i" else values).astype(kind)


def _near_and_rest(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """The nearest float32, and the rest as whole numbers of the last binary place."""
    values = np.ascontiguousarray(values, np.float64)
    with np.errstate(over="ignore"):
        near = values.astype(np.float32)
    rest = values.view(np.int64) - near.astype(np.float64).view(np.int64)
    if np.any(np.abs(rest) >= 1 << 31):
        raise ValueError(f"cannot write {name} as EXR: some of it is no number near any float32; write it as netCDF.")
    return {"": near, REST: rest.astype(np.int32).view(np.uint32)}
