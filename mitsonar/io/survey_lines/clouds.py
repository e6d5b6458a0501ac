"""Soundings of a line as flat arrays, for tables and point clouds; soundings without a position are left out."""
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
    """Yield the soundings of each ping that have a position, valid or not; ``at`` is the number of the first ping."""
    names = [str(name) for name, value in block.variables.items() if value.dims == ("ping", "beam")]
    for number, ping in enumerate(pings(line, block, apart=True), at):
        placed = np.isfinite(ping["x"]) & np.isfinite(ping["y"]) & np.isfinite(ping["depth"])
        points = {name: ping[name][placed] for name in (*names, "latitude", "longitude", "beam")}
        count = int(placed.sum())
        yield points | {"ping": np.full(count, number), "since": np.full(count, float(ping["since"])),
                        "easting": points["x"] + line.frame.origin[0], "northing": points["y"] + line.frame.origin[1]}


def of_soundings(line: LineToWrite) -> list[str]:
    """Return the names of a line's variables of soundings without snippets, in the record's order."""
    return [name for name, variable in VARIABLES.items() if variable.dims == ("ping", "beam")
            and variable.group != "snippet" and name in line.first.variables]
