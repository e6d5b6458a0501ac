"""A line of soundings as a table: one sounding a line, with units in the header.

Angles are degrees, times of day UTC. Eastings and northings stand where the scene has a coordinate system, latitudes
and longitudes there and where a place is said. Soundings without a place are left out.
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.files import FilePath, replacing
from mitsonar.hydrography.record import VARIABLES

from .clouds import ONLY_SOUNDINGS, cloud, of_soundings
from .lines import Blocks, Place, Written, line_of

UNITS = {"rad": "deg", "1": "", "dB re 1": "dB", "dB re 1 µPa": "dB"}
DECIMALS = {"m": 4, "s": 9, "deg": 5, "dB": 3}
EARTH = {"easting": ("m", 4), "northing": ("m", 4), "latitude": ("deg", 9), "longitude": ("deg", 9)}


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as CSV; arguments, result and errors as `mitsonar.io.survey_lines.write`."""
    import pandas as pd

    line, some = line_of(blocks, place=place, start=start)
    known = bool(line.first.attrs.get("crs"))
    names = of_soundings(line)
    earth = [name for name in EARTH if known or (place is not None and name in ("latitude", "longitude"))]
    number = found = 0
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(",".join(["time [UTC]", "ping", "beam", *(_titled(name, EARTH[name][0]) for name in earth),
                               *(_titled(name, _unit(name)) for name in names)]) + "\n")
        for block in some:
            rows = []
            for one in cloud(line, block, number):
                time = np.rint(one["since"] * 1e6).astype("int64").view("datetime64[us]")
                columns = {"time": np.datetime_as_string(time, "us"), "ping": one["ping"], "beam": one["beam"]}
                columns |= {name: np.round(one[name], EARTH[name][1]) for name in earth}
                rows.append(pd.DataFrame(columns | {name: _plain(name, one[name]) for name in names}))
                found += int(one["valid"].sum())
            pd.concat(rows).to_csv(stream, index=False, header=False)
            number += block.sizes["ping"]
    return Written(pings=number, soundings=found, words=(
        *(() if known else ("x and y are metres of the scene, which names no coordinate system",)), ONLY_SOUNDINGS))


def _unit(name):
    unit = VARIABLES[name].unit
    return UNITS.get(unit, unit)


def _titled(name, unit):
    return f"{name} [{unit}]" if unit else name


def _plain(name, values):
    if values.dtype.kind != "f":
        return values.astype(int)
    turned = np.degrees(values) if VARIABLES[name].unit == "rad" else values
    return np.round(turned.astype(float), DECIMALS.get(_unit(name), 6))

