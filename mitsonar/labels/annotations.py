"""Highlights and shadows of objects as pieces of a picture, the source of boxes, polygons and masks.

Every object has at most one highlight and one shadow per picture and side of a sidescan. An object under the track that
shows on both sides is therefore two pieces, since a common box would contain the water column. On demand, the highlight
with its shadow is a further annotation, as people usually draw boxes.
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
ENDINGS = {HIGHLIGHT: "", SHADOW: " shadow", WHOLE: " with shadow"}      # of the names of categories
AROUND = 2                         # bins
BESIDE = 6                         # bins around an annotation that it is compared with
LIT_SHARE = 0.1                    # least share of a visible piece, or of the bins around it, that is not black


@dataclass(frozen=True, kw_only=True)
class Annotation:
    """Highlight or shadow of an object in a picture."""

    kind: str  # ``highlight``, ``shadow``, or ``whole`` for both together
    label: int  # number of the object in its record
    name: str
    class_name: str
    side: str  # ``port``, ``starboard`` or empty
    row: int  # of the upper left corner of ``mask`` in the picture
    column: int  # of the same corner
    mask: np.ndarray  # cropped: every border row and column has a True
    truncated: bool  # True if it touches an edge of the sonar's view and may extend beyond
    visible: float = 1.0  # share of its bins within this picture
    exposed: float | None = None  # share of the object that is neither buried nor hidden

    @property
    def bins(self) -> int:
        """Return the number of bins."""
        return int(self.mask.sum())

    @property
    def box(self) -> tuple[int, int, int, int]:
        """Return left edge, upper edge, width and height, in bins."""
        return self.column, self.row, self.mask.shape[1], self.mask.shape[0]

    @property
    def category(self) -> str:
        """Return the name of the category: the object's class, with "shadow" or "with shadow" appended if so."""
        return category(self.class_name, self.kind)

    @property
    def shown(self) -> float:
        """Return the share that this picture shows, after cutting by tiles and, for objects, after hiding."""
        return self.visible * (1.0 if self.kind == SHADOW or self.exposed is None else self.exposed)


def category(class_name: str, kind: str) -> str:
    """Return the name of the category of a class and kind."""
    return class_name + ENDINGS[kind]


def annotations(dataset: xr.Dataset, frames: Sequence[LabelFrame], *, threshold: float = 0.5,
                above_noise_db: float = 0.0, smallest: int = 1, whole: bool = False) -> list[list[Annotation]]:
    """Return the annotations of every frame of a dataset, by label, highlights before shadows.

    ``whole`` adds each highlight with its shadow. For the other arguments and errors see `object_bins`.
    """
    pieces = [[] for _ in frames]
    bins = dataset["range"].values if "range" in dataset.coords else np.zeros(0)
    near_is_cut = bins.size > 1 and bins[0] > bins[1] - bins[0]
    edge_of = functools.cache(lambda number: frames[number].edge(near_is_cut))
    for seen in object_bins(dataset, threshold=threshold, above_noise_db=above_noise_db, smallest=smallest):
        exposed = dataset.attrs["objects"][str(seen.label)].get("exposed")
        both = [(WHOLE, seen.highlight | seen.shadow)] if whole else []
        for kind, shown in ((HIGHLIGHT, seen.highlight), (SHADOW, seen.shadow), *both):
            if not shown.any():
                continue
            for number, (frame, annotated) in enumerate(zip(frames, pieces, strict=True)):
                laid = frame.lay(shown)
                for part in frame.parts:
                    piece = _cut_out(laid[:, part.start:part.stop], smallest)
                    if piece is None:
                        continue
                    row, column, mask = piece
                    annotated.append(Annotation(
                        kind=kind, label=seen.label, name=seen.name, class_name=seen.class_name, side=part.name,
                        row=row, column=part.start + column, mask=mask, exposed=exposed,
                        truncated=bool((laid & edge_of(number))[:, part.start:part.stop].any())))
    return pieces


def clipped(annotation: Annotation, tile: Tile, smallest: int = 1) -> Annotation | None:
    """Return the part of an annotation within a tile, relative to the tile's corner, or None."""
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
    """Return True if a picture (H, W) is black at and around an annotation.

    This happens under the track, where levels lie below black. The record has the object, but a box there would teach
    that black is an object.
    """
    height, width = annotation.mask.shape
    top, left = max(0, annotation.row - AROUND), max(0, annotation.column - AROUND)
    lit = picture[top:annotation.row + height + AROUND, left:annotation.column + width + AROUND] > 0
    mask = np.zeros(lit.shape, bool)
    mask[annotation.row - top:, annotation.column - left:][:height, :width] = annotation.mask
    around = ndimage.binary_dilation(mask, iterations=AROUND) & ~mask
    return all(np.count_nonzero(lit & part) < LIT_SHARE * np.count_nonzero(part) for part in (mask, around)
               if part.any())


def standing_out(pieces: Sequence[Annotation], picture: np.ndarray, least: float) -> list[Annotation]:
    """Return the annotations of a picture (H, W) that stand out from what is beside them.

    The mean grey value of a highlight is at least `least` standard deviations above that of the bins around, and of a
    shadow as many below. Bins of other annotations do not count as around. A highlight with its shadow stays if either
    does.
    """
    taken = np.zeros(picture.shape, bool)
    for piece in pieces:
        taken[_place(piece)] |= piece.mask
    clear = {(piece.label, piece.side, piece.kind) for piece in pieces
             if piece.kind != WHOLE and _contrast(piece, picture, taken) >= least}
    return [piece for piece in pieces
            if any((piece.label, piece.side, kind) in clear
                   for kind in ((HIGHLIGHT, SHADOW) if piece.kind == WHOLE else (piece.kind,)))]


def _contrast(piece, picture, taken):
    """Return by how many standard deviations a highlight is brighter, or a shadow darker, than the bins around."""
    top, left = max(0, piece.row - BESIDE), max(0, piece.column - BESIDE)
    height, width = piece.mask.shape
    near = np.s_[top:piece.row + height + BESIDE, left:piece.column + width + BESIDE]
    mask = np.zeros(picture[near].shape, bool)
    mask[piece.row - top:, piece.column - left:][:height, :width] = piece.mask
    around = picture[near][ndimage.binary_dilation(mask, iterations=BESIDE) & ~taken[near]].astype(float)
    if not around.size:
        return np.inf                                  # nothing to compare it with
    more = float(picture[near][mask].mean() - around.mean()) * (-1 if piece.kind == SHADOW else 1)
    return more / max(float(around.std()), 1.0)        # of one grey value or more


def _place(piece):
    """Return where the mask of an annotation lies in its picture."""
    height, width = piece.mask.shape
    return np.s_[piece.row:piece.row + height, piece.column:piece.column + width]


def _cut_out(mask, smallest):
    """Return the row and column of the bounding box of a mask, and the mask within; None if it is too small."""
    if not mask.size or np.count_nonzero(mask) < max(1, smallest):
        return None
    rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
    return (int(rows[0]), int(columns[0]), mask[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1].copy())
