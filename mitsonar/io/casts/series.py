"""Several casts with their times or places: for water that changes along a survey line.

    a folder        every file in it is a cast, in the order of names
    one file        that holds several casts, such as a CARIS SVP; or a recorded line, .all, .kmall, .gsf or .s7k
    a list          a CSV file with the column ``file``; ``time``, ``x`` and ``y``, or ``latitude`` and ``longitude``

A list gives times and places to files that state none. Its names are looked for beside the list. Its times are dates
(ISO 8601) or seconds of the track's clock, its x and y metres in the scene.
"""
from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath, check_readable
from mitsonar.water.profile import SoundSpeedProfile

from ..scene_files import tables
from .records import Cast

MOST = 10_000                      # casts of a series
FARTHEST_SPEED = 50.0              # [m/s] between the means of neighbours, over the depths that both have
PLACES = (("x", "y"), ("latitude", "longitude"))


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedCast:
    """A cast of several, with its time and place."""

    name: str  # of its file, with its number if the file holds several
    cast: Cast
    time: float | None = None  # [s]: since 1970, UTC, or by the clock of a track without dates
    place: tuple[float, float] | None = None  # x, y [m] in the scene, or latitude and longitude [degrees]
    geographic: bool = False  # True if `place` is in degrees


def read_series(path: FilePath, read: Callable[..., Cast]) -> tuple[PlacedCast, ...]:
    """Return the casts of a folder, file, line or list; `read` returns the cast of a file and of a section."""
    path = Path(path)
    if path.is_dir():
        names = sorted(name for name in os.listdir(path) if not name.startswith(".") and (path / name).is_file())
        if not names:
            raise ValueError(f"the folder {path} holds no casts; put the files of casts into it.")
        series = [one for name in names for one in _of_file(path / name, read)]
    else:
        check_readable(path, "the casts", "a folder, a list or a file of casts")
        series = _listed(path, read) if is_list(path) else _of_file(path, read)
    if len(series) > MOST:
        raise ValueError(f"{path} has {len(series)} casts, more than {MOST}; thin them out.")
    _check_neighbours(path, series)
    return tuple(series)


def _of_file(path: Path, read: Callable[..., Cast]) -> list[PlacedCast]:
    """Return the casts of one file."""
    from ..survey_lines import reading  # which takes its time, and few scenes need it

    with open(path, "rb") as stream:
        if reading.recognised(stream.read(8)) is not None:
            return _of_line(path)
    first = read(path, 0)
    rest = [read(path, section) for section in range(1, first.sections)]
    return [_placed(f"{path.name}:{number}" if rest else path.name, cast) for number, cast in enumerate((first, *rest))]


def _placed(name, cast):
    """Return a cast with the time and place that its file states."""
    place = None if cast.latitude is None or cast.longitude is None else (cast.latitude, cast.longitude)
    return PlacedCast(name=name, cast=cast, time=None if cast.time is None else cast.time.timestamp(), place=place,
                      geographic=place is not None)


def _of_line(path: Path) -> list[PlacedCast]:
    """Return the casts of a recorded line."""
    from ..survey_lines import reading

    casts = reading.line_casts(path)
    if not casts:
        raise ValueError(f"the line {path} holds no cast; give the casts themselves.")
    return [PlacedCast(name=f"{path.name}:{number}",
                       cast=Cast(profile=SoundSpeedProfile(*one.nodes.T), format="recorded line"),
                       time=one.time, place=one.place, geographic=one.place is not None)
            for number, one in enumerate(casts)]


def is_list(path: Path) -> bool:
    """Return True if the first line of a text file names the column `file`."""
    with open(path, "rb") as stream:
        for line in stream.read(4096).splitlines():
            if (text := line.decode("utf-8-sig", "replace").strip()) and not text.startswith("#"):
                divider = max(",;\t", key=text.count)
                return "file" in (field.strip().strip('"').lower() for field in text.split(divider))
    return False


def _listed(path: Path, read: Callable[..., Cast]) -> list[PlacedCast]:
    """Return the casts of a list."""
    names, lines, rows = tables.records(path, "list of casts")
    columns = {name: [row[k].strip() for row in rows] for k, name in enumerate(names)}
    times = tables.times(path, lines, "time", columns["time"]) if "time" in columns else None
    pair = next((pair for pair in PLACES if set(pair) <= set(columns)), None)
    if times is None and pair is None:
        raise ValueError(f"cannot read the list of casts {path}: the header has {', '.join(names)}; add time, x and y, "
                         "or latitude and longitude.")
    if times is not None and (back := np.flatnonzero(np.diff(times) <= 0)).size:
        row = back[0] + 1
        raise ValueError(f"{path}, line {lines[row]}: the time {columns['time'][row]} is not later than "
                         f"{columns['time'][row - 1]} before it; sort the casts by time and drop repeated times.")
    places = None if pair is None else np.stack([tables.floats(path, lines, name, columns[name]) for name in pair], 1)
    series = []
    for row, name in enumerate(columns["file"]):
        if not (path.parent / name).is_file():
            raise ValueError(f"{path}, line {lines[row]}: the cast {name!r} is not there; it is looked for beside the "
                             "list.")
        one = _placed(name, read(path.parent / name, 0))
        one = one if times is None else replace(one, time=float(times[row]))
        series.append(one if places is None else replace(one, place=(float(places[row, 0]), float(places[row, 1])),
                                                         geographic=pair == PLACES[1]))
    return series


def _check_neighbours(path: Path, series: Sequence[PlacedCast]) -> None:
    """Refuse a cast whose sound speeds are far from those of the cast before it."""
    for one, other in zip(series, series[1:]):
        profiles = one.cast.profile, other.cast.profile
        depth = np.linspace(max(p.depth[0] for p in profiles), max(min(p.depth[-1] for p in profiles),
                                                                  max(p.depth[0] for p in profiles)), 65)
        apart = float(np.mean(profiles[1].at(depth) - profiles[0].at(depth)))
        if abs(apart) > FARTHEST_SPEED:
            faster = "faster" if apart > 0 else "slower"
            raise ValueError(f"{path}: the cast {other.name} is {abs(apart):.0f} m/s {faster} than {one.name} before "
                             f"it, more than {FARTHEST_SPEED:g} m/s; leave out the one that is from other water.")
