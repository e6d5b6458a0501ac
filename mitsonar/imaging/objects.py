"""Bins of a record that show an object or its shadow: one rule for pictures, masks and boxes.

    highlight   share of the object > threshold, and a mean echo above the noise and, within a shadow, not much weaker
                than the bed at that range; in beams, also not the echo of a side lobe (`Highlights`)
    shadow      the object hides most of the seabed's echo (``object_shadow``), or no ray arrives (``shadow``) between
                such bins of a ping; and the bin is no highlight of an object

``share``, ``object_shadow``, ``shadow``, ``hidden`` and ``mean_level`` are variables of the record, from the same rays
as its levels. These rules exclude the weak echo of an object's dark side within its shadow, and the lee of a
ripple, which has no echo to hide.

Within a shadow, a highlight may be at most 10 dB weaker than the bed at its range. Beams also receive an object through
side lobes: a bin is such an echo if another beam of the same ping, or turn of a head, receives the object 15 dB louder
at the same range. Without ``mean_level``, the mean echo is the mean power of the object's own bins around: over 3 beams
by 5 ranges of a fan, 5 ranges of a sidescan, 5 by 5 points of the first bank of a focused image. The level of a focused
image is a strength, to which the noise attribute does not apply. Its points that no ping sees have only shares from
side lobes and no label; they are no highlight.
"""
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import xarray as xr
from scipy import ndimage

from .focused import GROUND, bin_dims, is_focused
from .maps.raster import bearings

FAINT_DB = 10.0                    # [dB] below the bed's median: no highlight in a shadow
LOBE_DB = 15.0                     # [dB] below an object's strongest bin at the same range: a side lobe
AROUND = {"beam": 3, "range": 5, **dict.fromkeys(GROUND, 5)}      # bins to average
NOTHING = 1e-20                    # power without an echo
NEEDED = ("level", "share", "object_shadow")
FROM_ABOVE = ("level", "label")    # of an image seen from all sides
SPECK_SHARE = 0.05                 # of the largest piece


