"""Pictures of a record with everything that is known of each: masks, annotations, and a description in words.

    record -> frames -> grey values, annotations -> tiles
"""
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import bin_dims, is_focused
from mitsonar.imaging.objects import check_labelled

from .annotations import HIGHLIGHT, WHOLE, Annotation, annotations, clipped, is_invisible, standing_out
from .frames import LabelFrame, frames, tiles
from .pictures import greys
from .rules import Labels

MOST_INSTANCES = 65535             # that fit into masks of 16 bits
MOSTLY = 0.5                       # least share of a focused image's pings that do not see a shadow
PLACE = ("crs", "local_origin")    # position of x = y = 0 on a map
MASKS = ("instance", "class", "shadow", "bed_shadow")


@dataclass(frozen=True, kw_only=True, eq=False)
class LabelledTile:
    """Picture of a record, or a tile of one, with its annotations."""

    ending: str  # of its name, unique in the record; empty for a single picture
    frame: LabelFrame
    number: int  # of the frame in the record
    picture: np.ndarray  # (rows, columns) uint8
    shadow: np.ndarray  # (rows, columns) bool: in shadow of the bed
    pieces: tuple[Annotation, ...]
    negatives: dict[str, int]  # highlights of negatives by their own class; `pieces` has them as the class of negatives
    invisible: int  # pieces of the whole frame that are left out, in its first tile, else 0
    description: dict[str, Any]  # place in the record, gain and grey values

    def annotated(self, numbers: Mapping[str, int]) -> list[Annotation]:
        """Return the pieces whose categories have numbers; the masks have the others, too."""
        return [piece for piece in self.pieces if piece.category in numbers]

    def is_empty(self, numbers: Mapping[str, int]) -> bool:
        """Return True without annotations and negatives."""
        return not self.annotated(numbers) and not any(self.negatives.values())

    def masks(self, numbers: dict[str, int], name: str) -> dict[str, np.ndarray]:
        """Return the masks (rows, columns) uint16 of `MASKS`, with the numbers of categories; `name` is for errors."""
        masks = {kind: np.zeros(self.shadow.shape, np.uint16) for kind in MASKS}
        masks["bed_shadow"][self.shadow] = 1
        for piece in (piece for piece in self.pieces if piece.kind != WHOLE):
            if max(piece.label, numbers.get(piece.category, 0)) > MOST_INSTANCES:
                raise ValueError(f"{name} has objects numbered up to {piece.label}, but masks hold at most "
                                 f"{MOST_INSTANCES}; leave the masks out.")
            height, width = piece.mask.shape
            where = np.s_[piece.row:piece.row + height, piece.column:piece.column + width]
            masks["instance" if piece.kind == HIGHLIGHT else "shadow"][where][piece.mask] = piece.label
            masks["bed_shadow"][where][piece.mask] = 0
            if piece.kind == HIGHLIGHT:
                masks["class"][where][piece.mask] = numbers[piece.category]
        return masks


def labelled(record: xr.Dataset, name: FilePath, rules: Labels) -> tuple[list[LabelFrame], Iterator[LabelledTile]]:
    """Return the frames of a record and its labelled pictures; `name` is for errors."""
    check_labelled(record, str(name))
    pictures = frames(record, name, rules.form, rules.cell)
    return pictures, _tiles(record, pictures, rules)


def _tiles(record, pictures, rules):
    shown = greys(record, pictures, tvg=rules.tvg, window=rules.window)
    annotated = annotations(record, pictures, threshold=rules.threshold, smallest=rules.smallest,
                            above_noise_db=rules.above_noise_db, whole=rules.whole)
    dark = _dark(record) if rules.masks and "shadow" in record else None
    about = {"window_db": [round(value, 3) for value in shown.window], "grey": f"{shown.words} [{shown.unit}]"}
    if is_focused(record):
        about |= {name: record.attrs[name] for name in PLACE if record.attrs.get(name) is not None}
    for number, (frame, pieces) in enumerate(zip(pictures, annotated, strict=True)):
        picture = shown.draw(frame)
        shadow = np.zeros(picture.shape, bool) if dark is None else frame.lay(dark)
        seen = [piece for piece in pieces if not is_invisible(piece, picture)]
        seen = seen if rules.min_contrast is None else standing_out(seen, picture, rules.min_contrast)
        left = len(pieces) - len(seen)
        for tile in tiles(frame, rules.tile, rules.overlap):
            inside = [piece for piece in (clipped(whole, tile, rules.smallest) for whole in seen)
                      if piece and piece.shown >= rules.min_visible]
            inside, negatives = _without_negatives(inside, rules)
            part = np.s_[tile.row:tile.row + tile.height, tile.column:tile.column + tile.width]
            yield LabelledTile(
                ending="_".join([*[frame.name] * bool(frame.name),
                                 *[f"{tile.row}_{tile.column}"] * (rules.tile is not None)]),
                frame=frame, number=number, picture=picture[part], shadow=shadow[part], pieces=tuple(inside),
                negatives=negatives, invisible=left,
                description={"ping": frame.ping, "row": tile.row, "column": tile.column, **about,
                             **frame.metres(tile.row, tile.column)})
            left = 0


def _without_negatives(pieces, rules):
    """Return pieces with negatives left out or as their common class, and the highlights of negatives by class."""
    counts = {name: sum(piece.kind == HIGHLIGHT and piece.class_name == name for piece in pieces)
              for name in rules.negatives}
    return [replace(piece, class_name=rules.negative_class) if piece.class_name in counts else piece
            for piece in pieces if piece.class_name not in counts or rules.negative_class is not None], counts


def _dark(record):
    """Return a mask of the bins in shadow of the bed rather than of objects, over the dimensions of the truth."""
    dims = bin_dims(record)
    dark = record["shadow"].transpose(*dims).values > (MOSTLY if is_focused(record) else 0)
    if "object_shadow" in record:
        dark &= record["object_shadow"].transpose(*dims).values == 0
    return dark
