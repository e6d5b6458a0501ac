"""Values of a scene that were altered through ``mi.traverse`` since it was loaded.

The values are kept as they were loaded. Dr.Jit never writes in place into an array that has a second owner, so keeping
them costs no copy. An array that is still the same variable is not compared number by number.
"""
from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


def held(scene: mi.Scene) -> dict[str, object]:
    """Return every value that ``mi.traverse`` shows, by its name."""
    parameters = mi.traverse(scene)
    values = ((name, _numbers(parameters[name])) for name in parameters.keys())
    # in variables of their own, which stay when the scene's are written to
    return {name: type(value)(value) if dr.is_array_v(value) else value for name, value in values}


def altered(scene: mi.Scene, before: dict[str, Any]) -> list[str]:
    """Return the names of values that differ from those kept before."""
    parameters = mi.traverse(scene)
    now, then = set(parameters.keys()), set(before)
    return sorted({*(now ^ then), *(name for name in now & then
                                    if not _same(_numbers(parameters[name]), before[name]))})


def _numbers(value):
    """Return the value, or the matrix of a transform."""
    return getattr(value, "matrix", value)


def _same(value, other):
    if type(value) is not type(other):
        return False
    if not dr.is_array_v(value):
        return bool(value == other)
    if dr.shape(value) != dr.shape(other):
        return False
    if dr.is_tensor_v(value):
        value, other = value.array, other.array
    if dr.is_jit_v(value) and dr.depth_v(value) == 1 and value.index == other.index:
        return True
    value, other = dr.detach(value), dr.detach(other)
    # NaN counts as equal to NaN
    return bool(dr.all((value == other) | ((value != value) & (other != other)), axis=None))
