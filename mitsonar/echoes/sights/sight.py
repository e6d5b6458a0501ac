"""Sights: points as a sonar sees them along one way."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mitsonar.scene.tracing.connection import Connection

from ..record import EchoLeg


@dataclass(frozen=True, kw_only=True)
class Sight:
    """Ways to points and their gains, one per entry."""

    way: Connection
    leg: EchoLeg
    gain: mi.Float  # (R,) [1/m²]: g
    factor: tuple[mi.Float, mi.Float] | None = None  # (Float, Float): reflection; None: 1
    later: mi.Float64 | None = None  # (R,) [s]: delay beyond the leg's travel time


def complex_product(first: tuple[mi.Float, mi.Float], second: tuple[mi.Float, mi.Float]) -> tuple[mi.Float, mi.Float]:
    """Return the product of two complex numbers, each as real and imaginary part."""
    (a, b), (c, d) = first, second
    return a * c - b * d, a * d + b * c


def product(out: Sight, back: Sight) -> tuple[tuple[mi.Float, mi.Float], mi.Float64]:
    """Return the product of the factors of two sights, and the sum of their delays [s]."""
    size = dr.width(out.gain)
    factors = [sight.factor or (dr.ones(mi.Float, size), dr.zeros(mi.Float, size)) for sight in (out, back)]
    later = dr.zeros(mi.Float64, size)
    for sight in (out, back):
        later = later if sight.later is None else later + sight.later
    return complex_product(*factors), later


def path_of(there: str, back: str) -> str:
    """Return the name of the path to a target and back, from what each leg goes by: "", "s" or "b"."""
    word = there + "b" + back
    return min(word, word[::-1])
