"""Grid of a picture's pixels: pings and ranges are laid out in metres and averaged over the area of each pixel.

The horizontal axis is the slant range: port mirrored on the left and starboard on the right, or from left to right for
a sonar with one row per ping. The vertical axis is the distance along the track, with the newest ping on top. The
echogram of a sonar that looks down (attribute ``looks``) is turned: ranges go down, the newest ping is on the right. A
pixel that covers several bins shows their mean, weighted with the share of the pixel that each covers; a pixel smaller
than a bin shows the bin.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

WIDEST, LOWEST = 1400, 420       # pixels
LARGEST = 2**22                  # bins of a variable that are processed at a time
ONLY_SIDE = ""                   # name of the side of a sonar that has no sides
DEEPEST = 700                    # pixels of the range of an echogram
FLATTEST, TALLEST = 0.4, 1.6     # limits of height / width, beyond which the along-track scale is changed


@dataclass(frozen=True, kw_only=True)
class PlotGrid:
    """Grid of the pixels of a dataset."""

    across: np.ndarray       # edges of the bins [m]: (2N + 2,) port, the gap under the sonar, starboard; or (N + 1,)
    along: np.ndarray        # (P + 1,) edges of the pings [m], or ping numbers if the sonar stands still
    moving: bool
    down: bool = False       # True for an echogram, which is drawn turned: ranges are rows, pings are columns
    width: int
    height: int

    @property
    def stretch(self) -> float:
        """Ratio of the along-track scale to the across-track scale; 1 if a pixel is square on the ground."""
        return (self.height / (self.along[-1] - self.along[0])) / (self.width / (self.across[-1] - self.across[0]))

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the edges of the pixels' rows and columns, in the units of ``along`` and ``across``."""
        return (np.linspace(self.along[0], self.along[-1], self.height + 1),
                np.linspace(self.across[0], self.across[-1], self.width + 1))

    def mean(self, dataset: xr.Dataset, values: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
        """Average the values of the bins over the pixels (height, width), leaving out NaN."""
        rows, columns = self.edges()
        rows, columns = _shares(self.along, rows).tocsc(), _shares(self.across, columns)
        total, weight = np.zeros((2, self.height, self.width))
        for first, part in stretches(dataset):
            laid = _side_by_side(np.asarray(values(part), float), np.nan)
            known = np.isfinite(laid)
            shares = rows[:, first:first + part.sizes["ping"]]
            total += shares @ (columns @ np.where(known, laid, 0).T).T
            weight += shares @ (columns @ known.T.astype(float)).T
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(weight > 1e-9 * weight.max(initial=0), total / weight, np.nan)

    def largest(self, dataset: xr.Dataset, values: Callable[[xr.Dataset], np.ndarray]) -> np.ndarray:
        """Return the largest value of the bins in each pixel (height, width); the arguments are those of `mean`."""
        first_row, first_column = (
            np.clip(np.searchsorted(source, target[:-1], side="right") - 1, 0, source.size - 2)
            for source, target in zip((self.along, self.across), self.edges(), strict=True))
        rows = [np.maximum.reduceat(_side_by_side(values(part), 0), first_column, axis=1)
                for _, part in stretches(dataset)]
        return np.maximum.reduceat(np.concatenate(rows), first_row, axis=0)


def stretches(dataset: xr.Dataset) -> Iterator[tuple[int, xr.Dataset]]:
    """Yield pieces of a dataset along the track of bounded memory, each with its first ping and its sides in order."""
    pings = max(1, LARGEST // (2 * dataset.sizes["range"]))
    for first in range(0, dataset.sizes["ping"], pings):
        yield first, dataset.isel(ping=slice(first, first + pings)).transpose("ping", "side", "range", ...)


def with_sides(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset over (ping, range) with a dimension ``side`` of length 1 added, else unchanged."""
    no_sides = set(dataset["level"].dims) == {"ping", "range"} and "side" not in dataset.coords
    return dataset.expand_dims(side=[ONLY_SIDE]) if no_sides else dataset


def make_grid(dataset: xr.Dataset) -> PlotGrid:
    """Return the pixels of a dataset whose pings have both sides of a sidescan, or one row (`with_sides`)."""
    sides = dataset["side"].values.tolist() if "side" in dataset.coords else []
    if sides not in (["port", "starboard"], [ONLY_SIDE]) or not {"ping", "range"} <= set(dataset.dims):
        raise ValueError(f"plots show a sidescan with the dimensions ping, side (port, starboard) and range, or "
                         f"ping and range; this dataset has {dict(dataset.sizes)}.")
    if not (dataset.sizes["ping"] and dataset.sizes["range"]):
        raise ValueError(f"there is nothing to plot: the dataset has {dict(dataset.sizes)}.")
    slant_range = edges_around(dataset["range"].values, float(dataset.attrs.get("bin_width", 1)))
    slant_range[0] = max(slant_range[0], 0)
    across = slant_range if sides == [ONLY_SIDE] else np.concatenate([-slant_range[::-1], slant_range])
    steps = np.zeros(0)
    if {"x", "y"} <= set(dataset.coords):
        steps = np.hypot(np.diff(dataset["x"].values), np.diff(dataset["y"].values))
    moving = bool(steps.sum() > 1e-6)
    along = edges_around(np.r_[0, np.cumsum(steps)] if moving else np.arange(dataset.sizes["ping"]), 1)
    bins, down = len(sides) * dataset.sizes["range"], dataset.attrs.get("looks") == "down"
    most = DEEPEST if down else WIDEST
    width = bins * (most // bins) if bins < most else most           # a whole number of pixels per bin if bins are few
    square = width * (along[-1] - along[0]) / (across[-1] - across[0])
    height = square if moving else dataset.sizes["ping"]
    highest = WIDEST if down else TALLEST * width
    return PlotGrid(across=across, along=along, moving=moving, down=down, width=width,
                    height=int(np.clip(round(height), max(FLATTEST * width, LOWEST), highest)))


def _side_by_side(values, gap):
    """Return an array (p, 2, N) as (p, 2N + 1): port mirrored, a column under the sonar, starboard."""
    if values.shape[1] == 1:           # one row per ping
        return values[:, 0]
    middle = np.full((values.shape[0], 1), gap, values.dtype)
    return np.concatenate([values[:, 0, ::-1], middle, values[:, 1]], axis=1)


def edges_around(centres: np.ndarray, alone: float) -> np.ndarray:
    """Return edges half-way between centres and as far beyond the ends; a single cell is ``alone`` wide."""
    centres = np.asarray(centres, float)
    if centres.size == 1:
        return centres[0] + np.array([-0.5, 0.5]) * alone
    middle = (centres[1:] + centres[:-1]) / 2
    return np.r_[2 * centres[0] - middle[0], middle, 2 * centres[-1] - middle[-1]]


def _shares(source, target):
    """Return the lengths (T, S) of the overlaps of intervals between ``target`` edges and between ``source`` edges."""
    cuts = np.unique(np.concatenate([source, target]))
    middle = (cuts[1:] + cuts[:-1]) / 2
    rows, columns = (np.searchsorted(edges, middle) - 1 for edges in (target, source))
    inside = (rows >= 0) & (rows < target.size - 1) & (columns >= 0) & (columns < source.size - 1)
    from scipy.sparse import csr_array

    return csr_array((np.diff(cuts)[inside], (rows[inside], columns[inside])),
                     shape=(target.size - 1, source.size - 1))
