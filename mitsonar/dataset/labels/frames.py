"""The pictures of a record, as programs that learn from images see them: rows, columns, and tiles of them.

They are the way up that previews are. A sidescan is one picture: a row per ping, the newest on top; port mirrored, then
starboard. Of an array every ping is a picture, of a rotating head every turn or sector. Polar ones have a row per
range, the farthest on top, or at the bottom where the fan looks down; a column per beam, in their order, or per bearing
from left to right. Cartesian ones are in metres (`mitsonar.imaging.maps.raster`). A focused image is one picture, of
its first bank, for all share their truth: a row per point along the track, the farthest ahead on top; columns to
starboard. An element of a Cartesian picture is a square, of others a bin.
"""
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import GROUND, EvenGrid, even_grid, to_starboard
from mitsonar.imaging.maps.raster import RasterSweep, bearings, looks_down, sweeps
from mitsonar.imaging.maps.raster_map import in_order

Form = Literal["polar", "cartesian"]
FORMS = ("polar", "cartesian")
BORDERS = {"left": np.s_[:, :1], "right": np.s_[:, -1:], "top": np.s_[:1], "bottom": np.s_[-1:]}


@dataclass(frozen=True, kw_only=True)
class FramePart:
    """Columns of a picture that belong together: a side of a sidescan, or all."""

    name: str  # ``port``, ``starboard``, or empty where there are no sides
    start: int  # columns
    stop: int  # columns
    near: Literal["left", "right", "top", "bottom"]  # on which edge the nearest range is


@dataclass(frozen=True, kw_only=True)
class LabelFrame(ABC):
    """One picture of a record: a `Waterfall`, a `PolarFrame`, a `CartesianFrame` or a `FocusedFrame`."""

    name: str = ""  # what tells it from other pictures of its record, such as ``ping0003``
    ping: int | None  # which ping of an array, or the first of a turn
    parts: tuple[FramePart, ...]  # from left to right
    height: int
    width: int

    @abstractmethod
    def lay(self, values: np.ndarray) -> np.ndarray:
        """Lay out an array over the dimensions of ``level`` as (height, width); nothing is mixed."""

    def levels(self, level: np.ndarray) -> np.ndarray:
        """Lay out levels [dB]: means of powers where an element holds several bins, NaN outside a fan."""
        return self.lay(level)

    def seen(self) -> np.ndarray:
        """Return the elements (height, width) that the sonar sees: all but those outside a fan."""
        return np.ones((self.height, self.width), bool)

    def edge(self, near: bool) -> np.ndarray:
        """Return the elements (height, width) beyond which things may go on; at the near end of the range if asked."""
        edge = np.zeros((self.height, self.width), bool)
        for part in self.parts:
            for border, where in BORDERS.items():
                if near or border != part.near:
                    edge[:, part.start:part.stop][where] = True
        return edge

    def metres(self, row: int, column: int) -> dict[str, float]:
        """Give, of a picture in metres, the steps and the upper left corner of an element [m]; of others nothing."""
        return {}


@final
@dataclass(frozen=True, kw_only=True)
class Waterfall(LabelFrame):
    """All pings of a sidescan, or of a sonar with a row a ping."""

    def lay(self, values: np.ndarray) -> np.ndarray:
        """See `LabelFrame.lay`."""
        if values.ndim == 2:
            return values[::-1]
        return np.concatenate([values[::-1, side, ::-1] if part.near == "right" else values[::-1, side]
                               for side, part in enumerate(self.parts)], axis=1)


@final
@dataclass(frozen=True, kw_only=True)
class PolarFrame(LabelFrame):
    """A fan, a column per beam."""

    columns: np.ndarray  # likewise

    def lay(self, values: np.ndarray) -> np.ndarray:
        """See `LabelFrame.lay`."""
        own = values[self.ping] if values.ndim == 3 else values
        laid = own[self.columns].T
        return laid if self.parts[0].near == "top" else laid[::-1]


