"""Which bins of a record an object lights up: its share in them, and the strength of what is heard.

A bin's mean echo must be no weaker than the noise and, in a shadow, no more than 10 dB weaker than the bed is at that
range. Beams hear by their side lobes too, all around where no bed drowns them: a bin is such an echo if another beam of
the same ping, or turn of a head, hears the object 15 dB louder at the same range. Where a record has no ``mean_level``,
an object's mean echo is that of the powers of its own bins: over 3 beams by 5 ranges of a fan, over 5 ranges of a
sidescan, over 5 by 5 points of a focused image's first bank. A focused image's level is a strength, which the noise of
an attribute says nothing of. Points that none of its pings sees have shares of side lobes alone, and no label: they are
no highlight.
"""
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import xarray as xr
from scipy import ndimage

from .focused import GROUND, bin_dims, is_focused
from .maps.raster import bearings

__all__ = ["Highlights", "Patch", "largest_beside", "pieces_of"]

FAINT_DB = 10.0                    # below the bed's median: no highlight in a shadow
LOBE_DB = 15.0                     # below an object's strongest bin at the same range: a side lobe's
AROUND = {"beam": 3, "range": 5, **dict.fromkeys(GROUND, 5)}      # bins that a mean is taken over
NOTHING = 1e-20                    # power of what cannot be heard


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A mask, and where it lies in a record.

    Attributes
    ----------
    where : tuple of slice
    mask : bool array
    """

    where: tuple[slice, ...]
    mask: np.ndarray

    @classmethod
    def of(cls, mask: np.ndarray) -> "Patch":
        """Cut out what a mask over a whole record holds."""
        found = ndimage.find_objects(np.ascontiguousarray(mask).view(np.uint8))
        where = found[0] if found else (slice(0, 0),) * mask.ndim
        return cls(where=where, mask=mask[where])

    def within(self, shape: tuple[int, ...]) -> np.ndarray:
        """Give it as a mask over a whole record."""
        whole = np.zeros(shape, bool)
        whole[self.where] = self.mask
        return whole


@dataclass(frozen=True, kw_only=True)
class Highlights:
    """What tells the highlights of a record's objects.

    Attributes
    ----------
    dims : tuple of str
        Of the bins, and of all that follows.
    share : float array (shape, ...)
        Of each shape.
    threshold : float
        That it must exceed.
    level : float array or None [dB]
        Mean echo of the bins; or with ``speckled`` one that varies. None: unknown.
    speckled : bool
    floor : float array [dB]
        What a highlight's level must reach.
    looks : tuple of slice
        Of the pings, those whose beams hear each other's targets by their side lobes: each of a fan, turns of a head;
        empty for others.
    """

    dims: tuple[str, ...]
    share: np.ndarray
    threshold: float
    level: np.ndarray | None
    speckled: bool
    floor: np.ndarray
    looks: tuple[slice, ...]

    @classmethod
    def of(cls, dataset: xr.Dataset, labels: Sequence[int], threshold: float, above_noise_db: float) -> "Highlights":
        """Take what is needed from a record; arguments as of `mitsonar.imaging.objects.object_bins`."""
        dims, focused = bin_dims(dataset), is_focused(dataset)
        share = dataset["share"].transpose("shape", *dims).values
        name = "mean_level" if "mean_level" in dataset else "level" if focused or {"beam", "side"} & {*dims} else None
        shown = None if name is None else dataset[name].isel(bank=0, missing_dims="ignore")
        level = None if shown is None else shown.transpose(*dims).values
        hidden = dataset["hidden"].transpose(*dims).values if "hidden" in dataset else None
        noise_db = None if focused else dataset.attrs.get("noise_db")
        floor = _floor(share, labels, level, hidden, -np.inf if noise_db is None else noise_db + above_noise_db)
        if focused and "label" in dataset:
            floor = np.where(dataset["label"].transpose(*dims).values > 0, floor, np.inf)
        return cls(dims=dims, share=share, threshold=threshold, level=level, speckled=name == "level", floor=floor,
                   looks=tuple(bearings(dataset)[1]) if "beam" in dims or "bearing" in dataset.coords else ())

    def patch(self, label: int) -> Patch:
        """Give the bins that the object of a number lights up."""
        bright = Patch.of(self.share[label - 1] > self.threshold)
        if self.level is None or not bright.mask.size:
            return bright
        where, lit = bright.where, bright.mask
        level = self.level[where]
        if self.speckled:
            level = _mean_among(level, lit, [AROUND.get(dim, 1) for dim in self.dims])
        lit = lit & (level >= self.floor[where])
        for look in self.looks:
            own = slice(*(np.clip([look.start, look.stop], where[0].start, where[0].stop) - where[0].start))
            if own.stop > own.start:
                beams = tuple(range(lit.ndim - 1))
                loudest = np.where(lit[own], level[own], -np.inf).max(beams)
                lit[own] &= level[own] >= loudest - LOBE_DB
        return Patch(where=where, mask=lit)


def pieces_of(mask: np.ndarray, dims: Sequence[str]) -> tuple[np.ndarray, int]:
    """Number the pieces of a mask that hang together along rows and columns of a picture.

    Parameters
    ----------
    mask : bool array
    dims : sequence of str
        Of the mask; the last is that of ranges.

    Returns
    -------
    numbers : int array
        From 1; 0 elsewhere.
    count : int
    """
    rows = next((dim for dim in ("beam", GROUND[0]) if dim in dims), "ping")
    neighbours = ndimage.generate_binary_structure(mask.ndim, 1)
    for axis, dim in enumerate(dims):
        if dim not in (rows, dims[-1]):
            neighbours &= np.arange(3).reshape(-1, *[1] * (mask.ndim - axis - 1)) == 1
    return cast("tuple[np.ndarray, int]", ndimage.label(mask, neighbours))


def largest_beside(values: np.ndarray, pieces: np.ndarray, dims: Sequence[str]) -> np.ndarray:
    """Give for every piece the largest value of those in the same picture: in the same ping of a fan, else in all.

    Parameters
    ----------
    values : (count,) array
        Of the pieces.
    pieces : int array
        As `pieces_of` numbers them.
    dims : sequence of str

    Returns
    -------
    (count,) array
    """
    ping = np.array([found[0].start if "beam" in dims else 0 for found in ndimage.find_objects(pieces)])
    largest = np.full(ping.max(initial=0) + 1, values.min())
    np.maximum.at(largest, ping, values)
    return largest[ping]


def _floor(share, labels, level, hidden, faintest_db):
    """The weakest level of a highlight in every bin."""
    floor = np.full(share.shape[1:], faintest_db, np.float32)
    if hidden is None or level is None:
        return floor
    bed = share.sum(0) - sum(share[label - 1] for label in labels) > 0.5
    of_bed = np.full(share.shape[-1], -np.inf, np.float32)
    for bin in np.flatnonzero(bed.any(tuple(range(bed.ndim - 1)))):
        of_bed[bin] = np.median(level[..., bin][bed[..., bin]]) - FAINT_DB
    return np.where(hidden > 0.5, np.maximum(floor, of_bed), floor)


def _mean_among(level, mask, sizes):
    """Levels of the mean powers of a mask's bins around each [dB]."""
    power = np.where(mask, 10 ** (0.1 * level.astype(float)), 0)
    mean, share = (ndimage.uniform_filter(values, sizes, mode="constant") for values in (power, mask.astype(float)))
    return 10 * np.log10(np.maximum(np.where(mask, mean / np.maximum(share, 1e-6), 0), NOTHING))
