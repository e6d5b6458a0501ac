"""Many layers at once: what a ray gathers in the whole layers of a cast, from a table that is made once.

Sums over layers depend on the ray's slowness p alone. With v = √(1/c_m² - p²), c_m the fastest speed among the nodes,
they are analytic in v but at v = 0, where a ray turns, so that Chebyshev polynomials in v on [0.15, 1] / c_m give them
within 1e-12 by 40 coefficients: the nearest singularity leaves (1.35 + √(1.35² - 1))^-40 = 6e-15 before it is scaled by
the sums' own growth towards it.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..propagation.layers import atan_ratio, atanh_ratio
from ..water import SoundSpeedProfile

__all__ = ["Column", "crossed"]

FLATTEST = 0.15                    # v c_m of the flattest ray the table knows: the sine at the fastest depth
COEFFICIENTS = 40


def crossed(slowness: np.ndarray, thickness: np.ndarray, upper_speed: np.ndarray, lower_speed: np.ndarray
            ) -> tuple[np.ndarray, ...]:
    """Cross layers, by the forms of `legs`: x / p, dx/dp [m²/s], time [s] and length [m] of each.

    All arguments broadcast. NaN where a ray turns.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        upper, lower = (np.sqrt(1 - (slowness * speed)**2) for speed in (upper_speed, lower_speed))
        both, step = upper + lower, lower_speed - upper_speed
        stretch = thickness * (upper_speed + lower_speed) / both
        across = lower_speed * upper + upper_speed * lower
        time = 2 * thickness / across * atanh_ratio(step / across)
        return stretch, stretch / (upper * lower), time, 2 * thickness / both * atan_ratio(slowness * step / both)


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """The layers between some nodes of a profile.

    Attributes
    ----------
    first : int
        Number of the topmost of the nodes.
    fastest : float [m/s]
    table : array (nodes, 4, coefficients)
        Chebyshev coefficients of `crossed`'s sums from the first node down to each.
    """

    first: int
    fastest: float
    table: np.ndarray

    @staticmethod
    @lru_cache(maxsize=64)
    def of(profile: SoundSpeedProfile, first: int, last: int) -> Column:
        """Make the table of the layers between two nodes, by their numbers."""
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
        return Column(first=first, fastest=fastest, table=table)

    def knows(self, slowness: np.ndarray) -> np.ndarray:
        """Whether rays are steep enough for the table."""
        return np.abs(slowness) * self.fastest < np.sqrt(1 - FLATTEST**2)

    def between(self, slowness: np.ndarray, upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
        """Give the sums (4, N) of rays that it knows, from nodes to nodes by their numbers (N,)."""
        sine = np.sqrt(1 - (slowness * self.fastest)**2)
        place = (2 * sine - 1 - FLATTEST) / (1 - FLATTEST)
        powers = np.polynomial.chebyshev.chebvander(place, COEFFICIENTS - 1)
        rows = self.table[lower - self.first] - self.table[upper - self.first]
        return np.matmul(rows, powers[:, :, None])[:, :, 0].T
