"""Places in tables that are never outside the table, NaN included.

Dr.Jit's `clip`, `minimum` and `maximum` let NaN through, and `UInt32(NaN)` is 4294967295: a gather there reads whatever
lies outside the table, or ends the process. A comparison with NaN is false; `held` relies on that.
"""
from typing import TypeVar, cast

import drjit as dr

from .types import Float, Float64

__all__ = ["held"]

Place = TypeVar("Place", Float, Float64)


def held(value: Place, low: Place | float, high: Place | float) -> Place:
    """Keep values within [low, high], a Dr.Jit array of the same type; NaN becomes `low`."""
    return cast(Place, dr.select(value > low, dr.minimum(value, high), low))
