"""Bins of a record that show an object or its shadow: one rule for pictures, masks and boxes.

    highlight   share of the object > threshold, and the bin's mean echo is no weaker than the noise, nor, in a shadow,
                much weaker than the bed is at that range; of beams, nor a side lobe's (`highlights`)
    shadow      the object hides most of the seabed's echo (``object_shadow``), or no ray arrives (``shadow``) between
                such bins of a ping; and the bin is no object's highlight

``share``, ``object_shadow``, ``shadow``, ``hidden`` and ``mean_level`` are variables of the record, made by the same
rays as its levels. Within a shadow an object's dark side is often all that echoes; and what lies in the lee of a
ripple has no echo that an object could hide. Neither is what a picture shows.

Which bins of a record an object lights up: its share in them, and the strength of what is heard.

A bin's mean echo must be no weaker than the noise and, in a shadow, no more than 10 dB weaker than the bed is at that
range. Beams hear by their side lobes too, all around where no bed drowns them: a bin is such an echo if another beam of
the same ping, or turn of a head, hears the object 15 dB louder at the same range. Where a record has no ``mean_level``,
an object's mean echo is that of the powers of its own bins: over 3 beams by 5 ranges of a fan, over 5 ranges of a
sidescan, over 5 by 5 points of a focused image's first bank. A focused image's level is a strength, which the noise of
an attribute says nothing of. Points that none of its pings sees have shares of side lobes alone, and no label: they are
no highlight.
"""
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import xarray as xr
from scipy import ndimage

from .focused import GROUND, bin_dims, is_focused
from .maps.raster import bearings

FAINT_DB = 10.0                    # below the bed's median: no highlight in a shadow
LOBE_DB = 15.0                     # below an object's strongest bin at the same range: a side lobe's
AROUND = {"beam": 3, "range": 5, **dict.fromkeys(GROUND, 5)}      # bins that a mean is taken over
NOTHING = 1e-20                    # power of what cannot be heard


@dataclass(frozen=True, kw_only=True)
class Patch:
    """A mask, and where it lies in a record."""

    where: tuple[slice, ...]
    mask: np.ndarray

    @classmethod
    def of(cls, mask: np.ndarray) -> "Patch":
        """Cut out what a mask over a whole record holds."""
        found = ndimage.find_objects(np.ascontiguousarray(mask).view(np.uint8))
        where = found[0] if found else (slice(0, 0),) * mask.ndim
        return cls(where=where, mask=mask[where])

    def within(self, shape: tuple[int, ...]) -> np.ndarray:
        """Return it as a mask over a whole record."""
        whole = np.zeros(shape, bool)
        whole[self.where] = self.mask
        return whole


@dataclass(frozen=True, kw_only=True)
class Highlights:
    """Thresholds of the highlights of a record's objects."""

    dims: tuple[str, ...]  # of the bins, and of all that follows
    share: np.ndarray  # of each shape
    threshold: float  # that it must exceed
    level: np.ndarray | None  # [dB]: mean echo of the bins
    speckled: bool
    floor: np.ndarray  # [dB]: what a highlight's level must reach
    looks: tuple[slice, ...]  # of the pings, those whose beams receive each other's targets by their side lobes

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
        """Return the bins that the object of a number lights up."""
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
    """Number the pieces of a mask that hang together along rows and columns of a picture."""
    rows = next((dim for dim in ("beam", GROUND[0]) if dim in dims), "ping")
    neighbours = ndimage.generate_binary_structure(mask.ndim, 1)
    for axis, dim in enumerate(dims):
        if dim not in (rows, dims[-1]):
            neighbours &= np.arange(3).reshape(-1, *[1] * (mask.ndim - axis - 1)) == 1
    return cast("tuple[np.ndarray, int]", ndimage.label(mask, neighbours))


def largest_beside(values: np.ndarray, pieces: np.ndarray, dims: Sequence[str]) -> np.ndarray:
    """Return for every piece the largest value of those in the same picture: in the same ping of a fan, else in all."""
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


NEEDED = ("level", "share", "object_shadow")
FROM_ABOVE = ("level", "label")    # of an image that is seen from all sides
SPECK_SHARE = 0.05                 # of the largest piece


@dataclass(frozen=True, kw_only=True)
class ObjectBins:
    """An object of a record and the bins that show it, over the dimensions of ``level`` without the banks."""

    label: int  # its number in the record
    name: str
    class_name: str
    highlight: np.ndarray
    shadow: np.ndarray


def check_labelled(dataset: xr.Dataset, name: str = "the dataset") -> None:
    """Refuse a dataset without the labels that are needed here."""
    needed = FROM_ABOVE if is_focused(dataset) and "share" not in dataset else NEEDED
    missing = [name for name in needed if name not in dataset.data_vars]
    missing += ["attribute objects"] * ("objects" not in dataset.attrs)
    if missing:
        raise ValueError(f"{name} has no {', no '.join(missing)}, from which objects are labelled; give an image that "
                         "this version of mitsonar rendered.")


def object_bins(dataset: xr.Dataset, *, threshold: float = 0.5, above_noise_db: float = 0.0,
                smallest: int = 1) -> Iterator[ObjectBins]:
    """Find the highlight and the shadow of every object."""
    # above_noise_db [dB]
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
    shape, taken = hidden_by.shape, np.zeros(hidden_by.shape, bool)
    lit = {label: highlights.patch(label) for label, _ in objects}
    for patch in lit.values():
        taken[patch.where] |= patch.mask
    hidden_by = np.where(taken, 0, hidden_by)
    dark = dict(enumerate(ndimage.find_objects(hidden_by.astype(np.int32)), 1))
    for label, class_name in objects:
        where = dark.get(label)
        shadow = np.zeros(shape, bool) if where is None else _without_specks(
            Patch(where=where, mask=hidden_by[where] == label), dims, smallest).within(shape)
        yield ObjectBins(label=label, name=str(dataset["shape"].values[label - 1]), class_name=class_name,
                         highlight=_without_specks(lit[label], dims, smallest).within(shape), shadow=shadow)


def _from_above(dataset):
    """A focused image with shares: a point is all its label's, and in no object's shadow."""
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
    """Return dark bins between two of a label in the same ping that label."""
    bins = np.arange(label.shape[-1])
    known = (label > 0) | ~dark                        # a bin that is lit ends a shadow
    before = np.maximum.accumulate(np.where(known, bins, 0), -1)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, bins, bins[-1]), -1), -1), -1)
    before, after = (np.take_along_axis(label, nearest, -1) for nearest in (before, after))
    return np.where(before == after, before, label)
