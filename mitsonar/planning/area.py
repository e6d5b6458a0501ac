"""The area that a survey is to cover, as a shapely polygon or several with holes.

A place is inside where it lies within an odd number of rings, so that holes and islands within holes need no rule of
their own.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

MOST_CORNERS = 20_000
_BESIDE = 1e-10, 1e-13             # of a grid's extent: of nodes on a border, those to the west and south are in
Area = shapely.Polygon | shapely.MultiPolygon


@dataclass(frozen=True, kw_only=True)
class LineFrame:
    """Places along and across lines of one heading [rad], clockwise from north."""

    heading: float

    def along_across(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return s along the lines and u to starboard of them [m]."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return x * sine + y * cosine, x * cosine - y * sine

    def place(self, along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y [m] of a place: the way back."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return along * sine + across * cosine, along * cosine - across * sine


def corners(area: Area) -> list[np.ndarray]:
    """Return the closed rings of an area, arrays (N, 2) [m], holes among them."""
    return [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(area))]


def inside(area: Area, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return which nodes of a grid lie in an area: bool array (Y, X)."""
    shapely.prepare(area)
    x, y = (axis + share * np.ptp(axis) for axis, share in zip((x, y), _BESIDE))
    return shapely.contains_xy(area, x, y[:, None])


def inside_rows(area: Area, frame: LineFrame, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return which nodes of a lattice along and across lines lie in an area: bool array (S, U)."""
    turned = shapely.transform(area, lambda places: np.stack(frame.along_across(*places.T)[::-1], -1))
    return inside(turned, across, along)


def polygon(rings: Sequence[np.ndarray]) -> Area:
    """Return the area within rings (N, 2) [m], closed or not."""
    if not rings:
        raise ValueError("the area is empty: it has no ring of corners; draw a polygon.")
    if sum(map(len, rings)) > MOST_CORNERS:
        raise ValueError(f"the area has {sum(map(len, rings))} corners, more than {MOST_CORNERS}; simplify it.")
    for ring in rings:
        if not np.isfinite(ring).all():
            raise ValueError("the area has a corner that is not a finite number; repair it.")
        if (number := len(np.unique(ring, axis=0))) < 3:
            raise ValueError(f"the area has a ring of {number} corners; it needs three that differ.")
    parts = np.array([shapely.Polygon(ring) for ring in rings])
    if not np.all(shapely.area(shapely.convex_hull(parts)) > 0):
        raise ValueError("the area has no extent: its corners lie on a line; draw a polygon.")
    crossing = _crossing(parts)
    if crossing is not None:
        raise ValueError(f"the area crosses itself near x = {crossing[0]:.7g}, y = {crossing[1]:.7g}; give the corners "
                         "in their order around it.")
    parts = shapely.make_valid(parts)                  # rings that touch themselves
    while len(parts) > 1:
        pairs = len(parts) // 2 * 2
        parts = np.append(shapely.symmetric_difference(parts[:pairs:2], parts[1:pairs:2]), parts[pairs:])
    return parts[0]


def _crossing(parts: np.ndarray) -> Sequence[float] | None:
    """Return where a ring crosses itself or another; None if none does. A ring may touch itself."""
    for reason in shapely.is_valid_reason(parts):
        if reason.startswith("Self-intersection"):
            return [float(value) for value in reason[reason.index("[") + 1:-1].split()]
    one, other = shapely.STRtree(parts).query(parts, predicate="overlaps")
    if not one.size:
        return None
    return shapely.get_coordinates(shapely.intersection(*shapely.boundary(parts[[one[0], other[0]]])))[0]
