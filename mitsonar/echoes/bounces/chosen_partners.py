"""Partners of the ends of paths: which end of its row each is connected with, chosen by what the two would bring.

Of M candidates that are drawn without a look (`partners`), each with its chance q_k, one is kept with a chance in
proportion to f_k / q_k. f is the root of about what the pair brings: the sonar equation of the path along the
straight line between the ends, no matter what stands in the way. What the path brings is then divided by

    q = f M / Σ_k (f_k / q_k)

Its mean is that of partners drawn in any other way, however wrong f is, as long as f is above 0 wherever something is
heard (resampled importance sampling: Talbot, Cline and Egbert 2005, eq. 4). What a better f saves is noise. Without the
root loud pairs would take nearly all draws, and bins that hear faint pairs alone, as those of shadows, a few of them.

What the pair brings counts the beams towards the partner, both strengths, the distance, and the length of the whole
path to the power `LATE`: late bins are quieter, and shall not be forgotten for early ones. Rays bend. Ends that do not
see each other along the straight line count if a ray that is bent as the water bends it may leave one for the other,
and strengths are asked for no lower than `LOWEST` above the surfaces.

Partners: which ray of a row another one is paired with, and the chance of that.

Half of the partners are drawn evenly from the row, half near the ray: in either coordinate at the distance m with
chance log((m + 2) / (m + 1)), so that all scales get their share.
"""
from __future__ import annotations

from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, looped
from mitsonar.device.chance import Salt, other_pair, pair, salted, uniform
from mitsonar.device.types import UInt32
from mitsonar.scene.materials import bistatic_strength
from mitsonar.scene.tracing.launch import Strata
from mitsonar.water.profile import SoundSpeedProfile

from ..sonar_equation import GRAZING, passed_on, scattered
from .path_ends import Ends, image_of

EVEN_SHARE = 0.5                   # of the partners that are drawn evenly


def partners(strata: Strata, key: mi.UInt32) -> tuple[mi.UInt32, mi.Float]:
    """Draw a partner of the same row for every ray."""
    # key (R,) -> partner (R,), chance (R,)
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


CANDIDATES = 8                     # M
LATE = 3
LOWEST = 0.02                      # sine of a grazing angle
FAINTEST = 1e-5                    # added to strengths: a law that is 0 along the straight line may not be beside it
NEAREST = 1e-6                     # [m] below which two ends are one


class ChosenPartners:
    """Choose partners."""
    # frequency [Hz]

    def __init__(self, profile: SoundSpeedProfile, *, frequency: float, surface: int):
        self._frequency, self._lib = frequency, arrays_of(mi.Float)
        self._surface, self._count = dr.opaque(mi.UInt32, surface), dr.opaque(mi.UInt32, CANDIDATES)
        # by how much, per metre, rays may leave higher than the straight line, and lower
        slowest = float(profile.sound_speed.min())
        bend = np.diff(profile.sound_speed) / (np.diff(profile.depth) * slowest)
        self._bends = [dr.opaque(mi.Float, np.max(some, initial=0.0)) for some in (-bend, bend)]

    def choose(self, a: Ends, b: Ends, seen: mi.Float, strata: Strata, key: mi.UInt32, *, folded: bool,
               unlike: bool | None) -> tuple[mi.UInt32, mi.Float]:
        """Choose an end of b for every end of a."""
        # seen (R,); key (R,) -> partner (R,), chance (R,)
        _, within, _, _ = strata.split(dr.arange(mi.UInt32, strata.rays))
        wanted = None if unlike is None else dr.opaque(mi.Bool, unlike)

        def look(k: mi.UInt32, total: mi.Float, partner: mi.UInt32, worth: mi.Float) -> tuple[Any, ...]:
            its_key = salted(key, Salt.CANDIDATE, k)
            candidate, chance = partners(strata, its_key)
            brings = self._brings(a, b.chosen(candidate), dr.gather(mi.Float, seen, candidate), strata, folded, wanted)
            weight = brings / chance
            total = total + weight
            bits, _ = other_pair(within, its_key)
            kept = (weight > 0) & (uniform(self._lib, bits) * total < weight)
            return (k + 1, total, dr.select(kept, candidate, partner), dr.select(kept, brings, worth))

        none = dr.zeros(mi.Float, strata.rays)
        state = (mi.UInt32(0), none, dr.zeros(mi.UInt32, strata.rays), mi.Float(none))
        _, total, partner, worth = looped(state, lambda k, *_: k < self._count, look, "partners")
        chance = dr.select(total > 0, worth * mi.Float(self._count) / total, 0)
        dr.eval(partner, chance)
        return partner, chance

    def _brings(self, a, b, seen, strata, folded, unlike):
        """f, but for what all pairs of an end of a have in common."""
        way = mi.Vector3f(b.point - (image_of(a.point) if folded else a.point))
        distance = dr.norm(way)
        towards = way / dr.maximum(distance, NEAREST)
        leaving = mi.Vector3f(towards.x, towards.y, -towards.z) if folded else towards
        strength_a, seen_a = self._strength(a, leaving, distance, folded)
        strength_b, seen_b = self._strength(b, -towards, distance, folded)
        active = a.valid & b.valid & seen_a & seen_b & (distance > NEAREST)
        if unlike is not None:
            active &= ((a.label == self._surface) != (b.label == self._surface)) == unlike
        sine_b = -dr.dot(b.hits.normal, b.hits.arrival_direction)
        power = scattered(b.solid_angle * mi.Float(strata.per_row) * seen * strength_a, strength_b, sine_b)
        length = distance + mi.Float((a.leg.travel_time + a.between + b.leg.travel_time) * b.hits.sound_speed)
        brings = passed_on(power, spreading_area=dr.square(distance), patch=b.patch / CANDIDATES) * length ** LATE
        return dr.select(active & dr.isfinite(brings), dr.sqrt(brings), 0)

    def _strength(self, end, towards, distance, folded):
        """Strength of ends about along straight lines, and whether bent rays may lead there."""
        up, down = (dr.maximum(*self._bends),) * 2 if folded else self._bends
        normal = end.hits.normal
        sine = dr.dot(normal, towards)
        bend = distance * (dr.maximum(normal.z, 0) * up + dr.maximum(-normal.z, 0) * down)
        lifted = dr.normalize(towards + dr.maximum(LOWEST - sine, 0) * normal)
        possible = sine + bend > GRAZING
        strength, _ = bistatic_strength(end.hits, lifted, end.valid & possible, self._frequency)
        return strength + FAINTEST, possible
