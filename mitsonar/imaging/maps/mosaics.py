"""Mosaics: sidescan lines laid on a map of square cells, corrected for slant range.

Every ping is sampled in even steps over the ground (`mosaic_swath`), and the strip between two pings in steps as fine;
each half shows the nearer ping. Pings farther apart than ``fill`` leave a hole and show only their own positions.
`mosaic_cells` combines samples in the cells of a `map_grid`. Mosaics of one cell and coordinate system fit together.
"""
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import xarray as xr

from mitsonar.device.earth import FARTHEST, metric_system, system
from mitsonar.hydrography.map_grid import MapGrid, check_cells
from mitsonar.units import db_from_power, power_from_db

from ..gain import AngleGain, display_gain
from .mosaic_cells import BLENDS, MosaicCells
from .mosaic_swath import PLACES, MosaicGround, MosaicSwath

Gain = Literal["seabed", "target", "angle"] | None
Place = Literal["flat", "truth"]
Blend = Literal["nearest", "feather", "mean"]
GAINS = ("seabed", "target", "angle", None)
NAMES = {"label": "labels", "object_shadow": "labels", "class": "classes"}      # attributes that name the numbers
NEEDED = ("ping_time", "x", "y", "heading", "pitch", "altitude")
MOST_CELLS = 1 << 25
MOST_SAMPLES = 1 << 33             # takes a quarter of an hour
NICE = np.array([1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10])       # default sides of cells, times a power of ten
LEVELS = ("level", "mean_level")   # averaged as powers
LOUDEST_DB = 300.0                 # [dB re 1 µPa]
WORK = 1 << 19                     # samples at a time
FINEST = 0.6                       # cells between samples: below 1/√2 no cell is missed


@dataclass(frozen=True, kw_only=True, eq=False)
class MosaicLine:
    """Quantity of a record for the mosaic, and the gain added to its levels."""

    swath: MosaicSwath
    quantity: str
    gain: Gain  # added to levels

    @cached_property
    def angles(self) -> AngleGain:
        """Return the gain by angle of the whole record."""
        return AngleGain.of(self.swath.record)

    def values(self, pings: slice) -> np.ndarray:
        """Return the values (K, 2, N) of pings, with levels as powers."""
        record = self.swath.record.isel(ping=pings)
        values = record[self.quantity].transpose("ping", "side", "range").values
        if self.quantity not in LEVELS:
            return values
        if values.max() > LOUDEST_DB:
            raise ValueError(f"the record has levels of {values.max():.4g} dB, beyond any sound; render it anew.")
        if self.gain == "angle":
            return power_from_db(values + self.angles.gain(record))
        return power_from_db(values + display_gain(record, self.gain)[0][:, None])


def samples(line: MosaicLine, cell: float, fill: float, *,
            with_values: bool) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
    """Yield positions (N, 2) [m], ground ranges (N,) [m] and values (N,) of a record, dense enough for cells [m].

    Pings farther apart than ``fill`` [m] leave a hole.
    """
    swath, step = line.swath, min(FINEST * cell, line.swath.bin_width)
    pings = swath.record.sizes["ping"]
    block = max(1, int(WORK * step / swath.reach))
    for start in range(0, max(pings - 1, 1), block):
        part = slice(start, min(start + block + 1, pings))          # blocks share a ping
        values = line.values(part) if with_values else None
        for side, ground in swath.ground(part, step):
            shown = None if values is None else np.take_along_axis(values[:, side], ground.bin, 1)
            for place, from_first in _between(ground, cell, fill):
                there = np.isfinite(place).all(-1)
                ranges = np.broadcast_to(ground.ground_range, there.shape)[there]
                if shown is None:
                    yield place[there], ranges, None
                    continue
                sampled = (shown[:-1] if from_first and len(shown) > 1 else shown[-len(place):])[there]
                real = np.isfinite(sampled) if sampled.dtype.kind == "f" else slice(None)
                yield place[there][real], ranges[real], sampled[real]


