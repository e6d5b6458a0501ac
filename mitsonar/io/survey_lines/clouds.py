"""Soundings one by one, as tables and point clouds have them: flat arrays of those that have a place, ping by ping."""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import VARIABLES

from .lines import LineToWrite, pings

ONLY_SOUNDINGS = ("cast, motion, arrays, sectors, water column, snippets and beams without a sounding are not in it: "
                  "write a .nc to keep them")

Cloud = dict[str, np.ndarray]              # variables of soundings by name, each (soundings,)


def cloud(line: LineToWrite, block: xr.Dataset, at: int) -> Iterator[Cloud]:
    """Return the soundings of a block's pings that have a place, valid or not."""
    names = [str(name) for name, value in block.variables.items() if value.dims == ("ping", "beam")]
    for number, ping in enumerate(pings(line, block)):
        there = np.isfinite(ping["x"]) & np.isfinite(ping["y"]) & np.isfinite(ping["depth"])
        one = {name: ping[name][there] for name in (*names, "latitude", "longitude")}
        count = int(there.sum())
        one |= {"ping": np.full(count, at + number), "beam": ping["beam"][there],
                "since": np.full(count, float(ping["since"])), "easting": one["x"] + line.frame.origin[0],
                "northing": one["y"] + line.frame.origin[1]}
        yield one


def of_soundings(line: LineToWrite) -> list[str]:
    """Name the variables that a line has of its soundings, snippets left out, in the record's order."""
    return [name for name, one in VARIABLES.items() if one.dims == ("ping", "beam") and one.group != "snippet"
            and name in line.first.variables]
