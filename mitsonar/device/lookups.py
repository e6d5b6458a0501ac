"""Places in tables that no number leads astray.

Dr.Jit's `clip`, `minimum` and `maximum` let NaN through, and `UInt32(NaN)` is 4294967295: a gather there reads whatever
lies outside the table, or ends the process. A comparison with NaN is false, which is what `held` rests upon.
"""
import drjit as dr

__all__ = ["held"]


def held(value, low, high):
    """Keep values within [low, high], a Dr.Jit array of the same type; NaN becomes `low`."""
    return dr.select(value > low, dr.minimum(value, high), low)
