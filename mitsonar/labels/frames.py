"""Pictures of a record for training: their rows and columns, and tiles of them.

Pictures have the orientation of previews. A sidescan is one picture: a row per ping, the newest on top; port mirrored,
then starboard. Every ping of an array, and every turn or sector of a rotating head, is a picture. Polar pictures have a
row per range, the farthest on top, or at the bottom if the fan looks down, and a column per beam, or per bearing from
left to right. Cartesian pictures are in metres (`mitsonar.imaging.maps.raster`). A focused image is one picture of its
first bank, since all banks share their truth: a row per point along the track, the farthest ahead on top; columns to
starboard. An element of a Cartesian picture is a square, that of other pictures a bin.
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
    """Group of columns of a picture: a side of a sidescan, or all columns."""

    name: str  # ``port``, ``starboard``, or empty without sides
    start: int  # first column
    stop: int  # column after the last
    near: Literal["left", "right", "top", "bottom"]  # edge of the nearest range


@dataclass(frozen=True, kw_only=True)
class LabelFrame(ABC):
    """Picture of a record: a `Waterfall`, a `PolarFrame`, a `CartesianFrame` or a `FocusedFrame`."""

    name: str = ""  # unique within the record, such as ``ping0003``
    ping: int | None  # ping of an array, or first ping of a turn
    parts: tuple[FramePart, ...]  # from left to right
    height: int
    width: int

    @abstractmethod
    def lay(self, values: np.ndarray) -> np.ndarray:
        """Return an array over the dimensions of ``level`` as (height, width), without averaging."""

    def levels(self, level: np.ndarray) -> np.ndarray:
        """Return levels [dB] as (height, width), averaged as powers over several bins, NaN outside a fan."""
        return self.lay(level)

    def seen(self) -> np.ndarray:
        """Return a mask (height, width) of the elements in the sonar's view: all but those outside a fan."""
        return np.ones((self.height, self.width), bool)

    def edge(self, near: bool) -> np.ndarray:
        """Return a mask (height, width) of the edge elements of the view, including the near end if ``near``."""
        edge = np.zeros((self.height, self.width), bool)
        for part in self.parts:
            for border, where in BORDERS.items():
                if near or border != part.near:
                    edge[:, part.start:part.stop][where] = True
        return edge

    def metres(self, row: int, column: int) -> dict[str, float]:
        """Return steps and the upper left corner of an element [m] for pictures in metres, else nothing."""
        return {}


@final
@dataclass(frozen=True, kw_only=True)
class Waterfall(LabelFrame):
    """All pings of a sidescan, or of another sonar with a row per ping."""

    def lay(self, values: np.ndarray) -> np.ndarray:
        if values.ndim == 2:
            return values[::-1]
        return np.concatenate([values[::-1, side, ::-1] if part.near == "right" else values[::-1, side]
                               for side, part in enumerate(self.parts)], axis=1)


@final
@dataclass(frozen=True, kw_only=True)
class PolarFrame(LabelFrame):
    """Fan with a column per beam."""

    columns: np.ndarray  # beams in the order of columns

    def lay(self, values: np.ndarray) -> np.ndarray:
        laid = (values[self.ping] if values.ndim == 3 else values)[self.columns].T
        return laid if self.parts[0].near == "top" else laid[::-1]


