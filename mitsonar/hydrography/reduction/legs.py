"""Legs of sound between an array and the bed, for many rays in one pass down through the layers.

A ray keeps its horizontal slowness p; its arc through one layer is that of `propagation.numpy_rays.layer_arcs`.

Sound speed at the head: a ray may start with a speed that differs from the cast. This speed then becomes the profile's
node at the ray's start, and the water is linear from there to the next node of the cast below, as in the real-time
processing of an EM 710. Of the tested rules (this one, the head's speed down to the next node, a step to the cast, a
shifted cast, a ramp of 1 to 20 m), only this one reproduces that instrument's two-way times to 1.0 to 1.7 mm, one way
and rms over a ping, and its lever arms to centimetres; a step, or no node, leaves 6 to 9 mm.

Many layers at once: sums over the whole layers of a cast come from a table, made once. They depend on the ray's
slowness p alone. With v = √(1/c_m² - p²), where c_m is the fastest speed among the nodes, they are analytic in v except
at v = 0, where a ray turns. Chebyshev polynomials in v on [0.15, 1] / c_m therefore give them within 1e-12 with 40
coefficients: the nearest singularity leaves (1.35 + √(1.35² - 1))^-40 = 6e-15 times the growth of the sums towards it.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mitsonar.propagation.numpy_rays.layer_arcs import LayerArc, descent_after
from mitsonar.water.profile import SAME_DEPTH, SoundSpeedProfile

FLATTEST = 0.15                    # v c_m of the flattest ray in the table: its sine at the fastest depth
COEFFICIENTS = 40


def crossed(slowness: np.ndarray, thickness: np.ndarray, upper_speed: np.ndarray, lower_speed: np.ndarray
            ) -> tuple[np.ndarray, ...]:
    """Return x / p, dx/dp [m²/s], time [s] and length [m] of rays through layers; all arguments broadcast."""
    with np.errstate(invalid="ignore", divide="ignore"):
        arc = LayerArc.of(slowness, thickness, upper_speed, lower_speed)
        return arc.stretch, arc.slope, arc.time, arc.length(slowness)


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerColumn:
    """Layers between some nodes of a profile."""

    first: int  # number of the top node
    fastest: float  # [m/s]
    table: np.ndarray  # chebyshev coefficients of `crossed`'s sums from the first node down to each

    @staticmethod
    @lru_cache(maxsize=64)
    def of(profile: SoundSpeedProfile, first: int, last: int) -> LayerColumn:
        """Return the table of the layers between two nodes, given by their numbers."""
        depth, speed = profile.depth[first:last + 1], profile.sound_speed[first:last + 1]
        fastest = float(speed.max())
        place = np.cos(np.pi * (np.arange(COEFFICIENTS) + 0.5) / COEFFICIENTS)
        sine = 0.5 * (1 + FLATTEST) + 0.5 * (1 - FLATTEST) * place
        slowness = np.sqrt(1 - sine**2)[:, None] / fastest
        sums = np.zeros((4, COEFFICIENTS, depth.size))
        np.cumsum(crossed(slowness, np.diff(depth), speed[:-1], speed[1:]), axis=2, out=sums[:, :, 1:])
        to_coefficients = np.linalg.inv(np.polynomial.chebyshev.chebvander(place, COEFFICIENTS - 1))
        table = np.ascontiguousarray(np.einsum("cm,qmk->kqc", to_coefficients, sums))
        table.flags.writeable = False
        return LayerColumn(first=first, fastest=fastest, table=table)

    def knows(self, slowness: np.ndarray) -> np.ndarray:
        """Return True for rays that are steep enough for the table."""
        return np.abs(slowness) * self.fastest < np.sqrt(1 - FLATTEST**2)

    def between(self, slowness: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
        """Return the sums (4, N) of rays within the table, from nodes to nodes by their numbers (N,)."""
        sine = np.sqrt(1 - (slowness * self.fastest)**2)
        place = (2 * sine - 1 - FLATTEST) / (1 - FLATTEST)
        powers = np.polynomial.chebyshev.chebvander(place, COEFFICIENTS - 1)
        rows = self.table[lower - self.first] - self.table[upper - self.first]
        return np.matmul(rows, powers[:, :, None])[:, :, 0].T


BLOCK = 2048                       # rays at a time: their layers stay in the processor's cache
FEW = 24                           # layers that are crossed one by one; for more, `LayerColumn` is used


class RayLeg(NamedTuple):
    """Rays from their starts to one depth each: (N,), NaN where a ray turns before.

    ``stretch`` is x / p and ``slope`` dx/dp [m²/s]; ``sine`` and ``speed`` are those at the end.
    """

    stretch: np.ndarray
    slope: np.ndarray
    time: np.ndarray
    length: np.ndarray
    sine: np.ndarray
    speed: np.ndarray

    @classmethod
    def joined(cls, blocks: list[RayLeg]) -> RayLeg:
        """Join blocks of rays."""
        return cls(*map(np.concatenate, zip(*blocks)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Starts:
    """Starts of N rays, and the profile of the water."""

    profile: SoundSpeedProfile
    depth: np.ndarray  # (N,) [m]
    head_speed: np.ndarray | None = None  # (N,) [m/s]: speed at the start, in place of the profile's

    @property
    def speed(self) -> np.ndarray:
        """Return the sound speed at the starts: (N,) [m/s]."""
        return self.profile.at(self.depth) if self.head_speed is None else self.head_speed

    def __getitem__(self, rays: np.ndarray | slice) -> Starts:
        head = None if self.head_speed is None else self.head_speed[rays]
        return Starts(profile=self.profile, depth=self.depth[rays], head_speed=head)

    def coarse(self, time: np.ndarray) -> Starts:
        """Return starts with only a few of the nodes that rays pass within a time (N,) [s], for a first guess."""
        reach = float(self.profile.sound_speed.max()) * np.max(time, initial=0.0, where=np.isfinite(time))
        first, last = self._nodes(self.depth + reach)
        first, last = max(0, first - 1), min(last, self.profile.depth.size - 1)
        some = np.unique(np.linspace(first, last, min(FEW, last - first + 1)).round().astype(int))
        return Starts(profile=SoundSpeedProfile(self.profile.depth[some], self.profile.sound_speed[some]),
                      depth=self.depth, head_speed=self.head_speed)

    def mirrored(self) -> Starts:
        """Return the water upside down, so that upward rays go down."""
        return Starts(profile=self.profile.upside_down(), depth=-self.depth, head_speed=self.head_speed)

    def to_depth(self, slowness: np.ndarray, depth: np.ndarray) -> RayLeg:
        """Trace rays of horizontal slowness (N,) [s/m] down to depths (N,) [m]."""
        parts = range(0, len(depth), BLOCK)
        return RayLeg.joined([self[i:i + BLOCK]._cross(slowness[i:i + BLOCK], depth[i:i + BLOCK]) for i in parts])

    def depth_after(self, slowness: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Return the depths (N,) [m] of downward rays after a time (N,) [s], NaN where a ray turned before."""
        parts = range(0, len(time), BLOCK)
        return np.concatenate([self[i:i + BLOCK]._run(slowness[i:i + BLOCK], time[i:i + BLOCK]) for i in parts])

    def _edges(self, lowest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return depths and speeds (N, L + 1) of the edges of the layers from the starts down to `lowest` (N,)."""
        nodes = self.profile.depth
        first, last = self._nodes(lowest)
        between = np.clip(nodes[first:last], self.depth[:, None], lowest[:, None])
        edges = np.concatenate([self.depth[:, None], between, lowest[:, None]], axis=1)
        return edges, self._speeds(edges)

    def _nodes(self, lowest: np.ndarray) -> tuple[int, int]:
        """Return the numbers of the first node between highest start and lowest end, and of the first one below."""
        highest = np.min(self.depth, initial=np.inf, where=np.isfinite(self.depth))
        deepest = np.max(lowest, initial=-np.inf, where=np.isfinite(lowest))
        return int(np.searchsorted(self.profile.depth, highest)), int(np.searchsorted(self.profile.depth, deepest))

    def _speeds(self, depth: np.ndarray) -> np.ndarray:
        """Return the speeds at depths (N, L) along the rays."""
        speeds = self.profile.at(depth)
        if self.head_speed is None:
            return speeds
        following = self._next()
        down = (depth - self.depth[:, None]) / (following - self.depth)[:, None]
        joined = self.head_speed[:, None] + down * (self.profile.at(following) - self.head_speed)[:, None]
        return np.where((depth < following[:, None]) & np.isfinite(following)[:, None], joined, speeds)

    def _next(self) -> np.ndarray:
        """Return the depth (N,) of the cast's next node below the head's; infinite if there is none."""
        return np.r_[self.profile.depth, np.inf][np.searchsorted(self.profile.depth, self.depth + SAME_DEPTH)]

    def _cross(self, slowness: np.ndarray, depth: np.ndarray) -> RayLeg:
        first, last = self._nodes(depth)
        if last - first > FEW:
            column = LayerColumn.of(self.profile, first, last - 1)
            known = column.knows(slowness) & np.isfinite(depth) & np.isfinite(self.depth)
            if known.all():
                return self._cross_column(column, slowness, depth)
            legs = np.full((len(RayLeg._fields), len(depth)), np.nan)
            legs[:, known] = self[known]._cross_column(column, slowness[known], depth[known])
            legs[:, ~known] = self[~known]._cross_layers(slowness[~known], depth[~known])
            return RayLeg(*legs)
        return self._cross_layers(slowness, depth)

    def _cross_layers(self, slowness: np.ndarray, depth: np.ndarray) -> RayLeg:
        """Return the sums layer by layer."""
        edges, speed = self._edges(depth)
        sums = [one.sum(1) for one in crossed(slowness[:, None], np.diff(edges), speed[:, :-1], speed[:, 1:])]
        with np.errstate(invalid="ignore"):
            sine = np.sqrt(1 - (slowness * speed[:, -1])**2)
        return RayLeg(sums[0], sums[1], sums[2], sums[3], sine, speed[:, -1])

    def _cross_column(self, column: LayerColumn, slowness: np.ndarray, depth: np.ndarray) -> RayLeg:
        """Return the sums of a part of a layer, of whole layers by the table, and of another part."""
        nodes, near = self.profile.depth, SAME_DEPTH if self.head_speed is not None else 0.0
        upper = np.searchsorted(nodes, self.depth + near)
        lower = np.searchsorted(nodes, depth) - 1
        whole = upper <= lower
        stops = np.stack([self.depth, np.where(whole, nodes[upper.clip(max=nodes.size - 1)], depth),
                          np.where(whole, nodes[lower], depth), depth], 1)
        speed = self._speeds(stops)
        pieces = crossed(slowness[:, None], np.diff(stops)[:, ::2], speed[:, ::2], speed[:, 1::2])
        sums = np.stack([one.sum(1) for one in pieces])
        sums += column.between(slowness, np.where(whole, upper, column.first), np.where(whole, lower, column.first))
        with np.errstate(invalid="ignore"):
            sine = np.sqrt(1 - (slowness * speed[:, -1])**2)
        return RayLeg(sums[0], sums[1], sums[2], sums[3], sine, speed[:, -1])

    def _run(self, slowness: np.ndarray, time: np.ndarray) -> np.ndarray:
        fastest = max(float(self.profile.sound_speed.max()), float(np.max(self.speed, initial=0)))
        edges, speed = self._edges(self.depth + fastest * np.where(np.isfinite(time), time, 0.0))
        thickness, step = np.diff(edges), np.diff(speed)
        with np.errstate(invalid="ignore", divide="ignore"):
            sines = np.sqrt(1 - (slowness[:, None] * speed) ** 2)
            arcs = LayerArc(thickness, speed[:, :-1], speed[:, 1:], sines[:, :-1], sines[:, 1:])
            spent = np.cumsum(arcs.time, axis=1)
            spent = np.concatenate([np.zeros_like(spent[:, :1]), np.where(np.isnan(spent), np.inf, spent)], axis=1)
        # The last edge that a ray reaches in time; edges at one depth are passed in no time.
        at = np.minimum((spent <= time[:, None]).sum(1) - 1, thickness.shape[1] - 1).clip(0)
        rays = np.arange(len(time))
        with np.errstate(invalid="ignore", divide="ignore"):
            gradient = np.where(thickness[rays, at] > 0, step[rays, at] / thickness[rays, at], 0)
        return edges[rays, at] + descent_after(time - spent[rays, at], gradient, speed[rays, at], sines[rays, at])