@final
@dataclass(frozen=True, kw_only=True)
class CartesianFrame(LabelFrame):
    """A fan in metres."""

    sweep: RasterSweep  # where its bins lie

    def lay(self, values: np.ndarray) -> np.ndarray:
        """See `LabelFrame.lay`."""
        own = self.sweep.own(values)
        if values.dtype == bool and not own.any():                         # most objects are in few frames
            return np.zeros((self.height, self.width), bool)
        return self.sweep.map.labels(own)

    def levels(self, level: np.ndarray) -> np.ndarray:
        """See `LabelFrame.levels`."""
        return self.sweep.levels(level)

    def seen(self) -> np.ndarray:
        """See `LabelFrame.seen`."""
        inside = np.zeros(self.height * self.width, bool)
        inside[self.sweep.map.inside] = True
        return inside.reshape(self.height, self.width)

    def edge(self, near: bool) -> np.ndarray:
        """See `LabelFrame.edge`."""
        inside = self.seen()
        edge = inside & ~np.asarray(ndimage.binary_erosion(inside), bool)
        if not near:
            away = np.hypot(self.sweep.grid.x, self.sweep.grid.y[:, None])
            edge &= away > away[inside].min() + 2 * self.sweep.grid.cell
        return edge

    def metres(self, row: int, column: int) -> dict[str, float]:
        """See `LabelFrame.metres`: x grows by ``cell_x`` a column, y by ``cell_y`` a row."""
        grid = self.sweep.grid
        down = grid.cell if self.parts[0].near == "top" else -grid.cell
        found = {"cell_x": grid.cell, "cell_y": down, "left": grid.x[0] + (column - 0.5) * grid.cell,
                 "top": grid.y[0] + (row - 0.5) * down}
        return {name: round(float(value), 9) for name, value in found.items()}


@final
@dataclass(frozen=True, kw_only=True)
class FocusedFrame(LabelFrame):
    """A focused image."""

    rows: slice  # order in which its rows are those of the picture
    columns: slice  # that bring its points into the picture's order
    along: tuple[float, float]  # [m]: of its grid
    across: tuple[float, float]  # [m]: of its grid
    grid: EvenGrid | None  # from the upper left point on

    @classmethod
    def of(cls, image: xr.Dataset) -> "FocusedFrame":
        """Return the picture of an image over (bank, along_track, across_track)."""
        known = {dim: image[dim].values if dim in image.coords else np.arange(image.sizes[dim])
                 for dim in ("along_track", "across_track")}
        upwards = slice(None, None, 1 if _rises(known["along_track"]) else -1)
        starboard = to_starboard(image.isel(along_track=upwards))
        drawn = {"along_track": slice(None, None, -upwards.step),
                 "across_track": slice(None, None, 1 if starboard else -1)}
        along, across = (_axis(known[dim][where]) for dim, where in drawn.items())
        near_left = abs(across[0]) < abs(across[0] + (known["across_track"].size - 1) * across[1])
        height, width = (values.size for values in known.values())
        return cls(ping=None, parts=(FramePart(name="", start=0, stop=width, near="left" if near_left else "right"),),
                   height=height, width=width, rows=drawn["along_track"], columns=drawn["across_track"], along=along,
                   across=across, grid=even_grid(image.isel(drawn)))

    def lay(self, values: np.ndarray) -> np.ndarray:
        """See `LabelFrame.lay`; of banks the first."""
        own = values if values.ndim == 2 else values[0]
        return own[self.rows, self.columns]

    def edge(self, near: bool) -> np.ndarray:
        """See `LabelFrame.edge`; a grid ends on all sides."""
        return super().edge(True)

    def metres(self, row: int, column: int) -> dict[str, float]:
        """See `LabelFrame.metres`: ``across_track`` grows by ``cell_x`` a column, ``along_track`` by ``cell_y`` a row.

        Of an even grid also where the element's corner lies in the scene, ``x`` and ``y``, and the steps there:
        ``x_column``, ``y_column`` of a column, ``x_row``, ``y_row`` of a row.
        """
        found = {"cell_x": self.across[1], "cell_y": self.along[1],
                 "left": self.across[0] + (column - 0.5) * self.across[1],
                 "top": self.along[0] + (row - 0.5) * self.along[1]}
        if self.grid is not None:
            down, right = self.grid.ahead, self.grid.abeam
            x, y = self.grid.first + (row - 0.5) * down + (column - 0.5) * right
            found |= {"x": x, "y": y, "x_column": right[0], "y_column": right[1], "x_row": down[0], "y_row": down[1]}
        return {name: round(float(value), 9) for name, value in found.items()}


