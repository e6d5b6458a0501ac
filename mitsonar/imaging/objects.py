"""Which bins of a record show an object, and which its shadow: one rule for pictures, masks and boxes.

    highlight   share of the object > threshold, and the bin's mean echo is no weaker than the noise
    shadow      the object hides most of the seabed's echo (``object_shadow``), and the bin is no object's highlight

``share``, ``object_shadow`` and ``mean_level`` are variables of the record, made by the same rays as its levels.
"""
from dataclasses import dataclass

import numpy as np

__all__ = ["ObjectBins", "check_labelled", "object_bins"]

NEEDED = ("level", "share", "object_shadow")


@dataclass(frozen=True, kw_only=True)
class ObjectBins:
    """An object of a record and the bins that show it, over the dimensions of ``level``.

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


def check_labelled(dataset, name="the dataset"):
    """Refuse a dataset without the labels that are needed here.

    Raises
    ------
    ValueError
        If a variable or attribute is missing; ``name`` is what a person calls the dataset.
    """
    missing = [needed for needed in NEEDED if needed not in dataset.data_vars]
    missing += ["attribute objects"] * ("objects" not in dataset.attrs)
    if missing:
        raise ValueError(f"{name} has no {', no '.join(missing)}, from which objects are labelled; give an image that "
                         "this version of mitsonar rendered.")


def object_bins(dataset, *, threshold=0.5, above_noise_db=0.0):
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
    dims = dataset["level"].dims
    heard = np.ones(dataset["level"].shape, bool)
    if dataset.attrs.get("noise_db") is not None and "mean_level" in dataset:
        heard = dataset["mean_level"].values >= dataset.attrs["noise_db"] + above_noise_db
    share = dataset["share"].transpose("shape", *dims).values
    hidden_by = dataset["object_shadow"].transpose(*dims).values
    objects = sorted((int(number), entry["class"]) for number, entry in dataset.attrs["objects"].items())
    taken = np.zeros_like(heard)
    for label, _ in objects:
        taken |= share[label - 1] > threshold
    taken &= heard
    for label, class_name in objects:
        yield ObjectBins(label=label, name=str(dataset["shape"].values[label - 1]), class_name=class_name,
                         highlight=heard & (share[label - 1] > threshold), shadow=(hidden_by == label) & ~taken)
