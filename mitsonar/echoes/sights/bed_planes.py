"""The plane of the bed under each target, for echoes by way of the bed.

    z = a + b x + c y,      a, b, c by least squares over the bed within 2 h + r of the target's middle

h is the target's height over the bed, r its radius. The root mean square σ of the bed's deviation from the plane counts
as roughness. Sound that reaches a target at more than 27 degrees from the horizontal bounces within 2 h of its foot.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.materials import reflects
from mitsonar.scene.protocols import is_smooth, target_shape
from mitsonar.scene.shadows.bed_cover import ROUNDING, bed_height

SPOTS = 61                         # points of the bed to which a plane is fitted
FEWEST = 12                        # least number of these points that must lie on a bed
CLOSE = 0.1                        # [m] least radius


@dataclass(frozen=True, kw_only=True)
class Planes:
    """Planes of the bed, one per entry."""

    known: mi.Bool  # (R,): True if there is one
    height: mi.Float64  # (R,) [m]: at x = y = 0
    slope: tuple[mi.Float64, mi.Float64]  # (Float64, Float64) [-]: b and c
    rest: mi.Float  # (R,) [m]: σ


class BedPlanes:
    """Planes under the point targets and the smooth shapes of a scene."""

    def __init__(self, geometry: Geometry):
        self.table, self._geometry = np.zeros((len(geometry.named) + 1, 5)), geometry
        targets = _targets(geometry) if reflects(geometry) else {}
        self._moving = [body.label for body in geometry.bodies if body.label in targets]
        self._fit(targets)
        geometry.follow(self._moved)

    def _moved(self) -> None:
        """Fit the planes under the targets that move."""
        if self._moving:
            self.table[self._moving] = 0
            self._fit({label: ball for label, ball in _targets(self._geometry).items() if label in self._moving})

    def _fit(self, targets: dict) -> None:
        """Fit the planes under targets."""
        geometry = self._geometry
        if targets:
            middle = np.array([middle for middle, _ in targets.values()])
            radius = np.array([radius for _, radius in targets.values()])
            over = middle[:, 2] - bed_height(geometry, *middle[:, :2].T)
            near_bed = over + radius > 0                                 # False also where there is no bed
            label = np.array(list(targets))[near_bed]
            self.table[label] = _planes(geometry, middle[near_bed],
                                        np.maximum(radius + 2 * np.maximum(over, 0), CLOSE)[near_bed])
        self._device = upload(mi.Float64, self.table)
        dr.eval(self._device)

    def __bool__(self) -> bool:
        return bool(self._moving) or bool(self.table[:, 4].any())

    def of(self, label: mi.UInt32) -> Planes:
        """Return the planes under targets with these labels, UInt32 (R,)."""
        a, b, c, rest, known = (dr.gather(mi.Float64, self._device, 5 * label + k) for k in range(5))
        return Planes(known=known > 0, height=a, slope=(b, c), rest=mi.Float(rest))

    def image(self, point: np.ndarray, label: np.ndarray) -> np.ndarray:
        """Return the images of points, (R, 3) or one (3,), in the planes under targets (R,): (R, 3) [m]."""
        a, b, c = self.table[label, :3].T
        normal = np.stack([-b, -c, np.ones_like(a)], -1) / np.sqrt(1 + b * b + c * c)[:, None]
        point = np.broadcast_to(point, normal.shape)
        height = (point[:, 2] - a - b * point[:, 0] - c * point[:, 1]) * normal[:, 2]
        return point - 2 * height[:, None] * normal


def first_zone(wavelength: mi.Float, first: mi.Float, second: mi.Float) -> mi.Float:
    """Return the width 2 √(λ l_1 l_2 / (l_1 + l_2)) [m], across the way, of the first Fresnel zone on a plane.

    l_1 and l_2, `first` and `second` [m], are the lengths of the way to the plane and from it.
    """
    return dr.maximum(2 * dr.sqrt(wavelength * first * second / dr.maximum(first + second, 1e-6)), 1e-6)


def _targets(geometry):
    """Return middle (3,) and radius [m] of point targets and smooth shapes, by label; beds are left out."""
    balls = {target.label: (target.position, 0.0) for target in geometry.targets()}
    for _, shape, first, count in geometry.meshes:
        if is_smooth(shape) and target_shape(shape) is None:
            vertices, faces = geometry.mesh(first, count)
            labels = geometry.named.of_faces(shape, count)
            for label in np.unique(labels):
                balls[int(label)] = _ball(vertices[faces[labels == label]].reshape(-1, 3).astype(float))
    for _, shape in geometry.others:
        if is_smooth(shape):
            box = shape.bbox()
            balls[geometry.named.of(shape)] = _ball(np.array([box.min, box.max], float))
    return {label: ball for label, ball in balls.items() if label in geometry.named.objects}


def _ball(points):
    """Return the middle of the box around points (V, 3), and its horizontal half-diagonal [m]."""
    low, high = points.min(0), points.max(0)
    return 0.5 * (low + high), 0.5 * float(np.hypot(*(high - low)[:2]))


def _planes(geometry, middle, radius):
    """Return rows of the table for places (T, 3) and radii (T,) [m]; zeros where there is too little bed."""
    # spread evenly over a disc (Vogel 1979)
    number = np.arange(SPOTS)
    share, turn = np.sqrt((number + 0.5) / SPOTS), number * np.pi * (3 - np.sqrt(5))
    spots = radius[:, None, None] * np.stack([share * np.cos(turn), share * np.sin(turn)], -1)             # (T, S, 2)
    x, y = np.moveaxis(spots + middle[:, None, :2], -1, 0)
    heights = bed_height(geometry, x.ravel(), y.ravel()).reshape(x.shape)
    return np.array([_plane(*row) for row in zip(middle, spots, heights)]).reshape(-1, 5)


def _plane(middle, spots, z):
    """Return a row of the table: a, b, c, σ and 1."""
    there = np.isfinite(z)
    if there.sum() < FEWEST:
        return np.zeros(5)
    z, columns = z[there], np.concatenate([np.ones((there.sum(), 1)), spots[there]], 1)
    (a, b, c), *_ = np.linalg.lstsq(columns, z, rcond=None)
    rest, rounding = np.sqrt(np.mean((z - columns @ [a, b, c]) ** 2)), ROUNDING * np.abs(z).max()
    if np.ptp(z) < 2 * rounding:                                         # level, except for rounding
        a, b, c, rest = np.median(z), 0.0, 0.0, 0.0
    return np.array([a - b * middle[0] - c * middle[1], b, c, rest if rest > rounding else 0.0, 1.0])
