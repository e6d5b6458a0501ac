"""Reach of a swath over a bed of any depth, through water that refracts its rays.

A level sonar at depth h sends its outermost beam at the angle Θ from the vertical. A ray of angle θ at the head keeps

    p = sin(θ) / c(h)            r(θ, d) = ∫_h^d  p c / sqrt(1 - p² c²) dz

and reaches the depth d at the distance r, provided that p c < 1 all the way: rays that turn back upwards do not count.
The bed at depth d is therefore within the swath up to

    reach(d) = r(min(Θ, θ_turn(d)), d)              and at most sqrt(R² - (d - h)²)

Θ -> ``half_angle``, h -> ``head_depth``, R -> ``max_range``, c -> ``profile``. `SwathRays.angle` inverts this, from a
point to the angle: the angle of the chord plus a correction for refraction from a table.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from mitsonar.propagation.numpy_rays.layers import Layers
from mitsonar.units import Values
from mitsonar.water.profile import SoundSpeedProfile

DEPTHS, ANGLES = 256, 128          # of the tables
FARTHEST_CHORD = 0.5 * np.pi       # [rad]
FLATTEST = 1e-3                    # [rad] from the horizontal: flattest ray that counts, at its fastest depth


@dataclass(frozen=True, kw_only=True, eq=False)
class SwathRays:
    """Tables of the rays of a swath: reach (D,) [m] over depth (D,) [m], and angle corrections for refraction.

    ``bent`` (K, A) [rad] is the angle at the head less that of the chord, over K even depths and A even chord angles.
    """

    head_depth: float
    half_angle: float
    depth: np.ndarray
    reach: np.ndarray
    bent: np.ndarray

    def reach_at(self, depth: Values) -> Values:
        """Return the reach to one side [m] over a bed of a depth [m]; 0 at and above the head."""
        return cast(Values, np.interp(depth, self.depth, self.reach))

    def angle(self, distance: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """Return the angle from the vertical at the head [rad] of the ray to a point at a distance and a depth [m]."""
        from scipy.ndimage import map_coordinates

        below = np.maximum(depth - self.head_depth, 1e-9)
        chord = np.arctan2(distance, below)
        rows, columns = self.bent.shape
        span = self.depth[-1] - self.head_depth
        place = np.stack([below / span * (rows - 1), chord / FARTHEST_CHORD * (columns - 1)])
        return chord + map_coordinates(self.bent, place.reshape(2, -1), order=1, mode="nearest").reshape(chord.shape)


def swath_rays(profile: SoundSpeedProfile, *, head_depth: float, half_angle: float, deepest: float,
               max_range: float = np.inf) -> SwathRays:
    """Return the ray tables of a swath down to the deepest bed [m], out to the slant range ``max_range`` [m]."""
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
    """Return the distance to the side [m] of rays at depths (N,) [m]; rays that turn before count as the flattest."""
    layers = Layers.between(profile, np.full(depth.size, float(head_depth)), depth)
    cosine = np.minimum(np.sin(angle) * layers.fastest / profile.at(head_depth), np.cos(FLATTEST))
    return cosine / layers.fastest * layers.reach(np.sqrt(1 - cosine**2), cosine)[0]


def _bending(profile: SoundSpeedProfile, head_depth: float, depth: np.ndarray, half_angle: float) -> np.ndarray:
    """Return the angle at the head less the chord's (K, A) [rad], over even depths and even chord angles."""
    angles = np.linspace(0.0, half_angle, ANGLES)
    below = depth[1:]
    chords = np.stack([np.arctan2(distance(profile, head_depth, below, np.full(below.size, angle)), below - head_depth)
                       for angle in angles], axis=1)
    even = np.linspace(0.0, FARTHEST_CHORD, ANGLES)
    rows = [np.interp(even, row, angles - row) for row in chords]
    return np.array([rows[0], *rows])
