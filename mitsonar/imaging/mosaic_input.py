"""What a mosaic takes: sidescan records that fit together, and options that are known."""
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from .georeference import FARTHEST, named_system, system
from .mosaic_grid import BLENDS
from .mosaic_swath import PLACES

__all__ = ["GAINS", "NAMES", "check", "common_system"]

GAINS = ("seabed", "target", "angle", None)
NAMES = {"label": "labels", "object_shadow": "labels", "class": "classes"}      # attributes with the numbers' names
NEEDED = ("ping_time", "x", "y", "heading", "pitch", "altitude")


def check(lines: Sequence[xr.Dataset], quantity: str, options: Mapping[str, Any]) -> None:
    """Check what `mosaic` is given; ``options`` are its place, blend, gain and nadir_deg.

    Raises
    ------
    ValueError
        As `mosaic`.
    """
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
    """Give the map's coordinate system: the one that is asked for, else the first record's, which may name none.

    Raises
    ------
    ValueError
        If a system is unknown or not in metres, or only some of the records name one and none is asked for.
    """
    if crs is not None:
        return named_system(crs)
    named = {system(line.attrs) for line in lines}
    if len(named) > 1 and None in named:
        raise ValueError("only some of the records name a coordinate system; say the mosaic's, such as EPSG:32632.")
    first = system(lines[0].attrs)
    return None if first is None else named_system(first)


def _check_contents(line, quantity, place):
    drawn = [str(name) for name, variable in line.data_vars.items() if set(variable.dims) == {"ping", "side", "range"}]
    if "level" not in drawn:
        raise ValueError("the record has no levels over ping, side and range; a mosaic is made of sidescans.")
    lacking = [name for name in NEEDED if name not in line.coords]
    lacking += [name for name in ("seabed_x", "seabed_y") if place == "truth" and name not in drawn]
    if lacking:
        raise ValueError(f"the record does not say its {lacking[0]}; give one as mitsonar rendered it.")
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
        raise ValueError("a record has no pings; give one or more.")
    slant_range = np.asarray(line["range"].values, float)
    steps = np.diff(slant_range) if np.isfinite(slant_range).all() else np.zeros(1)
    if not steps.size or steps.min() <= 0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError("the record's ranges are not two or more in even steps; give one as mitsonar rendered it.")
    if not all(np.isfinite(line[name].values).all() for name in ("x", "y", "heading", "pitch", "ping_time")):
        raise ValueError("the record's track has places or angles that are no numbers; render it anew.")
    if (np.diff(line["ping_time"].values) <= 0).any():
        raise ValueError("the record's pings are not one after the other in time; sort them.")
    if max(np.abs(line[axis].values).max() for axis in "xy") > FARTHEST:
        raise ValueError(f"the record's track goes beyond {FARTHEST:g} m, farther than any place on Earth.")


def _check_alike(line, first, quantity):
    if line[quantity].dtype != first[quantity].dtype:
        raise ValueError(f"the records hold {quantity} as different types; render them alike.")
    if quantity in NAMES and line.attrs.get(NAMES[quantity]) != first.attrs.get(NAMES[quantity]):
        raise ValueError(f"the records have different {NAMES[quantity]}, so that a number of theirs means several "
                         "things; lay them out one by one.")
    if quantity not in NAMES and line.attrs.get("frequency") != first.attrs.get("frequency"):
        raise ValueError(f"the records are of {_khz(first)} and {_khz(line)}, whose levels do not mix; lay them out "
                         "one by one.")


def _khz(record):
    frequency = record.attrs.get("frequency")
    return f"{frequency / 1000:g} kHz" if isinstance(frequency, (int, float)) else "no known frequency"
