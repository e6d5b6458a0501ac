"""Scour about objects on a bed: a moat with a tail downstream, and a heap in the lee.

    moat     h = -depth D 16 q^2 (1 - q)^2 (1 - g),   q = d / L < 1
             L / D = extent + (tail - extent) max(cos phi, 0)^2
    heap     h = heap D g,   g = (1 - a^2 - b^2)^2  within the ellipse a^2 + b^2 < 1; without a heap g is 0

D -> ``size`` of the footprint [m], the smaller of the object's width across the current and its height over the bed.
d -> metres from the footprint, phi -> angle from the current, seen from the middle of the footprint. The heap begins
at the downstream end of the footprint, is ``tail`` D long and as wide as the footprint. Without a tail (tail = extent),
without a heap and about a circle of radius R, the volume of the moat is 2 pi depth D L (8/15 R + 4/15 L) with
L = extent D; the volume of a heap is pi/3 heap D times its half axes.

A footprint is the convex outline, seen from above, of the lower half of what stands out of the bed, without parts that
lie far from the rest: more than 2.6 standard deviations of its area, where the corners of a box have 2.45. The bed
under it stays, so that what stands there does not float. These are shapes, no model of flow: the depth is the user's.
About slender piles in a steady current it is 1.3 D (Soulsby 1997; Whitehouse 1998), about low objects
mostly 0.1 to 0.5 D. Marks in the lee of wrecks show the direction of the net transport of sand (Caston 1979).

References
----------
Soulsby (1997), Dynamics of Marine Sands. Whitehouse (1998), Scour at Marine Structures.
Caston (1979), Wreck marks: indicators of net sand transport, Marine Geology 33, 193.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .relief import check

STEEPEST = 16 / (3 * np.sqrt(3))     # slope of 16 q^2 (1 - q)^2, per depth over extent
_LOW = 0.5                           # of an object's height over the bed: what lies lower makes its footprint
_FAR = 2.6                           # standard deviations beyond which parts are no longer of the footprint


@dataclass(frozen=True, kw_only=True, eq=False)
class Footprint:
    """Convex outline of an object where it stands on the bed, and its size in the current."""

    corners: np.ndarray  # (K, 2) [m]: counter-clockwise
    height: float  # [m]: over the bed

    @classmethod
    def of(cls, vertices: np.ndarray, faces: np.ndarray, ground: float) -> Footprint | None:
        """Return the footprint of a body (V, 3) [m], (F, 3) on a bed of height ``ground`` [m]; None if buried."""
        from scipy.spatial import ConvexHull, QhullError

        height = float(vertices[:, 2].max() - ground)
        if height <= 0:
            return None
        low = vertices[:, 2] <= ground + _LOW * height
        near = low & _near(vertices[:, :2], faces[low[faces].all(axis=1)])
        for part in (vertices[near, :2], vertices[low, :2], vertices[:, :2]):
            try:
                hull = ConvexHull(part)
            except (QhullError, ValueError):
                continue                     # fewer than three corners, or all in a line: the whole body has more
            return cls(corners=part[hull.vertices], height=height)
        return None


@dataclass(frozen=True, kw_only=True)
class Scour:
    """Shape of the scour about every object, in sizes of the object."""

    depth: float  # [sizes]: of the moat
    extent: float = 2.0  # [sizes]: width of the moat
    tail: float = 4.0  # [sizes]: reach of the moat downstream, at least the extent
    heap: float | None = None  # [sizes]: height of the heap; None: half the depth
    heading: float = 0.0  # [rad]: compass heading towards which the current flows

    def __post_init__(self):
        for name, holds, expected in (
                ("extent", 0 < self.extent < np.inf, "a finite number above 0"),
                ("depth", 0 <= self.depth * STEEPEST <= self.extent,
                 f"from 0 to {self.extent / STEEPEST:.3g} at an extent of {self.extent:g}, or its sides would be "
                 "steeper than 45 degrees"),
                ("tail", self.extent <= self.tail < np.inf, f"at least {self.extent:g}, the extent"),
                ("heap", self.heap is None or 0 <= self.heap < np.inf, "a finite number, at least 0")):
            check("scour", name, getattr(self, name), holds, expected)

    def width(self, footprint: Footprint) -> float:
        """Return the width of the moat [m]."""
        return self.extent * self._size(footprint)

    def reach(self, footprint: Footprint) -> tuple[np.ndarray, float]:
        """Return the middle (2,) and the radius [m] of a circle outside which the bed stays."""
        middle = footprint.corners.mean(axis=0)
        return middle, float(np.hypot(*(footprint.corners - middle).T).max()) + self.tail * self._size(footprint)

    def cut(self, footprint: Footprint, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the heights (P,) [m] of the moat, at most 0, and of the heap, at least 0, at places x, y (P,) [m]."""
        size, places = self._size(footprint), np.column_stack((x, y))
        seen = places - footprint.corners.mean(axis=0)
        # from the middle, not from the nearest point: a width that changes at corners would show as creases
        downstream = np.maximum(seen @ self._axes()[0], 0) / np.maximum(np.hypot(*seen.T), 1e-9 * size)
        width = size * (self.extent + (self.tail - self.extent) * downstream**2)
        share = np.minimum(_distance(footprint.corners, places) / width, 1)
        height = self.depth / 2 if self.heap is None else self.heap
        lee = self._lee(footprint, x, y) if height else np.zeros(len(places))
        moat = -self.depth * size * 16 * np.square(share * (1 - share)) * (1 - lee)
        return moat, height * size * lee

    def _lee(self, footprint: Footprint, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        ahead, aside = self._axes()
        half = self.tail * self._size(footprint) / 2
        end, sides = (footprint.corners @ ahead).max() + half, footprint.corners @ aside
        place = np.column_stack((x, y))
        along, across = (place @ ahead - end) / half, (place @ aside - (sides.max() + sides.min()) / 2) \
            / (np.ptp(sides) / 2)
        return np.square(np.maximum(1 - along**2 - across**2, 0))

    def _axes(self) -> tuple[np.ndarray, np.ndarray]:
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return np.array([sine, cosine]), np.array([cosine, -sine])

    def _size(self, footprint: Footprint) -> float:
        return min(footprint.height, float(np.ptp(footprint.corners @ self._axes()[1])))


def _near(places: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return True for places (V, 2) [m] that are not far from the middle of the faces' area, seen from above."""
    corners = places[faces]                                        # (F, 3 corners, 2)
    (u, v), middle = (corners[:, 1:] - corners[:, :1]).transpose(1, 0, 2), corners.mean(axis=1)
    area = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    if not area.sum() > 0:
        return np.ones(len(places), bool)
    centre = area @ middle / area.sum()
    corners, middle = corners - centre, middle - centre
    spread = np.einsum("f,fci,fcj->ij", area, corners, corners) + 9 * np.einsum("f,fi,fj->ij", area, middle, middle)
    away = places - centre
    return np.einsum("vi,ij,vj->v", away, np.linalg.pinv(spread / (12 * area.sum())), away) <= _FAR**2


def _distance(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the distance (P,) [m] of places (P, 2) from a convex polygon, 0 inside."""
    square, outside = np.full(len(places), np.inf), np.zeros(len(places), bool)
    for start, end in zip(corners, np.roll(corners, -1, axis=0)):
        edge, way = end - start, places - start
        outside |= edge[0] * way[:, 1] - edge[1] * way[:, 0] < 0
        from_edge = way - np.clip(way @ edge / (edge @ edge), 0, 1)[:, None] * edge
        np.minimum(square, np.einsum("pi,pi->p", from_edge, from_edge), out=square)
    return np.where(outside, np.sqrt(square), 0)