@final
@dataclass(frozen=True, kw_only=True)
class CartesianFrame(LabelFrame):
    """Fan in metres."""

    sweep: RasterSweep  # maps its bins to elements

    def lay(self, values: np.ndarray) -> np.ndarray:
        bins = self.sweep.own(values)
        if values.dtype == bool and not bins.any():                        # most objects show in few frames
            return np.zeros((self.height, self.width), bool)
        return self.sweep.map.labels(bins)

    def levels(self, level: np.ndarray) -> np.ndarray:
        return self.sweep.levels(level)

    def seen(self) -> np.ndarray:
        inside = np.zeros(self.height * self.width, bool)
        inside[self.sweep.map.inside] = True
        return inside.reshape(self.height, self.width)

    def edge(self, near: bool) -> np.ndarray:
        inside = self.seen()
        edge = inside & ~np.asarray(ndimage.binary_erosion(inside), bool)
        if not near:
            away = np.hypot(self.sweep.grid.x, self.sweep.grid.y[:, None])
            edge &= away > away[inside].min() + 2 * self.sweep.grid.cell
        return edge

    def metres(self, row: int, column: int) -> dict[str, float]:
        """See `LabelFrame.metres`: x grows by ``cell_x`` per column, y by ``cell_y`` per row."""
        grid = self.sweep.grid
        down = grid.cell if self.parts[0].near == "top" else -grid.cell
        metres = {"cell_x": grid.cell, "cell_y": down, "left": grid.x[0] + (column - 0.5) * grid.cell,
                  "top": grid.y[0] + (row - 0.5) * down}
        return {name: round(float(value), 9) for name, value in metres.items()}


@final
@dataclass(frozen=True, kw_only=True)
class FocusedFrame(LabelFrame):
    """Focused image."""

    rows: slice  # rows of the image in the order of the picture
    columns: slice  # columns of the image in the order of the picture
    along: tuple[float, float]  # [m]: first ``along_track`` and its step
    across: tuple[float, float]  # [m]: first ``across_track`` and its step
    grid: EvenGrid | None  # from the upper left point

    @classmethod
    def of(cls, image: xr.Dataset) -> "FocusedFrame":
        """Return the picture of an image over (bank, along_track, across_track)."""
        known = {dim: image[dim].values if dim in image.coords else np.arange(image.sizes[dim])
                 for dim in ("along_track", "across_track")}
        upwards = slice(None, None, 1 if known["along_track"][-1] >= known["along_track"][0] else -1)
        starboard = to_starboard(image.isel(along_track=upwards))
        drawn = {"along_track": slice(None, None, -upwards.step),
                 "across_track": slice(None, None, 1 if starboard else -1)}
        axes = [known[dim][order] for dim, order in drawn.items()]
        along, across = ((float(axis[0]), float((axis[-1] - axis[0]) / max(axis.size - 1, 1))) for axis in axes)
        near_left = abs(across[0]) < abs(across[0] + (known["across_track"].size - 1) * across[1])
        height, width = (values.size for values in known.values())
        return cls(ping=None, parts=_single(width, "left" if near_left else "right"),
                   height=height, width=width, rows=drawn["along_track"], columns=drawn["across_track"], along=along,
                   across=across, grid=even_grid(image.isel(drawn)))

    def lay(self, values: np.ndarray) -> np.ndarray:
        """See `LabelFrame.lay`; uses the first bank."""
        return (values if values.ndim == 2 else values[0])[self.rows, self.columns]

    def edge(self, near: bool) -> np.ndarray:
        """See `LabelFrame.edge`; a grid ends on all sides."""
        return super().edge(True)

    def metres(self, row: int, column: int) -> dict[str, float]:
        """See `LabelFrame.metres`: ``cell_x`` is the step of ``across_track``, ``cell_y`` that of ``along_track``.

        An even grid adds the position ``x``, ``y`` of the element's corner in the scene, and its steps ``x_column``,
        ``y_column`` per column and ``x_row``, ``y_row`` per row.
        """
        metres = {"cell_x": self.across[1], "cell_y": self.along[1],
                  "left": self.across[0] + (column - 0.5) * self.across[1],
                  "top": self.along[0] + (row - 0.5) * self.along[1]}
        if self.grid is not None:
            down, right = self.grid.ahead, self.grid.abeam
            x, y = self.grid.first + (row - 0.5) * down + (column - 0.5) * right
            metres |= {"x": x, "y": y, "x_column": right[0], "y_column": right[1], "x_row": down[0], "y_row": down[1]}
        return {name: round(float(value), 9) for name, value in metres.items()}


