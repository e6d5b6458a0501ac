"""Highlights and shadows of objects as pieces of a picture: what boxes, polygons and masks are made of.

Every object makes at most a highlight and a shadow in a picture, and on each side of a sidescan: one that both sides
hear, under the track, is two, for a box around both would hold the water column. On demand both together are one more
annotation, which is what people draw a box around: the highlight with its shadow.
"""
import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.imaging.objects import object_bins

from .frames import LabelFrame, Tile

HIGHLIGHT, SHADOW, WHOLE = "highlight", "shadow", "whole"
ENDINGS = {HIGHLIGHT: "", SHADOW: " shadow", WHOLE: " with shadow"}      # of a category's name, after the class
AROUND = 2                         # bins
LIT_SHARE = 0.1                    # of a piece, or of the bins around it, that are not black: it can be seen


@dataclass(frozen=True, kw_only=True)
class Annotation:
    """Highlight or shadow of an object in a picture."""

    kind: str  # ``highlight``, ``shadow``, or ``whole`` for both together
    label: int  # number of the object in its record
    name: str
    class_name: str
    side: str  # ``port``, ``starboard`` or empty
    row: int  # of the upper left corner of ``mask`` in the picture
    column: int  # likewise
    mask: np.ndarray  # true somewhere in every border row and column
    truncated: bool  # it touches an edge of what the sonar sees, beyond which it may go on
    visible: float = 1.0  # share of its bins that this picture has
    exposed: float | None = None

    @property
    def bins(self) -> int:
        """Return the number of bins."""
        return int(self.mask.sum())

    @property
    def box(self) -> tuple[int, int, int, int]:
        """Left edge, upper edge, width and height, in bins."""
        return self.column, self.row, self.mask.shape[1], self.mask.shape[0]

    @property
    def category(self) -> str:
        """Name of what it is: the object's class, or that and "shadow" or "with shadow"."""
        return category(self.class_name, self.kind)

    @property
    def shown(self) -> float:
        """Share of what there is to see that this picture shows: what tiles cut, and of objects what hides them."""
        return self.visible * (1.0 if self.kind == SHADOW or self.exposed is None else self.exposed)


def category(class_name: str, kind: str) -> str:
    """Return the name of a class's highlights, shadows, or both together."""
    return class_name + ENDINGS[kind]


def annotations(dataset: xr.Dataset, frames: Sequence[LabelFrame], *, threshold: float = 0.5,
                above_noise_db: float = 0.0,
                smallest: int = 1, whole: bool = False) -> list[list[Annotation]]:
    """Find what the objects of a dataset make of its pictures.

    Parameters
    ----------
    dataset : xarray.Dataset
    frames : list of Frame
        As `frames` gives them for it.
    threshold, above_noise_db : float
        See `mitsonar.imaging.objects.object_bins`.
    smallest : int
        Bins that every piece of an annotation must have; see there.
    whole : bool
        Add the highlight and the shadow together as an annotation of their own.

    Returns
    -------
    list of list of Annotation
        For every picture; by label, the highlight first, then the shadow.

    Raises
    ------
    ValueError
        As `object_bins`.
    """
    found = [[] for _ in frames]
    bins = dataset["range"].values if "range" in dataset.coords else np.zeros(0)
    near_is_cut = bins.size > 1 and bins[0] > bins[1] - bins[0]
    edge_of = functools.cache(lambda number: frames[number].edge(near_is_cut))
    for seen in object_bins(dataset, threshold=threshold, above_noise_db=above_noise_db, smallest=smallest):
        exposed = dataset.attrs["objects"][str(seen.label)].get("exposed")
        both = [(WHOLE, seen.highlight | seen.shadow)] if whole else []
        for kind, shown in ((HIGHLIGHT, seen.highlight), (SHADOW, seen.shadow), *both):
            if not shown.any():
                continue
            for number, (frame, own) in enumerate(zip(frames, found, strict=True)):
                laid = frame.lay(shown)
                for part in frame.parts:
                    piece = _cut_out(laid[:, part.start:part.stop], smallest)
                    if piece is None:
                        continue
                    row, column, mask = piece
                    own.append(Annotation(
                        kind=kind, label=seen.label, name=seen.name, class_name=seen.class_name, side=part.name,
                        row=row, column=part.start + column, mask=mask, exposed=exposed,
                        truncated=bool((laid & edge_of(number))[:, part.start:part.stop].any())))
    return found


def clipped(annotation: Annotation, tile: Tile, smallest: int = 1) -> Annotation | None:
    """Return the part of an annotation that lies in a tile, counted from the tile's corner."""
    row, column = annotation.row - tile.row, annotation.column - tile.column
    height, width = annotation.mask.shape
    inside = annotation.mask[max(0, -row):max(0, min(height, tile.height - row)),
                             max(0, -column):max(0, min(width, tile.width - column))]
    piece = _cut_out(inside, smallest)
    if piece is None:
        return None
    visible = int(piece[2].sum()) / annotation.bins
    return replace(annotation, row=max(0, row) + piece[0], column=max(0, column) + piece[1], mask=piece[2],
                   visible=visible, truncated=annotation.truncated or visible < 1)


def is_invisible(annotation: Annotation, picture: np.ndarray) -> bool:
    """Tell whether a picture is black where an annotation lies and around it, so that there is nothing to see.

    This happens under the track, where levels lie below the picture's black. An object there is in the record, but a
    box on it would teach that black is an object.
    """
    # picture (H, W)
    height, width = annotation.mask.shape
    top, left = max(0, annotation.row - AROUND), max(0, annotation.column - AROUND)
    lit = picture[top:annotation.row + height + AROUND, left:annotation.column + width + AROUND] > 0
    mask = np.zeros(lit.shape, bool)
    mask[annotation.row - top:, annotation.column - left:][:height, :width] = annotation.mask
    around = ndimage.binary_dilation(mask, iterations=AROUND) & ~mask
    return all(np.count_nonzero(lit & part) < LIT_SHARE * np.count_nonzero(part) for part in (mask, around)
               if part.any())


def _cut_out(mask, smallest):
    """Row and column of the smallest rectangle that holds a mask, and the mask in there; None if it is too small."""
    if not mask.size or np.count_nonzero(mask) < max(1, smallest):
        return None
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    return (int(rows[0]), int(columns[0]),
            mask[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1].copy())
