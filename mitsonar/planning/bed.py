"""Bed of a survey plan: depths on a grid, with missing depths filled from the nearest known node.

Lines run best along the contours: the swath then keeps its width, and the beams meet the bed at even angles. The
heading is the direction in which the depth changes least,

    T = <∇d ∇dᵀ>,            T a = λ a,   λ the smaller of the two

with d smoothed over about a swath width. If no direction stands out (1 - λ/λ' below 0.2), lines run along the area.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_DIFFERENCE = 0.2             # of the eigenvalues, relative to the larger
LEAST_SLOPE = 1e-3                 # rms; a flatter bed has no contours to follow
MOST_NODES = 4_000_000
ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedBed:
    """Depths (Y, X) [m] below the surface on an even grid of x and y [m], and a mask of the surveyed nodes."""

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    known: np.ndarray

    @property
    def step(self) -> tuple[float, float]:
        """Return the spacing of the columns and of the rows [m]."""
        across, along = (float((axis[-1] - axis[0]) / (axis.size - 1)) for axis in (self.x, self.y))
        return across, along

    def places(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return fractional rows and columns (2, ...) of points."""
        across, along = self.step
        return np.stack([(y - self.y[0]) / along, (x - self.x[0]) / across])

    def depth_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the depth [m] at points, linear between nodes; beyond the grid, the depth of its edge."""
        from scipy.ndimage import map_coordinates

        place = self.places(x, y)
        return map_coordinates(self.depth, place.reshape(2, -1), order=1, mode="nearest").reshape(place.shape[1:])

    def window(self, west: float, south: float, east: float, north: float) -> PlannedBed:
        """Return the part within bounds [m], plus a node beyond each if possible; at least 2 by 2 nodes."""
        (left, right), (low, high) = (_span(axis, *ends) for axis, ends in ((self.x, (west, east)),
                                                                            (self.y, (south, north))))
        return PlannedBed(x=self.x[left:right], y=self.y[low:high], depth=self.depth[low:high, left:right],
                          known=self.known[low:high, left:right])


def _span(axis, low, high):
    first = int(np.clip(np.searchsorted(axis, low, side="right") - 1, 0, axis.size - 2))
    last = int(np.clip(np.searchsorted(axis, high) + 1, first + 2, axis.size))
    return first, last


def bed_of(x: np.ndarray, y: np.ndarray, heights: np.ndarray) -> PlannedBed:
    """Return the bed from heights (Y, X) [m], z up, NaN where unknown; `ValueError` if all of it is land."""
    from scipy.ndimage import distance_transform_edt

    factor = int(np.ceil(np.sqrt(heights.size / MOST_NODES)))
    if factor > 1:
        x, y, heights = _coarser(x, y, heights, factor)
    known = np.isfinite(heights)
    if not np.any(heights < 0):
        raise ValueError("no node of the bathymetry lies below the surface; set vertical to "
                         "depth or elevation, whichever its numbers are.")
    depth = -heights.astype(np.float32)
    if not known.all():
        nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
        depth = depth[tuple(nearest)]
    return PlannedBed(x=x, y=y, depth=depth, known=known)


def _coarser(x, y, heights, factor):
    """Return means over squares of ``factor`` nodes a side."""
    rows, columns = heights.shape[0] // factor, heights.shape[1] // factor
    squares = heights[:rows * factor, :columns * factor].reshape(rows, factor, columns, factor)
    known = np.isfinite(squares)
    number = known.sum((1, 3))
    with np.errstate(invalid="ignore"):
        mean = np.where(number > 0, np.where(known, squares, 0).sum((1, 3)) / number, np.nan)
    middle = [axis[:size * factor].reshape(size, factor).mean(1) for axis, size in ((x, columns), (y, rows))]
    return *middle, mean


def flat_bed(depth: float, west: float, south: float, east: float, north: float) -> PlannedBed:
    """Return a level bed of a depth [m] around bounds [m], with at most half a million nodes."""
    longer, shorter = max(east - west, north - south), min(east - west, north - south)
    step = max(np.sqrt(longer * shorter / 5e5), longer / 1e5, min(0.1 * depth, longer / 100, shorter / 20))
    margin = 2 * step
    x, y = (np.arange(low - margin, high + margin + step, step) for low, high in ((west, east), (south, north)))
    shape = y.size, x.size
    return PlannedBed(x=x, y=y, depth=np.full(shape, depth, np.float32), known=np.ones(shape, bool))


def heading_along_contours(bed: PlannedBed, area: np.ndarray, width: float) -> float | None:
    """Return the heading along the contours of the masked nodes [rad], clockwise from north, 0 to π, or None.

    Relief shorter than a swath's ``width`` [m] is smoothed away.
    """
    from scipy.ndimage import gaussian_filter

    across, along = bed.step
    sigma = [min(0.25 * width / step, 0.1 * size) for step, size in zip((along, across), bed.depth.shape)]
    north, east = np.gradient(gaussian_filter(bed.depth, sigma, mode="nearest"), along, across)
    slopes = np.stack([east[area], north[area]]).astype(float)
    (small, large), axes = np.linalg.eigh(slopes @ slopes.T / max(slopes.shape[1], 1))
    if np.sqrt(large) < LEAST_SLOPE or 1 - small / large < LEAST_DIFFERENCE:
        return None
    return float(np.arctan2(axes[0, 0], axes[1, 0]) % np.pi)


def heading_along_area(corners: np.ndarray) -> float:
    """Return the heading that needs the fewest lines over points (N, 2) [m]: [rad], clockwise from north, 0 to π.

    The convex hull is narrowest across one of its edges, so the heading is that of an edge.
    """
    import shapely

    hull = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(corners)))
    if len(hull) < 2:
        return 0.0
    edges = np.diff(hull, axis=0)
    headings = np.arctan2(edges[:, 0], edges[:, 1]) % np.pi
    headings[np.pi - headings < ROUNDING] = 0.0
    across = hull @ np.stack([np.cos(headings), -np.sin(headings)])
    widths = np.ptp(across, axis=0)
    return float(headings[widths <= widths.min() * (1 + ROUNDING)].min())