@dataclass(frozen=True, kw_only=True)
class Tile:
    """Rectangle of a picture: first row and column, height and width."""

    row: int
    column: int
    height: int
    width: int


def frames(dataset: xr.Dataset, name: FilePath = "the dataset", form: Form = "polar",
           cell: float | None = None) -> list[LabelFrame]:
    """Return the pictures of a dataset; ``cell`` [m] is the side of an element of Cartesian pictures."""
    dims, shape = dataset["level"].dims, dataset["level"].shape
    if form == "cartesian":
        return _in_metres(dataset, name, cell)
    if dims in (("bank", *GROUND), GROUND):
        return [FocusedFrame.of(dataset)]
    if dims == ("ping", "beam", "range"):
        return _in_beams(dataset, [np.arange(shape[1])] * shape[0], list(range(shape[0])), "ping")
    if dims == ("ping", "range") and "bearing" in dataset.coords:
        bearing, pings = bearings(dataset)
        columns = [turn.start + in_order(bearing[turn])[0] for turn in pings]
        return _in_beams(dataset, columns, [turn.start for turn in pings], "turn")
    if dims == ("ping", "range"):
        return [Waterfall(ping=None, parts=_single(shape[1], "left"), height=shape[0], width=shape[1])]
    if dims != ("ping", "side", "range"):
        raise ValueError(f"{name} has levels over {', '.join(map(str, dims))}; pictures need (ping, side, range), "
                         "(ping, range) or (ping, beam, range).")
    bins = shape[2]
    parts = tuple(FramePart(name=str(side), start=number * bins, stop=(number + 1) * bins,
                            near="right" if str(side) == "port" else "left")
                  for number, side in enumerate(dataset["side"].values))
    return [Waterfall(ping=None, parts=parts, height=shape[0], width=shape[1] * bins)]


def tiles(frame: LabelFrame, size: tuple[int, int] | None = None, overlap: float = 0.0) -> list[Tile]:
    """Return tiles of one size that cover a picture; the last of a row or column ends at the edge."""
    height, width = (frame.height, frame.width) if size is None else (min(size[0], frame.height),
                                                                      min(size[1], frame.width))
    return [Tile(row=row, column=column, height=height, width=width)
            for row in _starts(frame.height, height, overlap) for column in _starts(frame.width, width, overlap)]


def _single(width: int, near: Literal["left", "right", "top", "bottom"]) -> tuple[FramePart]:
    """Return all columns of a picture as its only part."""
    return (FramePart(name="", start=0, stop=width, near=near),)


def _in_beams(dataset, columns, pings, kind) -> list[LabelFrame]:
    near, height = "top" if looks_down(dataset) else "bottom", dataset.sizes["range"]
    return [PolarFrame(name=f"{kind}{number if kind == 'turn' else ping:04d}", ping=ping, columns=beams, height=height,
                       width=beams.size, parts=_single(beams.size, near))
            for number, (ping, beams) in enumerate(zip(pings, columns, strict=True))]


def _in_metres(dataset, name, cell) -> list[LabelFrame]:
    try:
        rasters = sweeps(dataset, cell)
    except ValueError as error:
        raise ValueError(f"{name} has no Cartesian pictures: {error}") from None
    kind, near = "ping" if "beam" in dataset.dims else "turn", "top" if looks_down(dataset) else "bottom"
    return [CartesianFrame(
        name=f"{kind}{number:04d}", ping=sweep.pings.start, sweep=sweep, height=sweep.grid.y.size,
        width=sweep.grid.x.size, parts=_single(sweep.grid.x.size, near))
            for number, sweep in enumerate(rasters)]


def _starts(size, length, overlap):
    step = max(1, round(length * (1 - overlap)))
    return [*range(0, size - length, step), size - length]
