"""Partners of path ends: the end of the same row that each end is connected with, chosen by the pair's likely energy.

M candidates are drawn without regard to the scene (`partners`), each with its probability q_k. One is kept with a
probability proportional to f_k / q_k, where f is the square root of the pair's likely energy, by the sonar equation
of the path along the straight line between the ends, ignoring obstacles. The path's energy is then divided by

    q = f M / Σ_k (f_k / q_k)

The mean is the same for any other way of drawing partners, however wrong f is, as long as f > 0 wherever there is an
echo (resampled importance sampling: Talbot, Cline and Egbert 2005, eq. 4). A better f only reduces noise. Without the
root, loud pairs would take nearly all draws, and bins with only faint pairs, such as those of shadows, few of them.

f takes into account the beams towards the partner, both strengths, the distance, and the length of the whole path to
the power `LATE`: late bins are quieter, and must not be neglected for early ones. Strengths are those of
`materials.fitted_lobe`, found once for every end and not for every candidate. Rays bend. Ends that do not see each
other along the straight line therefore count if a ray bent by this water may lead from one to the other, and strengths
are evaluated at grazing angles of at least `LOWEST`.

Most of the chosen pairs are faint beside a few loud ones. Of those whose likely energy w = f² / q is below the mean of
the paths of the same row and of about the same length, only the share p = w / mean, or `LEAST_SHARE` if that is more,
is connected, and q becomes q p (Russian roulette: Arvo and Kirk 1990). Pairs whose path is longer than the record are
not connected at all.

Half of the candidates are drawn evenly from the row, half near the ray: at the distance m in either coordinate with
probability log((m + 2) / (m + 1)), so that all scales get their share.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, looped, upload
from mitsonar.device.chance import Salt, other_pair, pair, salted, uniform
from mitsonar.device.types import UInt32
from mitsonar.scene.materials import fitted_lobe
from mitsonar.scene.tracing.launch import Strata
from mitsonar.water.profile import SoundSpeedProfile

from ..sonar_equation import GRAZING, passed_on, scattered
from .path_ends import Ends

EVEN_SHARE = 0.5                   # of the candidates that are drawn evenly


def partners(strata: Strata, ray: mi.UInt32, key: mi.UInt32) -> tuple[mi.UInt32, mi.Float, mi.Float]:
    """Draw a candidate of the same row for every ray of these numbers.

    Return the candidates, the probability of the draw, and another random number in [0, 1), (R,) each.
    """
    row, within, i, j = strata.split(ray)
    first, second = pair(within, key)
    third, fourth = other_pair(first, key)
    even = uniform(strata.lib, third) < EVEN_SHARE
    chosen = []
    for place, count, bits, sign in ((i, strata.first, first, fourth & 1), (j, strata.second, second, fourth & 2)):
        u = uniform(strata.lib, bits)
        wide = dr.minimum(mi.UInt32(u * mi.Float(count)), count - 1)
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
    return cast(UInt32, strata.index(row, *chosen)), chance, uniform(strata.lib, fourth)     # whose low bits are signs


CANDIDATES = 24                    # M
LATE = 3
LEAST_SHARE = 1 / 32               # of faint pairs
A_DOUBLING, LENGTHS = 16, 256      # groups of paths by length [m]: in a doubling of it, and in all
LOWEST = 0.02                      # sine of a grazing angle
FAINTEST = 1e-5                    # added to strengths: a law may be 0 along the straight line but not beside it
NEAREST = 1e-6                     # [m] below which two ends coincide


@dataclass(frozen=True, kw_only=True)
class LikelyEnds:
    """Hold the quantities of ends that the likely energy of their pairs is computed from."""

    point: mi.Vector3f  # (R,) [m]
    normal: mi.Vector3f  # (R,): unit, that the surface scatters by
    back: mi.Vector3f  # (R,): unit, towards where the sound came from
    power: mi.Float  # (R,): of the sonar's beam there, per sine of the grazing angle; 0 where an end is not valid
    length: mi.Float  # (R,) [m]: of the path so far
    patch: mi.Float  # (R,) [m²]
    lobe: tuple[mi.Float, mi.Float, mi.Float]  # (R,): d, s and w of `materials.fitted_lobe`
    at_surface: mi.Float  # (R,): 1 at the sea surface, else 0

    def table(self) -> mi.Float:
        """Return the ends as rows of 16 numbers, each read as four packets."""
        (diffuse, mirrored, width), lib = self.lobe, arrays_of(mi.Float)
        count = dr.width(self.power)
        rows, index = dr.empty(mi.Float, 16 * count), dr.arange(mi.UInt32, count)
        for number, four in enumerate(((*self.point, self.length), (*self.normal, self.power),
                                       (*self.back, self.patch), (diffuse, mirrored, width, self.at_surface))):
            dr.scatter(rows, lib.Array4f(*four), 4 * index + number)
        dr.eval(rows)
        return rows

    @classmethod
    def at(cls, table: mi.Float, index: mi.UInt32) -> LikelyEnds:
        """Return the ends with these numbers of a table."""
        lib = arrays_of(mi.Float)
        first, second, third, fourth = (dr.gather(lib.Array4f, table, 4 * index + number) for number in range(4))
        return cls(point=mi.Vector3f(*first[:3]), length=first[3], normal=mi.Vector3f(*second[:3]), power=second[3],
                   back=mi.Vector3f(*third[:3]), patch=third[3], lobe=(fourth[0], fourth[1], fourth[2]),
                   at_surface=fourth[3])


class ChosenPartners:
    """Choice of a partner for every end."""

    def __init__(self, profile: SoundSpeedProfile, *, frequency: float, surface: int, longest: float):
        # frequency [Hz]; longest [m]: path whose echo is still in the record
        self._frequency, self._lib, self._longest = frequency, arrays_of(mi.Float), dr.opaque(mi.Float, longest)
        self._count, self._surface = dr.opaque(mi.UInt32, CANDIDATES), dr.opaque(mi.UInt32, surface)
        # pairs of bed and surface have partners of their own, apart from pairs of the same kind
        self._kinds = [None] if not surface else [
            lambda a, b: a.at_surface != b.at_surface, lambda a, b: a.at_surface == b.at_surface]
        # largest change of the launch angle per metre, for rays that leave above and below the straight line
        slowest = float(profile.sound_speed.min())
        bend = np.diff(profile.sound_speed) / (np.diff(profile.depth) * slowest)
        self._bends = [dr.opaque(mi.Float, np.max(slope, initial=0.0)) for slope in (-bend, bend)]

    def likely(self, ends: Ends, seen: mi.Float, strata: Strata) -> mi.Float:
        """Return the table of ends (`LikelyEnds`); `seen` (R,) is the intensity of the beam towards the rays."""
        hits = ends.hits
        sine = -dr.dot(hits.normal, hits.arrival_direction)
        power = ends.solid_angle * mi.Float(strata.per_row) * dr.gather(mi.Float, seen, ends.ray)
        return LikelyEnds(
            point=mi.Vector3f(ends.point), normal=hits.normal if hits.smooth is None else hits.smooth,
            back=-hits.arrival_direction, power=dr.select(ends.valid, scattered(power, mi.Float(1), sine), 0),
            length=mi.Float((ends.leg.travel_time + ends.between) * hits.sound_speed), patch=ends.patch,
            lobe=fitted_lobe(hits, ends.valid, self._frequency),
            at_surface=dr.select(ends.label == self._surface, mi.Float(1), 0)).table()

    def choose(self, ends: Ends, own: mi.Float, others: mi.Float, strata: Strata, key: mi.UInt32, *,
               folded: bool) -> list[tuple[mi.UInt32, mi.Float]]:
        """Return for every kind of pair a number of the others for every end, and the probability q, (R,) each.

        `own` and `others` are tables of ends (`likely`). The kinds choose from the same candidates.
        """
        row, within, _, _ = strata.split(ends.ray)
        a = LikelyEnds.at(own, dr.arange(mi.UInt32, dr.width(ends.ray)))

        def add_candidate(k: mi.UInt32, *sums: Any) -> tuple[Any, ...]:
            candidate, chance, number = partners(strata, ends.ray, salted(key, Salt.CANDIDATE, k))
            b = LikelyEnds.at(others, candidate)
            either, length = self._value(ends.valid, a, b, folded)
            state: list[Any] = [k + 1]
            for kind, (total, partner, worth, chosen_length) in zip(self._kinds, zip(*[iter(sums)] * 4)):
                value = either if kind is None else dr.select(kind(a, b), either, 0)
                weight = value / chance
                total = total + weight
                kept = (weight > 0) & (number * total < weight)
                state += [total, dr.select(kept, candidate, partner), dr.select(kept, value, worth),
                          dr.select(kept, length, chosen_length)]
            return tuple(state)

        count = dr.width(ends.ray)
        start = [part for _ in self._kinds for part in (dr.zeros(mi.Float, count), dr.zeros(mi.UInt32, count),
                                                        dr.zeros(mi.Float, count), dr.zeros(mi.Float, count))]
        _, *sums = looped((mi.UInt32(0), *start), lambda k, *_: k < self._count, add_candidate, "partners")
        chosen = []
        for total, partner, worth, length in zip(*[iter(sums)] * 4):
            chance = dr.select(total > 0, worth * mi.Float(self._count) / total, 0)
            energy = a.power * worth * total
            place = held(dr.log2(length) * A_DOUBLING, 0, LENGTHS - 1)
            chosen.append((partner, chance, dr.select(dr.isfinite(energy), energy, 0),
                           row * LENGTHS + mi.UInt32(place), length < self._longest))
        dr.eval(chosen)
        bits, _ = other_pair(within, salted(key, Salt.FAINT_PAIR))
        number = uniform(self._lib, bits)
        chosen = [self._thinned(*pairs, number) for pairs in chosen]
        dr.eval(chosen)
        return chosen

    def _thinned(self, partner: mi.UInt32, chance: mi.Float, energy: mi.Float, group: mi.UInt32, in_record: mi.Bool,
                 number: mi.Float) -> tuple[mi.UInt32, mi.Float]:
        """Return partners and their q, 0 outside the record and where random numbers leave out little likely energy."""
        energies, groups = energy.numpy(), group.numpy()
        # on the host, where the order of additions is the same for any number of threads
        total, count = (np.bincount(groups, weights, minlength=LENGTHS) for weights in (energies, energies > 0))
        enough = dr.gather(mi.Float, upload(mi.Float, total / np.maximum(count, 1)), group)
        share = dr.clip(energy / dr.maximum(enough, 1e-38), LEAST_SHARE, 1)
        return partner, dr.select(in_record & (number < share), chance * share, 0)

    def _value(self, valid: mi.Bool, a: LikelyEnds, b: LikelyEnds, folded: bool) -> tuple[mi.Float, mi.Float]:
        """Return f, except for factors that all pairs of an end of a share, and the length of the path [m]."""
        way = b.point - (mi.Vector3f(a.point.x, a.point.y, -a.point.z) if folded else a.point)
        distance = dr.norm(way)
        towards = way / dr.maximum(distance, NEAREST)
        leaving = mi.Vector3f(towards.x, towards.y, -towards.z) if folded else towards
        strength_a, seen_a = self._strength(a, leaving, distance, folded)
        strength_b, seen_b = self._strength(b, -towards, distance, folded)
        active = valid & seen_a & seen_b & (distance > NEAREST)
        length = distance + a.length + b.length
        energy = passed_on(b.power * strength_a * strength_b, spreading_area=dr.square(distance),
                           patch=b.patch / CANDIDATES) * length ** LATE
        return dr.select(active & dr.isfinite(energy), dr.sqrt(energy), 0), length

    def _strength(self, end: LikelyEnds, towards: mi.Vector3f, distance: mi.Float,
                  folded: bool) -> tuple[mi.Float, mi.Bool]:
        """Return about the strength of ends along straight lines, and whether bent rays may lead there."""
        up, down = (dr.maximum(*self._bends),) * 2 if folded else self._bends
        normal, (diffuse, mirrored, width) = end.normal, end.lobe
        sine = dr.dot(normal, towards)
        bend = distance * (dr.maximum(normal.z, 0) * up + dr.maximum(-normal.z, 0) * down)
        lifted = dr.maximum(sine, LOWEST)
        # 1 + t² of the facet half-way between both directions
        half = dr.square(dr.dot(normal, end.back) + lifted)
        slope = 2 * (1 + dr.dot(end.back, towards)) / half - 1
        strength = dr.fma(diffuse, lifted, mirrored * dr.exp(-width * dr.maximum(slope, 0)))
        return strength + FAINTEST, sine + bend > GRAZING