def _between(ground: MosaicGround, cell: float, fill: float) -> Iterator[tuple[np.ndarray, bool]]:
    """Yield positions between each ping and the next (K - 1, G, 2), with True if they show the former."""
    if len(ground.place) == 1:
        yield ground.place, True
        return
    first, way = ground.place[:-1], np.diff(ground.place, axis=0)
    apart = np.hypot(way[..., 0], way[..., 1])
    hole = apart > fill
    widest = float(np.max(apart, where=~hole & np.isfinite(apart), initial=0.0))
    count = max(2, int(np.ceil(widest / (FINEST * cell))))
    count += count % 2                                              # equally many for either ping
    for number in range(count):
        share = (number + 0.5) / count
        former = share < 0.5
        # beside a hole, a ping shows only its own position
        shares = np.where(hole, 0.0 if former else 1.0, share)
        shown = first if former else ground.place[1:]
        # so does a ping whose neighbour has no position there
        yield np.where(np.isfinite(way), first + shares[..., None] * way, shown), former


def check(lines: Sequence[xr.Dataset], quantity: str, options: Mapping[str, Any]) -> None:
    """Check the arguments of `mosaic`; ``options`` are its place, blend, gain and nadir_deg."""
    if not lines:
        raise ValueError("no record was given; give one or more.")
    for name, known in (("place", PLACES), ("blend", BLENDS), ("gain", GAINS)):
        if options[name] not in known:
            raise ValueError(f"{name} is {options[name]!r}; give one of {', '.join(map(str, known))}.")
    if not 0 <= options["nadir_deg"] < 90:
        raise ValueError(f"nadir_deg is {options['nadir_deg']:g}; give an angle from 0 to below 90 degrees from the "
                         "vertical.")
    for line in lines:
        _check_contents(line, quantity, options["place"])
        _check_axes(line)
        _check_alike(line, lines[0], quantity)


def common_system(lines: Sequence[xr.Dataset], crs: str | None) -> str | None:
    """Return the coordinate system of the map: the given one, else that of the first record, or None."""
    if crs is None:
        named = {system(line.attrs) for line in lines}
        if len(named) > 1 and None in named:
            raise ValueError("only some of the records name a coordinate system; give one for the map, such as "
                             "EPSG:32632.")
        crs = system(lines[0].attrs)
    if crs is not None:
        metric_system(crs)
    return crs


def _check_contents(line, quantity, place):
    drawn = [str(name) for name, variable in line.data_vars.items() if set(variable.dims) == {"ping", "side", "range"}]
    if "level" not in drawn:
        raise ValueError("the record has no levels over ping, side and range; a mosaic is made of sidescans.")
    lacking = [name for name in NEEDED if name not in line.coords]
    lacking += [name for name in ("seabed_x", "seabed_y") if place == "truth" and name not in drawn]
    if lacking:
        raise ValueError(f"the record has no {lacking[0]}; give a record as mitsonar rendered it.")
    speed = line.attrs.get("sound_speed")
    if not isinstance(speed, (int, float)) or not 0 < speed < np.inf:
        raise ValueError(f"the record's sound_speed is {speed!r}; it takes a number above 0.")
    if quantity not in drawn or line[quantity].dtype.kind not in "fu":
        raise ValueError(f"there is no variable {quantity!r} to lay out; there are {', '.join(drawn)}.")


def _check_axes(line):
    if list(line["side"].values) != ["port", "starboard"]:
        raise ValueError(f"the record's sides are {', '.join(map(str, line['side'].values))}; a mosaic takes port and "
                         "starboard.")
    if not line.sizes["ping"]:
        raise ValueError("a record has no pings; give a record with pings.")
    slant_range = np.asarray(line["range"].values, float)
    steps = np.diff(slant_range) if np.isfinite(slant_range).all() else np.zeros(1)
    if not steps.size or steps.min() <= 0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError("the record's ranges are not two or more in even steps; give a record from mitsonar.")
    if not all(np.isfinite(line[name].values).all() for name in ("x", "y", "heading", "pitch", "ping_time")):
        raise ValueError("the record's track has positions or angles that are not finite; render it anew.")
    if (np.diff(line["ping_time"].values) <= 0).any():
        raise ValueError("the record's pings are not one after the other in time; sort them.")
    if max(np.abs(line[axis].values).max() for axis in "xy") > FARTHEST:
        raise ValueError(f"the record's track goes beyond {FARTHEST:g} m, farther than any place on Earth.")


