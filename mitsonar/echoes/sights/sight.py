"""A point as a sonar sees it, along one way."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from mitsonar.scene.tracing.connection import Connection

from ..record import EchoLeg


@dataclass(frozen=True, kw_only=True)
class Sight:
    """How points are seen, one an entry."""

    way: Connection
    leg: EchoLeg
    gain: mi.Float  # (R,) [1/m²]: g
    factor: tuple[mi.Float, mi.Float] | None = None  # (Float, Float)
    later: mi.Float64 | None = None  # (R,) [s]: how much later than along the leg sound is there


def product(out: Sight, back: Sight) -> tuple[tuple[mi.Float, mi.Float], mi.Float64]:
    """Return the product of the factors of two legs, and how much later sound is there along both [s]."""
    size = dr.width(out.gain)
    (a, b), (c, d) = (some.factor or (dr.ones(mi.Float, size), dr.zeros(mi.Float, size)) for some in (out, back))
    later = dr.zeros(mi.Float64, size)
    for some in (out, back):
        later = later if some.later is None else later + some.later
    return (a * c - b * d, a * d + b * c), later


def path_of(there: str, back: str) -> str:
    """Return the name of the path to a target and back, by what the legs go by: "", "s" or "b"."""
    word = there + "b" + back
    return min(word, word[::-1])
