"""Partners: which ray of a row another one is paired with, and the chance of that.

Half of the partners are drawn evenly from the row, half near the ray: in either coordinate at the distance m with
chance log((m + 2) / (m + 1)), so that all scales get their share.
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import mitsuba as mi

from ..device.chance import other_pair, pair, uniform
from ..device.types import UInt32
from ..tracing.launch import Strata

__all__ = ["partners"]

EVEN_SHARE = 0.5                   # of the partners that are drawn evenly


def partners(strata: Strata, key: mi.UInt32) -> tuple[mi.UInt32, mi.Float]:
    """Draw a partner of the same row for every ray.

    Parameters
    ----------
    strata : Strata
        How the rays are numbered.
    key : UInt32 (R,)
        Of the chance; the same for all rays of a row.

    Returns
    -------
    partner : UInt32 (R,)
    chance : Float (R,)
        With which that one was drawn.
    """
    row, within, i, j = strata.split(dr.arange(mi.UInt32, strata.rays))
    first, second = pair(within, key)
    third, fourth = other_pair(first, key)
    even = uniform(strata.lib, third) < EVEN_SHARE
    chosen = []
    for place, count, bits, sign in ((i, strata.first, first, fourth & 1), (j, strata.second, second, fourth & 2)):
        u = uniform(strata.lib, bits)
        wide = dr.minimum(mi.UInt32(u * mi.Float(count)), count - 1)
        # distances m with chance log((m + 2) / (m + 1)): all scales alike
        most = mi.Float(count >> 1)
        step = dr.minimum(mi.UInt32(dr.exp(u * dr.log(most + 2)) - 1), count >> 1)
        near = dr.select(sign != 0, place + step, place + count - step)
        near = dr.select(near >= count, near - count, near)
        chosen.append(dr.select(even, wide, near))
    chance = mi.Float(1)
    for place, partner, count in zip((i, j), chosen, (strata.first, strata.second)):
        apart = dr.select(partner > place, partner - place, place - partner)
        apart = dr.minimum(apart, count - apart)
        m, most = mi.Float(apart), mi.Float(count >> 1)
        both_signs = (apart > 0) & (apart < (count >> 1))
        chance *= dr.log((m + 2) / (m + 1)) / dr.log(most + 2) * dr.select(both_signs, mi.Float(0.5), mi.Float(1))
    chance = EVEN_SHARE / mi.Float(strata.per_row) + (1 - EVEN_SHARE) * chance
    return cast(UInt32, strata.index(row, *chosen)), chance
