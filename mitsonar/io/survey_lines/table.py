"""Write a line of soundings as CSV: one sounding a row, units in the header.

Angles are degrees, times of day UTC. Eastings and northings are written if the scene has a coordinate system, latitudes
and longitudes also if a place is given. Soundings without a position are left out.
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.files import FilePath, replacing
from mitsonar.hydrography.record import VARIABLES

from .clouds import ONLY_SOUNDINGS, cloud, of_soundings
from .lines import NO_SYSTEM, Blocks, Place, Written, line_of

UNITS = {"rad": "deg", "1": "", "dB re 1": "dB", "dB re 1 µPa": "dB"}
DECIMALS = {"m": 4, "s": 9, "deg": 5, "dB": 3}
EARTH = {"easting": ("m", 4), "northing": ("m", 4), "latitude": ("deg", 9), "longitude": ("deg", 9)}


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as CSV; arguments, result and errors are those of `mitsonar.io.survey_lines.write`."""
    import pandas as pd

    line, remaining = line_of(blocks, place=place, start=start)
    georeferenced = bool(line.first.attrs.get("crs"))
    names = of_soundings(line)
    earth = [name for name in EARTH if georeferenced or (place is not None and name in ("latitude", "longitude"))]
    number = valid = 0
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(",".join(["time [UTC]", "ping", "beam", *(_titled(name, EARTH[name][0]) for name in earth),
                               *(_titled(name, _unit(name)) for name in names)]) + "\n")
        for block in remaining:
            rows = []
            for soundings in cloud(line, block, number):
                time = np.rint(soundings["since"] * 1e6).astype("int64").view("datetime64[us]")
                columns = {"time": np.datetime_as_string(time, "us"), "ping": soundings["ping"],
                           "beam": soundings["beam"]}
                columns |= {name: np.round(soundings[name], EARTH[name][1]) for name in earth}
                rows.append(pd.DataFrame(columns | {name: _plain(name, soundings[name]) for name in names}))
                valid += int(soundings["valid"].sum())
            pd.concat(rows).to_csv(stream, index=False, header=False)
            number += block.sizes["ping"]
    return Written(pings=number, soundings=valid, words=(*(() if georeferenced else (NO_SYSTEM,)), ONLY_SOUNDINGS))


def _unit(name):
    unit = VARIABLES[name].unit
    return UNITS.get(unit, unit)


def _titled(name, unit):
    return f"{name} [{unit}]" if unit else name


def _plain(name, values):
    """Return values as written: whole numbers, or rounded in the unit of the header."""
    if values.dtype.kind != "f":
        return values.astype(int)
    converted = np.degrees(values) if VARIABLES[name].unit == "rad" else values
    return np.round(converted.astype(float), DECIMALS.get(_unit(name), 6))