@dataclass(frozen=True, kw_only=True)
class Tile:
    """A rectangle of a picture: its first row and column, its height and width."""

    row: int
    column: int
    height: int
    width: int


def frames(dataset: xr.Dataset, name: FilePath = "the dataset", form: Form = "polar",
           cell: float | None = None) -> list[LabelFrame]:
    """Return the pictures of a dataset."""
    # cell [m]
    dims, shape = dataset["level"].dims, dataset["level"].shape
    if form == "cartesian":
        return _in_metres(dataset, name, cell)
    if dims in (("bank", *GROUND), GROUND):
        return [FocusedFrame.of(dataset)]
    if dims == ("ping", "beam", "range"):
        return _in_beams(dataset, [np.arange(shape[1])] * shape[0], list(range(shape[0])), "ping")
    if dims == ("ping", "range") and "bearing" in dataset.coords:
        bearing, pings = bearings(dataset)
        columns = [where.start + in_order(bearing[where])[0] for where in pings]
        return _in_beams(dataset, columns, [where.start for where in pings], "turn")
    if dims == ("ping", "range"):
        return [Waterfall(ping=None, parts=(FramePart(name="", start=0, stop=shape[1], near="left"),), height=shape[0],
                          width=shape[1])]
    if dims != ("ping", "side", "range"):
        raise ValueError(f"{name} has levels over {', '.join(map(str, dims))}; pictures are made of (ping, side, "
                         "range), (ping, range) and (ping, beam, range).")
    bins = shape[2]
    parts = tuple(FramePart(name=str(side), start=number * bins, stop=(number + 1) * bins,
                       near="right" if str(side) == "port" else "left")
                  for number, side in enumerate(dataset["side"].values))
    return [Waterfall(ping=None, parts=parts, height=shape[0], width=shape[1] * bins)]


def tiles(frame: LabelFrame, size: tuple[int, int] | None = None, overlap: float = 0.0) -> list[Tile]:
    """Cut a picture into tiles of one size; the last of a row or column is moved inwards to end at the edge."""
    height, width = (frame.height, frame.width) if size is None else (min(size[0], frame.height),
                                                                      min(size[1], frame.width))
    return [Tile(row=row, column=column, height=height, width=width)
            for row in _starts(frame.height, height, overlap) for column in _starts(frame.width, width, overlap)]


def _in_beams(dataset, columns, pings, kind) -> list[LabelFrame]:
    near, height = "top" if looks_down(dataset) else "bottom", dataset.sizes["range"]
    return [PolarFrame(name=f"{kind}{number if kind == 'turn' else ping:04d}", ping=ping, columns=own, height=height,
                       width=own.size, parts=(FramePart(name="", start=0, stop=own.size, near=near),))
            for number, (ping, own) in enumerate(zip(pings, columns, strict=True))]


def _in_metres(dataset, name, cell) -> list[LabelFrame]:
    try:
        found = sweeps(dataset, cell)
    except ValueError as error:
        raise ValueError(f"{name} has no Cartesian pictures: {error}") from None
    kind, near = "ping" if "beam" in dataset.dims else "turn", "top" if looks_down(dataset) else "bottom"
    return [CartesianFrame(
        name=f"{kind}{number:04d}", ping=sweep.pings.start, sweep=sweep, height=sweep.grid.y.size,
        width=sweep.grid.x.size, parts=(FramePart(name="", start=0, stop=sweep.grid.x.size, near=near),))
        for number, sweep in enumerate(found)]


def _rises(values):
    return values.size < 2 or values[-1] >= values[0]


def _axis(values):
    """The first of a grid's numbers, and their mean step."""
    return float(values[0]), float((values[-1] - values[0]) / max(values.size - 1, 1))


def _starts(whole, length, overlap):
    step = max(1, round(length * (1 - overlap)))
    return [*range(0, whole - length, step), whole - length]
