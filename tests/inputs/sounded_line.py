"""A line of soundings made by hand: exact eigenrays out and back between moving arrays and a bed."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.reduction import Installation, Measured
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water import SoundSpeedProfile

SUMMER = SoundSpeedProfile([0, 5, 11.2, 20, 30, 50, 60, 70, 90, 120],
                           [1500, 1502, 1490, 1489, 1488, 1480, 1470, 1468, 1466, 1465])
HEAD = SUMMER.at(5.3)


@dataclass(frozen=True, kw_only=True)
class Line:
    """What was measured, by what, and where the soundings are: places (..., 3) east, north, depth."""

    measured: Measured
    motion: PlatformMotion
    installation: Installation
    profile: SoundSpeedProfile
    places: np.ndarray


def rocking(time: np.ndarray, still: bool = False) -> PlatformMotion:
    """A vessel under way at 5.8 m/s, rocking in 4.8, 6.3 and 9 s."""
    rock = 0.0 if still else 1.0
    return PlatformMotion(time=time, x=3 * time, y=5 * time, depth=5 + rock * 0.5 * np.sin(time),
                  roll=rock * 0.1 * np.sin(1.3 * time), pitch=rock * 0.05 * np.cos(time),
                  heading=1 + rock * 0.03 * np.sin(0.7 * time))


ARMS = Installation(transmit_offset=(4, 0.5, 0.3), receive_offset=(-3, -0.8, 0.35),
                    transmit_mounting=(0.01, 0.005, 0.02), receive_mounting=(0.02, -0.01, -0.015))


def sounded(places: np.ndarray, sent: np.ndarray, motion: PlatformMotion, installation: Installation = ARMS,
            profile: SoundSpeedProfile = SUMMER, head: float = HEAD) -> Line:
    """Measure places (..., 3) exactly: fixed points of the reception's time, by `eigenray`."""
    out = motion.at(sent)
    out_time, out_slowness = _leg(out.carried(installation.transmit_offset), places, profile)
    time = 2 * out_time
    for _ in range(8):             # the platform moves 250 times slower than sound: 1e-19 of the way is left
        back = motion.at(sent + time)
        back_time, back_slowness = _leg(back.carried(installation.receive_offset), places, profile)
        time = out_time + back_time
    angles = [np.arcsin(head * (pose.turned(axis) * slowness).sum(-1)) for pose, axis, slowness in (
        (out, installation.transmit_axis, out_slowness), (back, installation.receive_axis, back_slowness))]
    measured = Measured(ping_time=sent, transmit_time=sent, travel_time=time, transmit_angle=angles[0],
                        angle=angles[1], head_sound_speed=head)
    return Line(measured=measured, motion=motion, installation=installation, profile=profile, places=places)


def _leg(start, end, profile):
    """Time and slowness (..., 3) at the start of the ray to the end."""
    way = end - start
    level = np.hypot(way[..., 0], way[..., 1])
    ray = eigenray(profile, start[..., 2], end[..., 2], level)
    across = ray.ray_parameter / np.maximum(level, 1e-12)
    down = np.sin(ray.launch_angle) / profile.at(start[..., 2])
    return ray.travel_time, np.stack([across * way[..., 0], across * way[..., 1], down], -1)


def swath(motion: PlatformMotion, sent: np.ndarray, across: np.ndarray, along: np.ndarray,
          depth: np.ndarray) -> np.ndarray:
    """Places (..., 3) across and along track of a vessel when it sends."""
    pose = motion.at(sent)
    sine, cosine = np.sin(pose.heading), np.cos(pose.heading)
    return np.stack([pose.place[..., 0] + across * cosine + along * sine,
                     pose.place[..., 1] - across * sine + along * cosine, np.broadcast_to(depth, across.shape)], -1)


def recorded(line: Line) -> xr.Dataset:
    """Make the record of a line."""
    measured, motion, arms = line.measured, line.motion, line.installation
    pings, beams = measured.travel_time.shape
    then = motion.at(measured.ping_time[:, 0])
    x, y, depth = np.moveaxis(line.places, -1, 0)
    east, north = x - then.place[:, :1], y - then.place[:, 1:2]
    sine, cosine = np.sin(then.heading)[:, None], np.cos(then.heading)[:, None]
    values = {**{f"motion_{name}": getattr(motion, name)
                 for name in ("time", "x", "y", "depth", "roll", "pitch", "heading")},
              **{name: getattr(arms, name) for name in ("transmit_offset", "receive_offset", "transmit_mounting",
                                                        "receive_mounting")},
              "cast_depth": line.profile.depth, "cast_sound_speed": line.profile.sound_speed,
              "ping_time": measured.ping_time[:, 0], "ping_x": then.place[:, 0], "ping_y": then.place[:, 1],
              "ping_depth": then.place[:, 2], "ping_roll": then.roll, "ping_pitch": then.pitch,
              "ping_heading": then.heading, "head_sound_speed": measured.head_sound_speed[:, 0],
              "valid": np.ones((pings, beams)), "travel_time": measured.travel_time, "angle": measured.angle,
              "transmit_angle": measured.transmit_angle, "sector": np.zeros((pings, beams)), "depth": depth, "x": x,
              "y": y, "across_track": east * cosine - north * sine, "along_track": east * sine + north * cosine}
    sector = {"frequency": 300e3, "delay": 0.0, "angle": 0.0, "pulse_length": 1e-4, "bandwidth": 1e4,
              "source_level_db": 210.0, "absorption_db": 0.07}
    values.update({f"sector_{name}": np.full((pings, 1), value) for name, value in sector.items()})
    return xr.Dataset({name: variable(name, value) for name, value in values.items()},
                      attrs={"sonar": "multibeam", "crs": None, "title": "by hand"})
