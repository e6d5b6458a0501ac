"""Survey area as a shapely polygon or multipolygon.

A point is inside if it lies within an odd number of rings, so holes and islands within holes need no rule of their own.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

MOST_CORNERS = 20_000
_BESIDE = 1e-10, 1e-13             # of a grid's extent: nodes on the west and south border count as inside
Area = shapely.Polygon | shapely.MultiPolygon


@dataclass(frozen=True, kw_only=True)
class LineFrame:
    """Coordinate frame along and across survey lines of one heading [rad], clockwise from north."""

    heading: float

    def along_across(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return s along the lines and u to starboard of them [m]."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return x * sine + y * cosine, x * cosine - y * sine

    def place(self, along: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y [m] of points given along and across the lines."""
        sine, cosine = np.sin(self.heading), np.cos(self.heading)
        return along * sine + across * cosine, along * cosine - across * sine


def corners(area: Area) -> list[np.ndarray]:
    """Return the closed rings of an area, holes included, as arrays (N, 2) [m]."""
    return [shapely.get_coordinates(ring) for ring in shapely.get_rings(shapely.get_parts(area))]


def inside(area: Area, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return a mask (Y, X) of the grid nodes that lie in an area."""
    shapely.prepare(area)
    x, y = (axis + share * np.ptp(axis) for axis, share in zip((x, y), _BESIDE))
    return shapely.contains_xy(area, x, y[:, None])


def inside_rows(area: Area, frame: LineFrame, along: np.ndarray, across: np.ndarray) -> np.ndarray:
    """Return a mask (S, U) of the nodes along and across the lines that lie in an area."""
    turned = shapely.transform(area, lambda points: np.stack(frame.along_across(*points.T)[::-1], -1))
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
            raise ValueError(f"the area has a ring of {number} corners; a ring needs at least three different corners.")
    parts = np.array([shapely.Polygon(ring) for ring in rings])
    if not np.all(shapely.area(shapely.convex_hull(parts)) > 0):
        raise ValueError("the area has no extent: its corners lie on a line; draw a polygon.")
    crossing = _crossing(parts)
    if crossing is not None:
        raise ValueError(f"the area crosses itself near x = {crossing[0]:.7g}, y = {crossing[1]:.7g}; list the "
                         "corners in order around the area.")
    parts = shapely.make_valid(parts)                  # a ring may touch itself
    while len(parts) > 1:
        pairs = len(parts) // 2 * 2
        parts = np.append(shapely.symmetric_difference(parts[:pairs:2], parts[1:pairs:2]), parts[pairs:])
    return parts[0]


def _crossing(parts: np.ndarray) -> Sequence[float] | None:
    """Return the point where a ring crosses itself or another ring, or None. Touching is allowed."""
    for reason in shapely.is_valid_reason(parts):
        if reason.startswith("Self-intersection"):
            return [float(value) for value in reason[reason.index("[") + 1:-1].split()]
    first, second = shapely.STRtree(parts).query(parts, predicate="overlaps")
    if not first.size:
        return None
    return shapely.get_coordinates(shapely.intersection(*shapely.boundary(parts[[first[0], second[0]]])))[0]
