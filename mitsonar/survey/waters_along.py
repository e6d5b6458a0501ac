"""Water of a run's pings from several casts: their times or places, compared with those of the track."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.io.casts.series import PlacedCast
from mitsonar.scene.geometry import Geometry
from mitsonar.water.along_line import along_track, between, latest, mixed_columns, nearest, steps_between
from mitsonar.water.waters import FoundWater, WaterColumn, Waters

from .voyage import Passage

FAR = 500_000.0                    # [m] from the track beyond which a cast is from another sea
DATED = 1e8                        # [s] above which times count from 1970


class ChangingWater(Protocol):
    """Casts of a medium, and the rule by which pings find theirs."""

    casts: tuple[PlacedCast, ...]
    casts_by: str | None  # "place" or "time"; None: place, or time if a cast has no place
    casts_rule: str  # "nearest", "latest" or "interpolated"
    casts_step: float  # [m/s]


def waters_along(water: ChangingWater, columns: Sequence[WaterColumn], geometry: Geometry, passage: Passage) -> Waters:
    """Return the water of the pings; `columns` are those of the casts."""
    casts, rule, track = water.casts, water.casts_rule, passage.voyage.track
    by = water.casts_by or ("place" if all(one.place is not None for one in casts) else "time")
    if rule == "latest" and by == "place":
        raise ValueError('casts_rule is "latest", but the casts are found by their places; write casts_by time, or '
                         'casts_rule nearest.')
    marks = _places(casts, geometry, passage) if by == "place" else _times(casts, track.time)
    along = track.position[:, :2] if by == "place" and rule == "interpolated" else None
    if along is not None:
        marks = along_track(along, marks)[1]
    if rule != "nearest":
        order = np.argsort(marks, kind="stable")
        casts, columns, marks = [casts[k] for k in order], [columns[k] for k in order], marks[order]
        if (same := np.flatnonzero(np.diff(marks) <= 0)).size:
            pair = " and ".join(casts[same[0] + k].name for k in (0, 1))
            raise ValueError(f'the casts {pair} lie at the same {"time" if by == "time" else "place along the track"}; '
                             'leave one out, or write casts_rule nearest.')
    steps = np.zeros(0)
    if rule == "interpolated":
        steps = steps_between([one.cast.profile for one in casts], water.casts_step)
    line = CastLine(columns=columns, by=by, rule=rule, marks=marks, steps=steps, along=along)
    at = track.position[:, :2] if by == "place" else track.time
    number, share = line.at(at if along is None else along_track(along, marks[:0])[0])
    used, numbers = mixed_columns(columns, number, share)
    stated = {"casts": [one.name for one in casts], "casts_by": by, "casts_rule": rule,
              "cast_of_ping": [round(float(value), 6) for value in number + share]}
    return Waters(columns=used, numbers=None if len(used) == 1 else numbers, attributes=stated, elsewhere=line.water)


@dataclass(frozen=True, kw_only=True, eq=False)
class CastLine:
    """Casts at their marks, and the rule by which pings find theirs."""

    columns: Sequence[WaterColumn]
    by: str
    rule: str
    marks: np.ndarray  # (C, 2) [m], (C,) [m] along a track, or (C,) [s]
    steps: np.ndarray  # (C - 1,): between neighbours, of interpolated water
    along: np.ndarray | None  # (P, 2) [m]: track along which marks lie

    def at(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers of casts (P,) and the shares of the next ones (P,) at marks of pings."""
        if self.rule == "nearest":
            at, marks = (values.reshape(len(values), -1) for values in (at, self.marks))
            return nearest(at, marks), np.zeros(len(at))
        if self.rule == "latest":
            return latest(at, self.marks), np.zeros(len(at))
        return between(at, self.marks, self.steps)

    def water(self, time: float, place: np.ndarray) -> FoundWater:
        """Return the water of a time [s] and place (2,) [m]."""
        at = np.array([time]) if self.by == "time" else place[None]
        if self.along is not None:
            at = along_track(self.along, at)[1]
        number, share = self.at(at)
        return FoundWater((int(number[0]), float(share[0])), lambda: mixed_columns(self.columns, number, share)[0][0],
                          {"cast_of_ping": [round(float(number[0] + share[0]), 6)]})


def frame_of(geometry: Geometry, passage: Passage) -> Frame | None:
    """Return the place of a scene on Earth, by its bathymetry or its track; None if neither has one."""
    if geometry.local_origin is None:
        return passage.frame
    easting, northing = geometry.local_origin[:2]
    return Frame(crs=geometry.crs or "", origin=(float(easting), float(northing)))


def _places(casts: Sequence[PlacedCast], geometry: Geometry, passage: Passage) -> np.ndarray:
    """Return the places of casts in the scene (C, 2) [m]."""
    without = [one.name for one in casts if one.place is None]
    if without:
        raise ValueError(f"the cast {without[0]} has no place; write casts_by time, or a list of casts with x and y, "
                         "or latitude and longitude.")
    places, track = np.array([one.place or (np.nan, np.nan) for one in casts]), passage.voyage.track.position[:, :2]
    degrees = np.array([one.geographic for one in casts])
    if degrees.any():
        frame = frame_of(geometry, passage)
        if frame is None:
            raise ValueError(f"the cast {casts[int(np.argmax(degrees))].name} is given by latitude and longitude, but "
                             "the scene has no place on Earth; give the sonar an origin, or the casts x and y.")
        places[degrees] = frame.places(*places[degrees].T)
    for one, place in zip(casts, places):
        away = np.hypot(*(track - place).T).min()
        if not away <= FAR:
            where = ("{:.4f} N, {:.4f} E" if one.geographic else "x = {:.0f} m, y = {:.0f} m").format(*one.place or ())
            raise ValueError(f"the cast {one.name}, at {where}, is {away / 1000:.0f} km from the track, in another "
                             "sea; leave it out, or check its latitude and longitude.")
    return places


def _times(casts: Sequence[PlacedCast], time: np.ndarray) -> np.ndarray:
    """Return the times of casts (C,) [s] by the clock of the track."""
    without = [one.name for one in casts if one.time is None]
    if without:
        raise ValueError(f"the cast {without[0]} has no time; write casts_by place, or a list of casts with their "
                         "times.")
    times = np.array([one.time for one in casts])
    dated = bool(time[0] > DATED)
    if (odd := (times > DATED) != dated).any():
        raise ValueError(f"the cast {casts[int(np.argmax(odd))].name} has {'no date' if dated else 'a date'}, but the "
                         f"times of the track {'are dates' if dated else 'begin at ' + format(time[0], 'g') + ' s'}; "
                         f"give {'the casts dates' if dated else 'the track dates'}, or write casts_by place.")
    return times
