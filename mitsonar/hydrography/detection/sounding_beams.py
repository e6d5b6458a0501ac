"""Convert soundings to single rays of known slowness, which do not depend on a sound-speed profile.

An array measures the slowness along it, which Snell's law preserves down to the bed, and a time. Both follow from the
reduced place B of a sounding through the cast of its reduction. For the ray from the point M midway between the
transmit array at transmission and the receive array at reception:

    X(p) = |B - M| in the plane,        t = 2 T(p)

Through another cast the same p and t lead to another place, as in `reduction`. One ray stands for both legs of a
sounding: its place in other water is that of `resounded` to a few millimetres.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import xarray as xr

from ..record import check
from ..reduction.attitude import PlatformMotion
from ..reduction.legs import Starts
from ..reduction.resounding import heads_of, installation_of, measured_of, parts_of, profile_of

STEPS = 60
CLOSE = 1e-9                       # [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class SoundingBeams:
    """Beams of N soundings, and the times of their echoes.

    Parameters
    ----------
    x, y, depth : array (N,) [m]
        Start of the rays: east, north, below the surface.
    east, north : array (N,)
        Unit vector of the rays' horizontal direction.
    slowness : array (N,) [s/m]
        Horizontal slowness, not negative: cosine of the grazing angle over the sound speed, constant along the ray.
    travel_time : array (N,) [s]
        Two-way time to the bed.
    head_speed : array (N,) [m/s]
        Sound speed at the rays' start, by the head's own sensor.
    starboard : array (N,)
        Cosine of the angle between direction and starboard, the rate at which roll of the array steepens the beam.

    Raises
    ------
    ValueError
        If there is no sounding, shapes differ, or a value is out of range.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    east: np.ndarray
    north: np.ndarray
    slowness: np.ndarray
    travel_time: np.ndarray
    head_speed: np.ndarray
    starboard: np.ndarray

    def __post_init__(self):
        count = np.size(self.travel_time)
        for one in fields(self):
            values = np.atleast_1d(np.asarray(getattr(self, one.name), float))
            object.__setattr__(self, one.name, values)
            if values.shape != (count,) or not count:
                raise ValueError(f"beams: {one.name} has the shape {values.shape}; give one number for each of the "
                                 f"{count} travel times, and at least one.")
            if not np.isfinite(values).all():
                raise ValueError(f"beams: {one.name} holds {values[~np.isfinite(values)][0]}; leave soundings out that "
                                 "have no number.")
        for name, bad, wanted in (
                ("travel_time", self.travel_time <= 0, "a time is more than 0 s"),
                ("slowness", (self.slowness < 0) | (self.slowness * self.head_speed >= 1),
                 "it is from 0 to 1 over the head's sound speed"),
                ("east", np.abs(np.hypot(self.east, self.north) - 1) > 1e-6, "(east, north) is a unit vector")):
            if bad.any():
                raise ValueError(f"beams: {name} holds {getattr(self, name)[bad][0]:g}; {wanted}.")

    def __len__(self) -> int:
        return len(self.travel_time)

    def __getitem__(self, some: np.ndarray | slice) -> SoundingBeams:
        return SoundingBeams(**{one.name: getattr(self, one.name)[some] for one in fields(self)})