def _check_alike(line, first, quantity):
    if line[quantity].dtype != first[quantity].dtype:
        raise ValueError(f"the records hold {quantity} as different types; render them alike.")
    if quantity in NAMES and line.attrs.get(NAMES[quantity]) != first.attrs.get(NAMES[quantity]):
        raise ValueError(f"the records have different {NAMES[quantity]}, so that equal numbers mean different "
                         "things; make a mosaic of each.")
    if quantity not in NAMES and line.attrs.get("frequency") != first.attrs.get("frequency"):
        raise ValueError(f"the records have {_khz(first)} and {_khz(line)}, whose levels cannot be combined; make "
                         "a mosaic of each.")


def _khz(record):
    frequency = record.attrs.get("frequency")
    return f"{frequency / 1000:g} kHz" if isinstance(frequency, (int, float)) else "no known frequency"


def mosaic(records: xr.Dataset | Sequence[xr.Dataset], cell: float | None = None, *, quantity: str = "level",
           place: Place = "flat", blend: Blend = "nearest", gain: Gain = "seabed", fill: float | None = None,
           nadir_deg: float = 0.0, crs: str | None = None) -> xr.Dataset:
    """Return a map of sidescan records.

    Parameters
    ----------
    records : xarray.Dataset or sequence of them
        Images from `mitsonar.render` over (ping, side, range).
    cell : float or None [m]
        Side of a cell. None: the larger of a bin and the distance of pings, rounded up.
    quantity : str
        Variable to map. Levels are averaged as powers; integers are those nearest to the middle of a cell on the
        nearest track; other variables are averaged.
    place : {'flat', 'truth'}
        Position of bins: on a level bed at the ping's altitude, as in survey software; or as recorded in the truth.
    blend : {'nearest', 'feather', 'mean'}
        Overlapping swaths: the nearest track only; all, weighted less towards the swath edge; or all equally.
    gain : {'seabed', 'target', 'angle', None}
        Gain added to levels: see `mitsonar.imaging.gain`.
    fill : float or None [m]
        Pings farther apart leave a hole. None: four cells, or twice the distance of pings if that is longer.
    nadir_deg : float [degrees]
        Ground seen at a smaller angle from the vertical is left empty.
    crs : str or None
        Coordinate system of the map, such as "EPSG:32632". None: that of the first record. It also applies to records
        without a system.

    Returns
    -------
    xarray.Dataset
        The quantity over (y, x), from north to south; empty cells are NaN, or ``nodata`` (an attribute) for integers.
        Coordinates are the eastings and northings of the middles of cells [m]. Attributes: ``crs``, ``cell``, the
        options, the ``files`` of the records, and the ``names`` of the numbers of labels and classes.

    Raises
    ------
    ValueError
        If a record is not a sidescan, lacks the quantity or numbers its labels differently from the first; if an option
        or a coordinate system is unknown, the system is not in metres, or only some records name a system and none is
        given; or if the map would be too large.

    Examples
    --------
    ``chart = mitsonar.imaging.mosaic([mitsonar.read("north.exr"), mitsonar.read("south.exr")], cell=0.25)``
    """
    lines = [records] if isinstance(records, xr.Dataset) else list(records)
    options = {"place": place, "blend": blend, "gain": gain, "nadir_deg": nadir_deg}
    check(lines, quantity, options)
    crs = common_system(lines, crs)
    swaths = [MosaicSwath.of(line, crs, place, float(np.deg2rad(nadir_deg))) for line in lines]
    cell = _cell(swaths, cell)
    if fill is None:
        fill = max(4 * cell, 2 * max(swath.spacing for swath in swaths))
    elif not 0 <= fill < np.inf:
        raise ValueError(f"fill is {fill:g} m; give a length of 0 or more.")
    fill = float(fill)
    mixed = lines[0][quantity].dtype.kind == "f"
    cells = MosaicCells(grid=_grid(swaths, cell), blend=blend, mixed=mixed)
    _sum_up(cells, [MosaicLine(swath=swath, quantity=quantity, gain=gain) for swath in swaths], fill)
    used = {**options, "blend": blend if mixed else "nearest", "gain": gain if quantity in LEVELS else None}
    attributes = {"crs": crs, "cell": cell, "fill": fill, **used, "names": lines[0].attrs.get(NAMES.get(quantity, "")),
                  "files": [line.attrs.get("file") for line in lines]}
    return _trimmed(_dataset(cells, lines[0][quantity], quantity, attributes), quantity)


