"""Travel times from points to moving elements, as residuals of those along straight lines.

    c₀ T = R (1 + r(ρ, z, z_s)),      dr/dz_s = c₀ (dT/dz_s / R - T (dR/dz_s) / R²),      dT/dz_s = -sin(θ_s) / c(z_s)

R, ρ -> slant and horizontal distance, z -> the point's depth, z_s -> the element's, c₀ -> ``sound_speed`` of reference,
θ_s -> the launch angle of the exact eigenray, positive down. Exact eigenrays give r, which is smooth, and dr/dz_s for
some z_s, ρ, z; cubic splines interpolate over ρ, cubic Hermite polynomials over z_s (they need only value and slope).
`TravelTables.at` gives a plane of r and its derivatives over (z, ρ) for an element's depth. The device reads this plane
linearly; elements a few centimetres off that depth use the derivatives. Times err by less than 16 ns, except for rays
that leave almost level within 0.2 m of a change of gradient by several 1/s.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water.profile import SoundSpeedProfile

NODES = 385                        # of an eigenray table over the distance, even steps of asinh(ρ/H)
SOURCE_STEP = 0.05                 # [m] of the elements' depths
POINT_STEP = 0.05                  # [m] of the points' depths
RANGE_STEP = 0.04                  # [m] of the planes
MOST_DEPTHS = 256
LEVEL = 1e-3                       # [m] that a level grid's depths may differ by
KEPT = 100                         # nodes of source depths kept to either side
SHALLOWEST = 0.5                   # [m], scale of distances where element and point are at one depth


def bends(profile: SoundSpeedProfile) -> bool:
    """Return True if a profile has more than one sound speed."""
    return bool(np.ptp(profile.sound_speed) > 0)


@dataclass(frozen=True, kw_only=True, eq=False)
class FocalPlane:
    """Residuals for one depth of an element: r, dr/dz_s, half the second derivative, 0."""

    values: np.ndarray  # (Z, N, 4)
    depth: tuple[float, float]  # [m], first node and step of z
    range: tuple[float, float]  # [m], first node and step of ρ


class TravelTables:
    """Residuals of the straight line, computed when they are first used."""

    def __init__(self, profile: SoundSpeedProfile, sound_speed: float,
                 depths: tuple[float, float],           # [m], of the points
                 ranges: tuple[float, float]):          # [m], horizontal
        self.profile, self.sound_speed = profile, sound_speed
        low, high = depths
        if high - low < LEVEL:
            low, high = 0.5 * (low + high) - LEVEL, 0.5 * (low + high) + LEVEL
        count = int(np.clip(np.ceil((high - low) / POINT_STEP), 1, MOST_DEPTHS)) + 1
        self.depth = np.linspace(low, high, count)
        first = max(ranges[0] - RANGE_STEP, 0.0)
        self.range = first + RANGE_STEP * np.arange(int(np.ceil((ranges[1] - first) / RANGE_STEP)) + 2)
        self._known: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def at(self, source_depth: float) -> FocalPlane:
        """Return the residuals for an element's depth [m]."""
        number = int(np.floor(source_depth / SOURCE_STEP))
        share = source_depth / SOURCE_STEP - number
        (a, da), (b, db) = self._node(number), self._node(number + 1)
        rest, h = 1 - share, SOURCE_STEP
        value = a + share * share * (3 - 2 * share) * (b - a) + h * share * rest * (rest * da - share * db)
        slope = 6 * share * rest * (b - a) / h + rest * (1 - 3 * share) * da + share * (3 * share - 2) * db
        bend = (6 - 12 * share) * (b - a) / h ** 2 + ((6 * share - 4) * da + (6 * share - 2) * db) / h
        for distant in [node for node in self._known if abs(node - number) > KEPT]:
            del self._known[distant]
        return FocalPlane(values=np.stack([value, slope, 0.5 * bend, 0 * bend], -1).astype(np.float32),
                     depth=(float(self.depth[0]), float(self.depth[1] - self.depth[0])),
                     range=(float(self.range[0]), RANGE_STEP))

    def _node(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Return r and dr/dz_s (Z, N) for the depth number · `SOURCE_STEP`."""
        if number not in self._known:
            self._known[number] = self._traced(number * SOURCE_STEP)
        return self._known[number]

    def _traced(self, source: float) -> tuple[np.ndarray, np.ndarray]:
        height = self.depth - source
        scale = np.maximum(np.abs(height), SHALLOWEST)
        tables = []
        for z, h, unit in zip(self.depth, height, scale, strict=True):
            ends = np.arcsinh(self.range[[0, -1]] / unit)
            nodes = np.linspace(ends[0], ends[1], NODES)
            across = unit * np.sinh(nodes)
            rays = eigenray(self.profile, source, z, across)
            slant = np.maximum(np.hypot(across, h), 1e-6)
            residual = self.sound_speed * rays.travel_time / slant - 1
            fall = -np.sin(rays.launch_angle) / self.profile.at(source)
            slope = self.sound_speed * (fall / slant + rays.travel_time * h / slant ** 3)
            kept = np.isfinite(residual)
            if np.count_nonzero(kept) < 4:
                raise ValueError(f"no ray leads from {source:g} m of depth to points at {z:g} m; move the grid, or "
                                 "give another profile")
            at = np.clip(np.arcsinh(self.range / unit), nodes[kept][0], nodes[kept][-1])
            tables.append(CubicSpline(nodes[kept], np.stack([residual[kept], slope[kept]], -1))(at))
        both = np.stack(tables)
        return both[..., 0], both[..., 1]