def beams_of(soundings: xr.Dataset, under_way: bool = True) -> SoundingBeams:
    """Return the beams of the valid soundings of a line."""
    check(soundings)
    motion, measured, profile = PlatformMotion.of(soundings), measured_of(soundings), profile_of(soundings)
    shape = soundings["valid"].shape
    start, bed = np.full((*shape, 3), np.nan), np.stack([soundings[name].values for name in ("x", "y", "depth")], -1)
    for number, pings in heads_of(soundings):
        installed = installation_of(soundings, number)
        sent, received = (motion.at(measured.transmit_time[pings] + part * measured.travel_time[pings])
                          for part in (0, 1))
        if not under_way:
            received.place[..., :2] = sent.place[..., :2]
        receiver = received.carried(np.asarray(installed.receive_offset))
        for part, some in parts_of(soundings, pings):
            middle = 0.5 * (sent.carried(installed.transmit_offset + part) + receiver)
            start[pings] = np.where(some[..., None], middle, start[pings])
    head = np.broadcast_to(soundings["head_sound_speed"].values[:, None], shape)
    heading = np.broadcast_to(soundings["ping_heading"].values[:, None], shape)
    valid = soundings["valid"].values & np.isfinite(start + bed).all(-1) & (bed[..., 2] > start[..., 2])
    start, bed, head, heading = start[valid], bed[valid], head[valid], heading[valid]
    away = bed[:, :2] - start[:, :2]
    distance = np.hypot(*away.T)
    slowness, time = slowness_to(Starts(profile=profile, depth=start[:, 2], head_speed=head), bed[:, 2], distance)
    found = np.isfinite(time)
    if not found.any():
        raise ValueError(f"no ray leads to any of the {valid.sum()} valid soundings in the line's own water; check its "
                         "cast and its places.")
    east, north = np.where(distance > 0, away.T / np.maximum(distance, 1e-12), np.array([[0.0], [1.0]]))
    values = {"x": start[:, 0], "y": start[:, 1], "depth": start[:, 2], "east": east, "north": north,
              "slowness": slowness, "travel_time": 2 * time, "head_speed": head,
              "starboard": east * np.cos(heading) - north * np.sin(heading)}
    return SoundingBeams(**{name: value[found] for name, value in values.items()})


def beams_of_lines(lines: Sequence[xr.Dataset], under_way: bool = True) -> SoundingBeams:
    """Return the beams of several lines, in the frame of the first."""
    if not lines:
        raise ValueError("beams: there is no line of soundings; give one at least.")
    first, parts = lines[0].attrs, []
    for line in lines:
        if line.attrs.get("crs") != first.get("crs"):
            raise ValueError(f"beams: one line is in {first.get('crs')} and another in {line.attrs.get('crs')}; give "
                             "lines in one coordinate system.")
        beams = beams_of(line, under_way)
        shift = np.subtract(line.attrs.get("origin") or (0.0, 0.0), first.get("origin") or (0.0, 0.0))
        parts.append({**{one.name: getattr(beams, one.name) for one in fields(beams)},
                      "x": beams.x + shift[0], "y": beams.y + shift[1]})
    return SoundingBeams(**{name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def slowness_to(starts: Starts, depth: np.ndarray, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slowness [s/m] and one-way time [s] of the direct rays down to places, (N,); NaN where there is no ray."""
    height = depth - starts.depth
    fastest = np.maximum(starts.speed, starts.profile.at(depth))
    slowness = distance / np.hypot(distance, height) / fastest * (1 - 1e-6)
    low, high = np.zeros_like(slowness), 1 / fastest
    time = np.full(len(slowness), np.nan)
    rays = np.arange(len(slowness))
    for _ in range(STEPS):
        leg = starts[rays].to_depth(slowness[rays], depth[rays])
        short = distance[rays] - slowness[rays] * leg.stretch
        beyond = ~(short > 0)                                         # too far, or turned before
        low[rays], high[rays] = (np.where(beyond, low[rays], slowness[rays]),
                                 np.where(beyond, slowness[rays], high[rays]))
        done = np.abs(short) <= CLOSE * (1 + distance[rays])
        # Fermat: the time to the place follows from the time to the reached range, to second order
        time[rays] = np.where(done, leg.time + slowness[rays] * short, np.nan)
        with np.errstate(invalid="ignore", divide="ignore"):
            stepped = slowness[rays] + short / leg.slope
        inside = (stepped > low[rays]) & (stepped < high[rays])
        slowness[rays] = np.where(done, slowness[rays],
                                  np.where(inside, stepped, 0.5 * (low[rays] + high[rays])))
        rays = rays[~done]
        if not rays.size:
            break
    return slowness, time
