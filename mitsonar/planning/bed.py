"""The bed as a plan of survey lines sees it: depths on a grid, those without any taken from the nearest that has one.

Lines run best along the contours: the swath then has the same width all along, and beams meet the bed straight. Their
direction is the one across which depth changes least,

    T = <∇d ∇dᵀ>,            T a = λ a,   λ the smaller of the two

with d smoothed over about a swath. Where there is no such direction (1 - λ/λ' below a fifth), lines run along the area.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEAST_DIFFERENCE = 0.2             # of the eigenvalues, in parts of the larger
LEAST_SLOPE = 1e-3                 # rms; a bed more level than that has no contours to follow
MOST_NODES = 4_000_000
ROUNDING = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class PlannedBed:
    """Depths (Y, X) [m] below the surface on an even grid of x and y [m], and where they are surveyed ones."""

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    known: np.ndarray

    @property
    def step(self) -> tuple[float, float]:
        """Return the distance of columns and of rows [m]."""
        across, along = (float((axis[-1] - axis[0]) / (axis.size - 1)) for axis in (self.x, self.y))
        return across, along

    def places(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return rows and columns (2, ...) of places, in parts of a node."""
        across, along = self.step
        return np.stack([(y - self.y[0]) / along, (x - self.x[0]) / across])

    def depth_at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the depth [m] at places, linear between nodes, and beyond the grid that of its edge."""
        from scipy.ndimage import map_coordinates

        place = self.places(x, y)
        return map_coordinates(self.depth, place.reshape(2, -1), order=1, mode="nearest").reshape(place.shape[1:])

    def window(self, west: float, south: float, east: float, north: float) -> PlannedBed:
        """Return the part within bounds [m], with a node beyond each where there is one; at least two of either."""
        (left, right), (low, high) = (_span(axis, *ends) for axis, ends in ((self.x, (west, east)),
                                                                            (self.y, (south, north))))
        return PlannedBed(x=self.x[left:right], y=self.y[low:high], depth=self.depth[low:high, left:right],
                   known=self.known[low:high, left:right])


def _span(axis, low, high):
    first = int(np.clip(np.searchsorted(axis, low, side="right") - 1, 0, axis.size - 2))
    last = int(np.clip(np.searchsorted(axis, high) + 1, first + 2, axis.size))
    return first, last


def bed_of(x: np.ndarray, y: np.ndarray, heights: np.ndarray) -> PlannedBed:
    """Return the bed of a survey's heights (Y, X) [m], z up and NaN without a depth; `ValueError` if it is all land."""
    from scipy.ndimage import distance_transform_edt

    factor = int(np.ceil(np.sqrt(heights.size / MOST_NODES)))
    if factor > 1:
        x, y, heights = _coarser(x, y, heights, factor)
    known = np.isfinite(heights)
    if not np.any(heights < 0):
        raise ValueError("no depth of the bathymetry is below the surface; say vertical depth or elevation, whichever "
                         "its numbers are.")
    depth = -heights.astype(np.float32)
    if not known.all():
        nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
        depth = depth[tuple(nearest)]
    return PlannedBed(x=x, y=y, depth=depth, known=known)


def _coarser(x, y, heights, factor):
    """Return means over squares of so many nodes a side."""
    rows, columns = heights.shape[0] // factor, heights.shape[1] // factor
    part = heights[:rows * factor, :columns * factor].reshape(rows, factor, columns, factor)
    known = np.isfinite(part)
    number = known.sum((1, 3))
    with np.errstate(invalid="ignore"):
        mean = np.where(number > 0, np.where(known, part, 0).sum((1, 3)) / number, np.nan)
    middle = [axis[:size * factor].reshape(size, factor).mean(1) for axis, size in ((x, columns), (y, rows))]
    return *middle, mean


def flat_bed(depth: float, west: float, south: float, east: float, north: float) -> PlannedBed:
    """Return a level bed of a depth [m] about bounds [m], with at most half a million nodes."""
    longer, narrow = max(east - west, north - south), min(east - west, north - south)
    step = max(np.sqrt(longer * narrow / 5e5), longer / 1e5, min(0.1 * depth, longer / 100, narrow / 20))
    margin = 2 * step
    x, y = (np.arange(low - margin, high + margin + step, step) for low, high in ((west, east), (south, north)))
    shape = y.size, x.size
    return PlannedBed(x=x, y=y, depth=np.full(shape, depth, np.float32), known=np.ones(shape, bool))


def heading_along_contours(bed: PlannedBed, area: np.ndarray, width: float) -> float | None:
    """Return the heading [rad] along the contours of the nodes that count, None where there is none.

    It is clockwise from north, 0 to π. Relief shorter than a swath's ``width`` [m] is smoothed away.
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
    """Return the heading [rad] across which the hull of places (N, 2) [m] is narrowest, for the fewest lines.

    It is clockwise from north, 0 to π, along an edge of the hull, where the least width of a polygon is found.
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
    narrow = headings[widths <= widths.min() * (1 + ROUNDING)]
    return float(narrow.min())
