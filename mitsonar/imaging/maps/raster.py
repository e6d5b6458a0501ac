"""Cartesian pictures of a fan of beams: square elements in metres, for detectors and for viewing.

    x = r sin(bearing)      to starboard, in the order of the columns
    y = r cos(bearing)      ahead; the farthest in the first row, as usual in pictures

A frame is one ping of an array, or one turn (or sector) of a rotating head, whose pings have a bearing each. Levels are
means of powers; labels and other variables are those of the bin at the middle of an element (`raster_map`). For other
mountings of the fan, the ``long_name`` of x and y names their directions. In a fan that looks down, y grows downwards.
"""
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.hydrography.map_grid import check_cells

from ..focused import is_focused
from .raster_map import FanGrid, FanMap, fan_grid, fan_map, reach

LEVELS = ("level", "mean_level")   # averaged as powers
SIDE = 1024                        # elements along the larger side by default
MOST_ELEMENTS = 1 << 24            # of a picture; its map takes at least 60 bytes per element
MOST_BYTES = 1 << 32               # of all pictures
WAYS = (("aft", "forward"), ("port", "starboard"), ("up", "down"))     # against and along the axes of the body
TOWARDS = {"forward": "ahead", "aft": "astern", "starboard": "to starboard", "port": "to port", "down": "below",
           "up": "above"}
SONAR = ("x", "y", "z")            # coordinates of the sonar, renamed since the picture has x and y


@dataclass(frozen=True, kw_only=True)
class RasterSweep:
    """Frame of a record: its pings, and the map of their bins to elements."""

    pings: slice  # of the frame; a single ping for an array
    grid: FanGrid
    map: FanMap

    def own(self, values: np.ndarray) -> np.ndarray:
        """Return the frame's part (beam or step, range) of values (ping, beam, range) or (ping, range)."""
        part = values[self.pings]
        return part[0] if values.ndim == 3 else part

    def levels(self, level: np.ndarray) -> np.ndarray:
        """Draw levels [dB] of the record; see `FanMap.levels`."""
        return self.map.levels(self.own(level))

    def labels(self, values: np.ndarray) -> np.ndarray:
        """Draw values that must not be averaged; see `FanMap.labels`."""
        return self.map.labels(self.own(values))


def cartesian(dataset: xr.Dataset, cell: float | None = None, *, names: Iterable[str] | None = None) -> xr.Dataset:
    """Draw all frames of a fan of beams, or of a rotating head, as pictures in metres.

    Parameters
    ----------
    dataset : xarray.Dataset
        Image from `mitsonar.render`, with ``level`` over (ping, beam, range) and the coordinate ``bearing`` or ``beam``
        [rad] of beams; or over (ping, range) with ``bearing`` of pings, and ``turn`` if there are several turns.
    cell : float or None [m]
        Side of an element. None: the length of a bin, or larger for at most 1024 elements along the larger side.
    names : iterable of str or None
        Variables to draw. None: all variables over the bins.

    Returns
    -------
    xarray.Dataset
        Variables over (ping, y, x) with one frame per ping and unchanged types; outside the fan NaN, or 0 for integers.
        Coordinates x and y [m]; the position of the sonar is ``sonar_x``, ``sonar_y``, ``sonar_z``. Attributes are
        kept, with ``cell`` added.

    Raises
    ------
    ValueError
        If the record is no fan, has a single beam or uneven ranges, or the pictures would be too large.

    Examples
    --------
    ``picture = mitsonar.imaging.cartesian(mitsonar.read("fan.exr"), cell=0.05)``
    """
    record = _transposed(dataset)
    dims = record["level"].dims
    drawn = [str(name) for name, variable in record.data_vars.items()
             if set(dims) <= set(variable.dims) <= {"shape", *dims}]
    if names is not None:
        wanted = [names] if isinstance(names, str) else list(names)
        lacking = [name for name in wanted if name not in drawn]
        if lacking:
            raise ValueError(f"there is no variable {lacking[0]!r} to draw; there are {', '.join(drawn)}.")
        drawn = wanted
    grid, pings = _layout(record, cell)
    bytes_each = sum(record[name].dtype.itemsize * (record[name].sizes.get("shape", 1)) for name in drawn)
    if len(pings) * grid.x.size * grid.y.size * bytes_each > MOST_BYTES:
        raise ValueError(f"{len(pings)} pictures of {grid.y.size} x {grid.x.size} elements and {len(drawn)} variables "
                         f"take {len(pings) * grid.x.size * grid.y.size * bytes_each / 1e9:.3g} GB, more than "
                         f"{MOST_BYTES / 1e9:.2g}; take larger elements than {grid.cell:.3g} m, fewer variables or "
                         "fewer pings.")
    pictures = {name: np.empty((*record[name].shape[:-len(dims)], len(pings), *grid.shape), record[name].dtype)
                for name in drawn}
    for number, sweep in enumerate(_sweeps(record, grid, pings)):
        for name, picture in pictures.items():
            values = record[name].values
            if values.ndim > len(dims):
                for shape, part in enumerate(values):
                    picture[shape, number] = sweep.labels(part)
            else:
                picture[number] = (sweep.levels if name in LEVELS else sweep.labels)(values)
    return _dataset(record, pictures, grid, pings)


