"""Which bins of a record show an object, and which its shadow: one rule for pictures, masks and boxes.

    highlight   share of the object > threshold, and the bin's mean echo is no weaker than the noise, nor, in a shadow,
                much weaker than the bed is at that range; of beams, nor a side lobe's (`highlights`)
    shadow      the object hides most of the seabed's echo (``object_shadow``), or no ray arrives (``shadow``) between
                such bins of a ping; and the bin is no object's highlight

``share``, ``object_shadow``, ``shadow``, ``hidden`` and ``mean_level`` are variables of the record, made by the same
rays as its levels. Within a shadow an object's dark side is often all that echoes; and what lies in the lee of a
ripple has no echo that an object could hide. Neither is what a picture shows.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import ndimage

from .focused import bin_dims, is_focused
from .highlights import Highlights, Patch, largest_beside, pieces_of

__all__ = ["ObjectBins", "check_labelled", "object_bins"]

NEEDED = ("level", "share", "object_shadow")
FROM_ABOVE = ("level", "label")    # of an image that is seen from all sides
SPECK_SHARE = 0.05                 # of the largest piece


@dataclass(frozen=True, kw_only=True)
class ObjectBins:
    """An object of a record and the bins that show it, over the dimensions of ``level`` without the banks.

    Attributes
    ----------
    label : int
        Its number in the record.
    name, class_name : str
    highlight, shadow : bool array
    """

    label: int
    name: str
    class_name: str
    highlight: np.ndarray
    shadow: np.ndarray


def check_labelled(dataset: xr.Dataset, name: str = "the dataset") -> None:
    """Refuse a dataset without the labels that are needed here.

    Raises
    ------
    ValueError
        If a variable or attribute is missing; ``name`` is what a person calls the dataset.
    """
    needed = FROM_ABOVE if is_focused(dataset) and "share" not in dataset else NEEDED
    missing = [name for name in needed if name not in dataset.data_vars]
    missing += ["attribute objects"] * ("objects" not in dataset.attrs)
    if missing:
        raise ValueError(f"{name} has no {', no '.join(missing)}, from which objects are labelled; give an image that "
                         "this version of mitsonar rendered.")


def object_bins(dataset: xr.Dataset, *, threshold: float = 0.5, above_noise_db: float = 0.0,
                smallest: int = 1) -> Iterator[ObjectBins]:
    """Find the highlight and the shadow of every object.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``mitsonar.render`` gives it.
    threshold : float [-]
        Share of a bin's energy that an object must exceed, at least 0 and below 1. Below 0.5 several objects may hold
        a bin.
    above_noise_db : float [dB]
        How far the mean echo of a highlight's bins must be above the noise, where the record has noise.
    smallest : int
        Bins that every piece of a highlight or shadow must have, and a twentieth of those of its largest in the same
        picture; smaller ones are dropped, for they would stretch boxes. Pieces hang together along rows and columns of
        the picture. 1: all are kept.

    Yields
    ------
    ObjectBins
        In the order of the label numbers; an object that is not seen has no bins.

    Raises
    ------
    ValueError
        If the dataset has no labels, or an argument is out of range.
    """
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
    """Give dark bins between two of a label in the same ping that label."""
    bins = np.arange(label.shape[-1])
    known = (label > 0) | ~dark                        # a bin that is lit ends a shadow
    before = np.maximum.accumulate(np.where(known, bins, 0), -1)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, bins, bins[-1]), -1), -1), -1)
    before, after = (np.take_along_axis(label, nearest, -1) for nearest in (before, after))
    return np.where(before == after, before, label)
