"""Reach of a swath to the sides over a bed of any depth, through water that bends its rays.

A level sonar at depth h sends its outermost beam at the angle Θ from the vertical. A ray of angle θ at the head keeps

    p = sin(θ) / c(h)            r(θ, d) = ∫_h^d  p c / sqrt(1 - p² c²) dz

and reaches the depth d at the distance r. It gets there only if p c < 1 on its way: rays that turn back upwards are not
counted. So the bed at depth d is within the swath up to

    reach(d) = r(min(Θ, θ_turn(d)), d)              and not farther than sqrt(R² - (d - h)²)

Θ -> ``half_angle``, h -> ``head_depth``, R -> ``max_range``, c -> ``profile``. `SwathRays.angle` is the way back, from
a place to the angle: that of the chord, and what bending adds to it, from a table.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from mitsonar.propagation.numpy_rays.layers import Layers
from mitsonar.units import Values
from mitsonar.water.profile import SoundSpeedProfile

DEPTHS, ANGLES = 256, 128          # of the tables
FLATTEST = 1e-3                    # [rad] above the horizontal, of rays that count at their fastest depth


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathRays:
    """Tables of a swath's rays: reach (D,) [m] over depth (D,) [m], and what bending adds to the angles of chords.

    ``bent`` (K, A) [rad] is the angle at the head less that of the chord, over K even depths and A even angles of it.
    """

    head_depth: float
    half_angle: float
    depth: np.ndarray
    reach: np.ndarray
    bent: np.ndarray

    def reach_at(self, depth: Values) -> Values:
        """Return how far to the side [m] a bed of a depth [m] is in the swath; 0 at and above the head."""
        return cast(Values, np.interp(depth, self.depth, self.reach))

    def angle(self, distance: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return the angle from the vertical at the head [rad] of the ray to a bed at a distance and a depth [m]."""
        from scipy.ndimage import map_coordinates

        below = np.maximum(depth - self.head_depth, 1e-9)
        chord = np.arctan2(distance, below)
        rows, columns = self.bent.shape
        span = self.depth[-1] - self.head_depth
        place = np.stack([below / span * (rows - 1), chord / _farthest_chord() * (columns - 1)])
        return chord + map_coordinates(self.bent, place.reshape(2, -1), order=1, mode="nearest").reshape(chord.shape)


def _farthest_chord() -> float:
    return 0.5 * np.pi


def swath_rays(profile: SoundSpeedProfile, *, head_depth: float, half_angle: float, deepest: float,
               max_range: float = np.inf) -> SwathRays:
    """Trace the rays of a swath down to the deepest bed [m], which ends at ``max_range`` [m].

    `ValueError` if the bed lies above the head, or the angle or the range is out of its range.
    """
    if not deepest > head_depth >= 0:
        raise ValueError(f"the sonar's head is at {head_depth:g} m and the bed nowhere deeper than {deepest:g} m; the "
                         "head must be in the water and above the bed.")
    if not 0 < half_angle < 0.5 * np.pi:
        raise ValueError(f"the swath is {2 * np.rad2deg(half_angle):g} degrees; give more than 0 and less than 180.")
    if not max_range > 0:
        raise ValueError(f"the largest range is {max_range:g} m; it must be above 0.")
    even = np.linspace(head_depth, deepest, DEPTHS + 1)
    nodes = profile.depth[(profile.depth > head_depth) & (profile.depth < deepest)]
    depth = np.union1d(even, nodes[:: -(-nodes.size // DEPTHS)] if nodes.size else nodes)
    angle = np.full(depth.size - 1, half_angle)
    reach = distance(profile, head_depth, depth[1:], angle)
    below = depth[1:] - head_depth
    longest = np.sqrt(np.maximum(max_range**2 - below**2, 0)) if np.isfinite(max_range) else np.inf
    return SwathRays(head_depth=float(head_depth), half_angle=float(half_angle), depth=depth,
                     reach=np.r_[0.0, np.minimum(reach, longest)], bent=_bending(profile, head_depth, even, half_angle))


def distance(profile: SoundSpeedProfile, head_depth: float, depth: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return how far to the side [m] rays are at depths (N,) [m]; for rays that turn before, that of the flattest."""
    layers = Layers.between(profile, np.full(depth.size, float(head_depth)), depth)
    cosine = np.minimum(np.sin(angle) * layers.fastest / profile.at(head_depth), np.cos(FLATTEST))
    return cosine / layers.fastest * layers.reach(np.sqrt(1 - cosine**2), cosine)[0]


def _bending(profile: SoundSpeedProfile, head_depth: float, depth: np.ndarray, half_angle: float) -> np.ndarray:
    """Return the angle at the head less the chord's, over even depths and even angles of the chord (K, A)."""
    angles = np.linspace(0.0, half_angle, ANGLES)
    below = depth[1:]
    chords = np.stack([np.arctan2(distance(profile, head_depth, below, np.full(below.size, one)), below - head_depth)
                       for one in angles], axis=1)
    even = np.linspace(0.0, _farthest_chord(), ANGLES)
    rows = [np.interp(even, row, angles - row) for row in chords]
    return np.array([rows[0], *rows])
