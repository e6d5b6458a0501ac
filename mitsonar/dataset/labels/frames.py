"""The pictures of a record, as programs that learn from images see them: rows, columns, and tiles of them.

They are the way up that previews are. A sidescan is one picture: a row per ping, the newest on top; port mirrored, then
starboard. Of an array every ping is a picture of its own: a row per range, the farthest on top, or at the bottom where
the fan looks down; a column per beam, in their order. A picture element is a bin.
"""
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from ...io.files import FilePath
from ...plots.fans import looks_down

__all__ = ["Frame", "Part", "Tile", "frames", "tiles"]


@dataclass(frozen=True, kw_only=True)
class Part:
    """Columns of a picture that belong together: a side of a sidescan, or all.

    Attributes
    ----------
    name : str
        ``port``, ``starboard``, or empty where there are no sides.
    start, stop : int
        Columns.
    near : {'left', 'right', 'top', 'bottom'}
        On which edge the nearest range is.
    """

    name: str
    start: int
    stop: int
    near: Literal["left", "right", "top", "bottom"]


@dataclass(frozen=True, kw_only=True)
class Frame:
    """One picture of a record.

    Attributes
    ----------
    ping : int or None
        Which ping of an array; None for all of a sidescan.
    parts : tuple of Part
        From left to right.
    height, width : int
    """

    ping: int | None
    parts: tuple[Part, ...]
    height: int
    width: int

    def lay(self, values: np.ndarray) -> np.ndarray:
        """Lay out an array over the dimensions of ``level`` as (height, width)."""
        if self.ping is not None:
            laid = values[self.ping].T
            return laid if self.parts[0].near == "top" else laid[::-1]
        if values.ndim == 2:
            return values[::-1]
        return np.concatenate([values[::-1, side, ::-1] if part.near == "right" else values[::-1, side]
                               for side, part in enumerate(self.parts)], axis=1)


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A rectangle of a picture: its first row and column, its height and width."""

    row: int
    column: int
    height: int
    width: int


def frames(dataset: xr.Dataset, name: FilePath = "the dataset") -> list[Frame]:
    """Give the pictures of a dataset.

    Parameters
    ----------
    dataset : xarray.Dataset
        With ``level`` over (ping, side, range), (ping, range) or (ping, beam, range).
    name : str
        What a person calls it.

    Returns
    -------
    list of Frame

    Raises
    ------
    ValueError
        If its levels have other dimensions.
    """
    dims, shape = dataset["level"].dims, dataset["level"].shape
    if dims == ("ping", "beam", "range"):
        part = Part(name="", start=0, stop=shape[1], near="top" if looks_down(dataset) else "bottom")
        return [Frame(ping=ping, parts=(part,), height=shape[2], width=shape[1]) for ping in range(shape[0])]
    if dims == ("ping", "range"):
        return [Frame(ping=None, parts=(Part(name="", start=0, stop=shape[1], near="left"),), height=shape[0],
                      width=shape[1])]
    if dims != ("ping", "side", "range"):
        raise ValueError(f"{name} has levels over {', '.join(map(str, dims))}; pictures are made of (ping, side, "
                         "range), (ping, range) and (ping, beam, range).")
    bins = shape[2]
    parts = tuple(Part(name=str(side), start=number * bins, stop=(number + 1) * bins,
                       near="right" if str(side) == "port" else "left")
                  for number, side in enumerate(dataset["side"].values))
    return [Frame(ping=None, parts=parts, height=shape[0], width=shape[1] * bins)]


def tiles(frame: Frame, size: tuple[int, int] | None = None, overlap: float = 0.0) -> list[Tile]:
    """Cut a picture into tiles of one size; the last of a row or column is moved inwards to end at the edge.

    Parameters
    ----------
    frame : Frame
    size : (int, int) or None
        Rows and columns of a tile, no more of them than the picture has; None for the whole picture.
    overlap : float [-]
        Share of a tile that its neighbour repeats, at least 0 and at most 0.9.

    Returns
    -------
    list of Tile
    """
    height, width = (frame.height, frame.width) if size is None else (min(size[0], frame.height),
                                                                      min(size[1], frame.width))
    return [Tile(row=row, column=column, height=height, width=width)
            for row in _starts(frame.height, height, overlap) for column in _starts(frame.width, width, overlap)]


def _starts(whole, length, overlap):
    step = max(1, round(length * (1 - overlap)))
    return [*range(0, whole - length, step), whole - length]