def _sum_up(cells, lines, fill):
    if cells.looks_first:
        for line in lines:
            for places, ranges, _ in samples(line, cells.grid.cell, fill, with_values=False):
                cells.see(places, ranges)
    for line in lines:
        for places, ranges, values in samples(line, cells.grid.cell, fill, with_values=True):
            cells.add(places, ranges, values, line.swath.reach)


def _dataset(cells, like, quantity, attributes):
    attrs = {"units": like.attrs.get("units", "1"), "long_name": like.attrs.get("long_name", quantity)}
    if cells.mixed:
        values = cells.means()
        values = (db_from_power(values) if quantity in LEVELS else values).astype(np.float32)
    else:
        attrs["nodata"] = int(np.iinfo(like.dtype).max)
        values = cells.nearest(attrs["nodata"]).astype(like.dtype)
    return xr.Dataset({quantity: (("y", "x"), values, attrs)},
                      {"y": ("y", cells.grid.y, {"units": "m", "long_name": "northing"}),
                       "x": ("x", cells.grid.x, {"units": "m", "long_name": "easting"})}, attributes)


def _cell(swaths, cell):
    if cell is None:
        least = max(max(swath.bin_width, swath.spacing) for swath in swaths)
        power = 10.0 ** np.floor(np.log10(least))
        return float(f"{power * NICE[np.searchsorted(NICE, least / power - 1e-6)]:.3g}")
    if not 0 < cell < np.inf:
        raise ValueError(f"the side of a cell is {cell:g} m; give a length above 0, such as 0.25.")
    return float(cell)


def _grid(swaths, cell):
    bounds = np.array([swath.bounds() for swath in swaths])
    west, south, east, north = *bounds[:, :2].min(0), *bounds[:, 2:].max(0)
    check_cells((east - west, north - south), cell, MOST_CELLS, instead=", or fewer lines")
    work = sum(swath.record.sizes["ping"] * 2 * swath.reach / min(FINEST * cell, swath.bin_width)
               * (1 + swath.spacing / (FINEST * cell)) for swath in swaths)
    if not work <= MOST_SAMPLES:
        raise ValueError(f"so many pings and ranges in cells of {cell:g} m take {work:.2g} samples, more than "
                         f"{MOST_SAMPLES:.2g}; take larger cells.")
    return MapGrid.over((west, south, east, north), cell)


def _trimmed(chart, quantity):
    """Return the part of a map with values."""
    values = chart[quantity].values
    there = np.isfinite(values) if values.dtype.kind == "f" else values != chart[quantity].attrs["nodata"]
    rows, columns = np.flatnonzero(there.any(1)), np.flatnonzero(there.any(0))
    if not rows.size:
        raise ValueError("no bin of the records has a place on the bed: their altitudes or ranges do not reach it.")
    return chart.isel(y=slice(rows[0], rows[-1] + 1), x=slice(columns[0], columns[-1] + 1))