def sweeps(dataset: xr.Dataset, cell: float | None = None) -> list[RasterSweep]:
    """Return the frames of a record; for arguments and errors see `cartesian`."""
    record = _transposed(dataset)
    return list(_sweeps(record, *_layout(record, cell)))


def bearings(dataset: xr.Dataset) -> tuple[np.ndarray, list[slice]]:
    """Return the bearings (B,) [rad] of a record, and the pings of each frame."""
    dims, coords = dataset["level"].dims, dataset.coords
    if set(dims) == {"ping", "beam", "range"}:
        name = "bearing" if "bearing" in coords and coords["bearing"].dims == ("beam",) else "beam"
        pings = [slice(ping, ping + 1) for ping in range(dataset.sizes["ping"])]
    elif set(dims) == {"ping", "range"} and "bearing" in coords and coords["bearing"].dims == ("ping",):
        name, turn = "bearing", coords["turn"].values if "turn" in coords else np.zeros(dataset.sizes["ping"])
        ends = [0, *(1 + np.flatnonzero(np.diff(turn))).tolist(), dataset.sizes["ping"]]
        pings = [slice(first, last) for first, last in zip(ends[:-1], ends[1:], strict=True)]
    elif is_focused(dataset):
        raise ValueError("a focused image has no fans: its points already form a grid in metres; use the image itself.")
    else:
        raise ValueError(f"the levels are over {', '.join(map(str, dims))}; a Cartesian picture needs (ping, "
                         "beam, range), or (ping, range) with a bearing for each ping.")
    bearing = np.asarray(coords[name].values, float)
    if bearing.size < 2:
        raise ValueError("the record has a single beam, which makes no Cartesian picture; take two or more.")
    return bearing, pings


def looks_down(dataset: xr.Dataset) -> bool:
    """Return True if the middle of a fan looks down rather than to a side."""
    return _facing(dataset)[0] == "down"


def _transposed(dataset):
    if "level" not in dataset:
        raise ValueError(f"there is no level to draw; there are {', '.join(map(str, dataset.data_vars))}.")
    return dataset.transpose("shape", "ping", "side", "beam", "range", ..., missing_dims="ignore")


def _layout(record, cell) -> tuple[FanGrid, list[slice]]:
    """Return the grid of all frames, and the pings of each."""
    bearing, pings = bearings(record)
    slant_range, downwards = np.asarray(record["range"].values, float), looks_down(record)
    if cell is not None and not 0 < cell < np.inf:
        raise ValueError(f"the side of an element is {cell:g} m; give a length above 0, such as 0.05.")
    left, right, near, far = reach(bearing, slant_range)
    width, height = right - left, far - near
    chosen = cell or max(float(np.diff(slant_range).mean()), max(width, height) / SIDE)
    check_cells((width, height), chosen, MOST_ELEMENTS, what="picture", cells="elements")
    return fan_grid(bearing, slant_range, chosen, downwards), pings


def _sweeps(record, grid, pings) -> Iterator[RasterSweep]:
    """Yield the frames; frames of equal bearings share a map."""
    bearing, _ = bearings(record)
    slant_range = np.asarray(record["range"].values, float)
    known: tuple[bytes, FanMap] | None = None
    for frame in pings:
        beams = bearing if "beam" in record["level"].dims else bearing[frame]
        if known is None or known[0] != beams.tobytes():
            known = beams.tobytes(), fan_map(beams, slant_range, grid)
        yield RasterSweep(pings=frame, grid=grid, map=known[1])


def _facing(dataset) -> tuple[str, str]:
    """Return the directions of the body along the middle of a fan, and to its right."""
    if "beam_z" not in dataset.coords or dataset["beam_z"].dims != ("beam",):
        return "forward", "starboard"
    direction = np.stack([dataset[f"beam_{axis}"].values for axis in "xyz"], axis=-1)
    middle, aside = direction.mean(0), direction[-1] - direction[0]
    ahead = int(np.argmax(np.abs(middle)))
    right = max((axis for axis in range(3) if axis != ahead), key=lambda axis: abs(aside[axis]))
    return WAYS[ahead][int(middle[ahead] > 0)], WAYS[right][int(aside[right] > 0)]


def _dataset(record, pictures, grid, pings):
    first = [frame.start for frame in pings]
    coords = {}
    for name, coord in record.coords.items():
        if coord.dims == ("ping",):
            coords[f"sonar_{name}" if name in SONAR else name] = ("ping", coord.values[first], coord.attrs)
        elif coord.dims in ((), ("shape",)):
            coords[name] = (coord.dims, coord.values, coord.attrs)
    if "beam" not in record["level"].dims:
        coords.pop("bearing", None)
    facing, right = _facing(record)
    coords["y"] = ("y", grid.y, {"units": "m", "long_name": TOWARDS[facing]})
    coords["x"] = ("x", grid.x, {"units": "m", "long_name": TOWARDS[right]})
    variables = {name: (("shape",) * (picture.ndim - 3) + ("ping", "y", "x"), picture, record[name].attrs)
                 for name, picture in pictures.items()}
    return type(record)(variables, coords, {**record.attrs, "cell": grid.cell})
