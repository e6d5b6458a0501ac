"""Increments that are 0 and carry a gradient: what an attached value adds to a detached one.

    y = y_0 + tangent(f(x)),    tangent(f) = 0,  d tangent(f) = df

So a record has the same numbers whether anybody asks for gradients or not, and every derivative is a term of its own.
"""
from __future__ import annotations

from typing import Any, TypeVar

import drjit as dr

__all__ = ["tangent"]

Attached = TypeVar("Attached")


def tangent(value: Attached) -> Attached:
    """Give 0 with the gradient of a Dr.Jit value."""
    zero: Any = dr.zeros(type(value), dr.width(value))
    moving: Any = dr.replace_grad(zero, value)
    return moving