@dataclass(frozen=True, kw_only=True)
class Patch:
    """Mask over a part of a record."""

    where: tuple[slice, ...]
    mask: np.ndarray

    @classmethod
    def of(cls, mask: np.ndarray) -> "Patch":
        """Return the bounding part of a mask over a whole record."""
        boxes = ndimage.find_objects(np.ascontiguousarray(mask).view(np.uint8))
        where = boxes[0] if boxes else (slice(0, 0),) * mask.ndim
        return cls(where=where, mask=mask[where])

    def within(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return the patch as a mask over a whole record."""
        mask = np.zeros(shape, bool)
        mask[self.where] = self.mask
        return mask


@dataclass(frozen=True, kw_only=True)
class Highlights:
    """Inputs of the rule for highlights, from one record."""

    dims: tuple[str, ...]  # of the bins and of all arrays below
    share: np.ndarray  # of each shape
    threshold: float  # least share of a highlight
    level: np.ndarray | None  # [dB]: echo of the bins
    speckled: bool  # True if ``level`` is not yet a mean
    floor: np.ndarray  # [dB]: least level of a highlight
    looks: tuple[slice, ...]  # pings of each look, within which side lobes show the same target

    @classmethod
    def of(cls, dataset: xr.Dataset, labels: Sequence[int], threshold: float, above_noise_db: float) -> "Highlights":
        """Return the inputs from a record; for arguments see `object_bins`."""
        dims, focused = bin_dims(dataset), is_focused(dataset)
        share = dataset["share"].transpose("shape", *dims).values
        name = "mean_level" if "mean_level" in dataset else "level" if focused or {"beam", "side"} & {*dims} else None
        level = None if name is None else dataset[name].isel(bank=0, missing_dims="ignore").transpose(*dims).values
        hidden = dataset["hidden"].transpose(*dims).values if "hidden" in dataset else None
        noise_db = None if focused else dataset.attrs.get("noise_db")
        floor = _floor(share, labels, level, hidden, -np.inf if noise_db is None else noise_db + above_noise_db)
        if focused and "label" in dataset:
            floor = np.where(dataset["label"].transpose(*dims).values > 0, floor, np.inf)
        return cls(dims=dims, share=share, threshold=threshold, level=level, speckled=name == "level", floor=floor,
                   looks=tuple(bearings(dataset)[1]) if "beam" in dims or "bearing" in dataset.coords else ())

    def patch(self, label: int) -> Patch:
        """Return the highlight of the object with a label."""
        bright = Patch.of(self.share[label - 1] > self.threshold)
        if self.level is None or not bright.mask.size:
            return bright
        where, lit = bright.where, bright.mask
        level = self.level[where]
        if self.speckled:
            level = _mean_among(level, lit, [AROUND.get(dim, 1) for dim in self.dims])
        lit = lit & (level >= self.floor[where])
        for look in self.looks:
            rows = slice(*(np.clip([look.start, look.stop], where[0].start, where[0].stop) - where[0].start))
            if rows.stop > rows.start:
                loudest = np.where(lit[rows], level[rows], -np.inf).max(tuple(range(lit.ndim - 1)))
                lit[rows] &= level[rows] >= loudest - LOBE_DB
        return Patch(where=where, mask=lit)


def pieces_of(mask: np.ndarray, dims: Sequence[str]) -> tuple[np.ndarray, int]:
    """Return the connected pieces of a mask within a picture as numbers, and their count."""
    rows = next((dim for dim in ("beam", GROUND[0]) if dim in dims), "ping")
    neighbours = ndimage.generate_binary_structure(mask.ndim, 1)
    for axis, dim in enumerate(dims):
        if dim not in (rows, dims[-1]):
            neighbours &= np.arange(3).reshape(-1, *[1] * (mask.ndim - axis - 1)) == 1
    return cast("tuple[np.ndarray, int]", ndimage.label(mask, neighbours))


def largest_beside(values: np.ndarray, pieces: np.ndarray, dims: Sequence[str]) -> np.ndarray:
    """Return for every piece the largest value in its picture: a ping of a fan, else the whole record."""
    ping = np.array([box[0].start if "beam" in dims else 0 for box in ndimage.find_objects(pieces)])
    largest = np.full(ping.max(initial=0) + 1, values.min())
    np.maximum.at(largest, ping, values)
    return largest[ping]


def _floor(share, labels, level, hidden, faintest_db):
    """Return the least level of a highlight for every bin."""
    floor = np.full(share.shape[1:], faintest_db, np.float32)
    if hidden is None or level is None:
        return floor
    bed = share.sum(0) - sum(share[label - 1] for label in labels) > 0.5
    # medians over the bed of every bin; all other values sort behind
    rising = np.sort(np.where(bed, level, np.inf).reshape(-1, bed.shape[-1]), axis=0)
    count = bed.reshape(rising.shape).sum(0)
    middle = [np.take_along_axis(rising, index[None], 0)[0] for index in (np.maximum(count - 1, 0) // 2, count // 2)]
    of_bed = np.where(count > 0, (middle[0] + middle[1]) / 2 - FAINT_DB, -np.inf).astype(np.float32)
    return np.where(hidden > 0.5, np.maximum(floor, of_bed), floor)


def _mean_among(level, mask, sizes):
    """Return the level of the mean power of the masked bins around every bin [dB]."""
    power = np.where(mask, 10 ** (0.1 * level.astype(float)), 0)
    mean, share = (ndimage.uniform_filter(values, sizes, mode="constant") for values in (power, mask.astype(float)))
    return 10 * np.log10(np.maximum(np.where(mask, mean / np.maximum(share, 1e-6), 0), NOTHING))


@dataclass(frozen=True, kw_only=True)
class ObjectBins:
    """Object of a record, and masks of the bins that show it, over the dimensions of ``level`` without banks."""

    label: int  # its number in the record
    name: str
    class_name: str
    highlight: np.ndarray
    shadow: np.ndarray


def check_labelled(dataset: xr.Dataset, name: str = "the dataset") -> None:
    """Raise `ValueError` if a dataset lacks the variables that label objects."""
    needed = FROM_ABOVE if is_focused(dataset) and "share" not in dataset else NEEDED
    missing = [name for name in needed if name not in dataset.data_vars]
    missing += ["attribute objects"] * ("objects" not in dataset.attrs)
    if missing:
        raise ValueError(f"{name} has no {', no '.join(missing)}, which labels of objects need; give an image that "
                         "this version of mitsonar rendered.")


def object_bins(dataset: xr.Dataset, *, threshold: float = 0.5, above_noise_db: float = 0.0,
                smallest: int = 1) -> Iterator[ObjectBins]:
    """Yield the highlight and the shadow of every object, without pieces of less than ``smallest`` bins."""
    check_labelled(dataset)
    if not 0 <= threshold < 1:
        raise ValueError(f"the threshold is {threshold:g}; give a share of at least 0 and below 1, such as 0.5.")
    if "share" not in dataset:
        dataset = _from_above(dataset)
    dims = bin_dims(dataset)
    objects = sorted((int(number), entry["class"]) for number, entry in dataset.attrs["objects"].items())
    highlights = Highlights.of(dataset, [label for label, _ in objects], threshold, above_noise_db)
    hidden_by = dataset["object_shadow"].transpose(*dims).values
    if "shadow" in dataset:
        hidden_by = _without_gaps(hidden_by, dataset["shadow"].transpose(*dims).values > 0)
    shape, bright = hidden_by.shape, np.zeros(hidden_by.shape, bool)
    lit = {label: highlights.patch(label) for label, _ in objects}
    for patch in lit.values():
        bright[patch.where] |= patch.mask
    hidden_by = np.where(bright, 0, hidden_by)
    dark = dict(enumerate(ndimage.find_objects(hidden_by.astype(np.int32)), 1))
    for label, class_name in objects:
        where = dark.get(label)
        shadow = np.zeros(shape, bool) if where is None else _without_specks(
            Patch(where=where, mask=hidden_by[where] == label), dims, smallest).within(shape)
        yield ObjectBins(label=label, name=str(dataset["shape"].values[label - 1]), class_name=class_name,
                         highlight=_without_specks(lit[label], dims, smallest).within(shape), shadow=shadow)


def _from_above(dataset):
    """Return a focused image with shares: 1 for the label of a point; and without shadows."""
    dims, label = bin_dims(dataset), dataset["label"]
    names = dataset.attrs.get("labels") or {}
    count = max(map(int, names), default=0)
    share = (label.transpose(*dims).values == np.arange(1, count + 1).reshape(-1, 1, 1)).astype(np.float32)
    return dataset.assign(share=(("shape", *dims), share), object_shadow=xr.zeros_like(label)).assign_coords(
        shape=[names.get(str(number), "") for number in range(1, count + 1)])


def _without_specks(patch, dims, smallest):
    if smallest < 2 or not patch.mask.any():
        return patch
    pieces, count = pieces_of(patch.mask, dims)
    sizes = np.bincount(pieces.ravel(), minlength=count + 1)[1:]
    least = np.maximum(smallest, SPECK_SHARE * largest_beside(sizes, pieces, dims))
    return Patch(where=patch.where, mask=np.r_[False, sizes >= least][pieces])


def _without_gaps(label, dark):
    """Return labels with dark bins filled that lie between two bins of one label in a ping."""
    bins = np.arange(label.shape[-1])
    known = (label > 0) | ~dark                        # a lit bin ends a shadow
    before = np.maximum.accumulate(np.where(known, bins, 0), -1)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, bins, bins[-1]), -1), -1), -1)
    before, after = (np.take_along_axis(label, nearest, -1) for nearest in (before, after))
    return np.where(before == after, before, label)
