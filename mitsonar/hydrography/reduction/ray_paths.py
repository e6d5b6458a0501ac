"""Ray paths of beams: directions from two cones, and rays through the layers of a profile.

The ray of a beam (`mitsonar.sonar.arrays.cones`) keeps its horizontal slowness p = |l_h| / c_h, with l_h the horizontal
part of its direction and c_h the sound speed of the head's own sensor. Rays through layers are those of `legs`.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.device.rotations import mounted
from mitsonar.sonar.arrays.cones import cone_directions
from mitsonar.water.profile import SoundSpeedProfile

from .legs import Starts, crossed

ATTITUDE = ("ping_time", "ping_heading", "receive_mounting", "motion_time", "motion_roll", "motion_pitch",
            "motion_heading")      # variables that `receiving_axes` uses; below, those of `head_of`
HELD = ("ping_roll", "ping_pitch", "ping_depth", "transmit_offset", "receive_offset", "transmit_mounting",
        "receive_mounting", "head_sound_speed", "cast_depth", "cast_sound_speed")
SEVERAL = ("head", "head_receive_offset", "head_receive_mounting")         # of several heads

STEPS = 240                        # layers below the head, in addition to those of the profile


@dataclass(frozen=True, kw_only=True)
class RayHead:
    """Arrays in one ping, in level axes along the heading: forward, starboard, down."""

    depth: float  # [m]: of the midpoint of the arrays
    across: float  # [m]: of the midpoint, to starboard of the reference point
    sound_speed: float  # [m/s]: by the head's own sensor
    transmit: np.ndarray  # (3,): unit vector along the transmit array at the transmission
    receive: np.ndarray  # (3,): unit vector along the receive array at the transmission


def head_of(line: xr.Dataset, ping: int) -> RayHead:
    """Return position and axes of the arrays in a ping."""
    record = _with_head(line[[name for name in (*HELD, *SEVERAL) if name in line]].isel(ping=ping))
    held = float(record["ping_roll"]), float(record["ping_pitch"]), 0.0
    middle = _turned(0.5 * (record["transmit_offset"].values + record["receive_offset"].values), *held)
    along = [_turned(_mounting(record, name), *held) for name in ("transmit", "receive")]
    speed = float(record["head_sound_speed"])
    if not speed > 0:
        speed = float(np.interp(0.0, record["cast_depth"].values, record["cast_sound_speed"].values))
    return RayHead(depth=float(np.nan_to_num(record["ping_depth"])) + float(middle[2]), across=float(middle[1]),
                   sound_speed=speed, transmit=along[0], receive=along[1])


def _with_head(ping: xr.Dataset) -> xr.Dataset:
    """Return a ping with the receive array of its own head, if the line has several heads."""
    if not set(SEVERAL) <= set(ping):
        return ping
    head = int(np.clip(ping["head"], 0, ping.sizes["receive_head"] - 1))
    return ping.assign({name: ping[f"head_{name}"][head] for name in ("receive_offset", "receive_mounting")})


def _turned(vector: np.ndarray, roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> np.ndarray:
    """Return a vector (3,) of a frame at angles (...) in the outer frame (..., 3); unknown values count as 0."""
    roll, pitch, heading = (np.nan_to_num(np.asarray(angle, float)) for angle in (roll, pitch, heading))
    return mounted(np.nan_to_num(vector), roll, pitch, heading)


def _mounting(line: xr.Dataset, name: str) -> np.ndarray:
    """Return the direction (3,) along the transmit or the receive array in the body."""
    return _turned(np.eye(3)[("transmit", "receive").index(name)], *line[f"{name}_mounting"].values)


def receiving_axes(line: xr.Dataset, ping: int, head: RayHead, time: np.ndarray) -> np.ndarray:
    """Return the directions of the receive array when echoes return."""
    # time (N,) [s] -> (N, 3)
    when = float(line["ping_time"][ping]) + time
    clock = line["motion_time"].values
    angles = [line[f"motion_{name}"].values for name in ("roll", "pitch", "heading")]
    known = np.isfinite([clock, *angles]).all(0)
    axes = np.broadcast_to(head.receive, (time.size, 3)).copy()
    if not known.any():
        return axes
    clock, angles = clock[known], [values[known] for values in angles]
    north = float(np.nan_to_num(line["ping_heading"][ping]))
    inside = (when >= clock[0]) & (when <= clock[-1])
    roll, pitch, heading = (np.interp(when[inside], clock, values) for values in (*angles[:2], np.unwrap(angles[2])))
    record = _with_head(line[[name for name in (*ATTITUDE, *SEVERAL) if name in line]].isel(ping=ping))
    axes[inside] = _turned(_mounting(record, "receive"), roll, pitch, heading - north)
    return axes


def launches(head: RayHead, angle: ArrayLike, transmit_angle: ArrayLike,
             receive: np.ndarray | None = None) -> np.ndarray:
    """Return the directions of beams at the head."""
    # angle, transmit_angle (N,) [rad]; receive (N, 3) -> (N, 3)
    received, sent = np.sin(np.asarray(angle, float)), np.sin(np.nan_to_num(np.asarray(transmit_angle, float)))
    return cone_directions(head.transmit, head.receive if receive is None else receive, sent, received)


def used_profile(line: xr.Dataset, head: RayHead) -> SoundSpeedProfile:
    """Return the profile that reduced the soundings of a ping: the cast with the head's own speed as a node.

    A head below the cast's last node adds no node (`mitsonar.hydrography.reduction.legs`).
    """
    profile = _profile(line, "cast")
    try:
        return profile.with_node(head.depth, head.sound_speed)
    except ValueError:
        return profile


def water_profile(line: xr.Dataset) -> SoundSpeedProfile | None:
    """Return the true profile of the water, or None if the line has none."""
    return _profile(line, "true_cast") if {"true_cast_depth", "true_cast_sound_speed"} <= set(line) else None


def _profile(line: xr.Dataset, name: str) -> SoundSpeedProfile:
    depth, speed = line[f"{name}_depth"].values, line[f"{name}_sound_speed"].values
    known = np.isfinite(depth) & np.isfinite(speed)
    return SoundSpeedProfile(depth[known], speed[known])


def ray_places(profile: SoundSpeedProfile, depth: float, slowness: np.ndarray,
               time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return horizontal distances and depths of downward rays after given times."""
    # depth [m]; slowness (N,) [s/m]; time (N, T) [s] -> away, depth (N, T) [m]
    starts = Starts(profile=profile, depth=np.full(time.size, float(depth)))
    slowness = np.repeat(slowness, time.shape[1])
    below = starts.depth_after(slowness, time.ravel())
    return (slowness * starts.to_depth(slowness, below).stretch).reshape(time.shape), below.reshape(time.shape)


def layer_sums(profile: SoundSpeedProfile, depth: float, slowness: np.ndarray,
               longest: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return depths (D,) within reach of a time [s], and distances and times (N, D) there, NaN past a turn."""
    reach = depth + max(1.01 * longest * float(profile.sound_speed.max()), 1e-3)
    nodes = profile.depth[(profile.depth > depth) & (profile.depth < reach)]
    edges = np.unique(np.concatenate([np.linspace(depth, reach, STEPS), nodes]))
    speed = profile.at(edges)
    stretch, _, time, _ = crossed(slowness[:, None], np.diff(edges), speed[:-1], speed[1:])
    before = np.zeros((slowness.size, 1))
    return (edges, np.cumsum(np.hstack([before, slowness[:, None] * stretch]), axis=1),
            np.cumsum(np.hstack([before, time]), axis=1))


def misplaced(true: SoundSpeedProfile, used: SoundSpeedProfile, head_depth: float, bed: float, slowness: np.ndarray,
              head_speed: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and depths (N,) [m] of soundings of a level bed that are reduced with a wrong profile.

    A ray of slowness p reaches the bed in the true water after t(p). Its sounding is placed where a ray of the same p
    is after t(p) in the used profile, which may have a measured speed at the head as a node.
    """
    # head_depth, bed [m]; slowness (N,) [s/m]; head_speed [m/s]
    head = np.full(slowness.shape, float(head_depth))
    time = Starts(profile=true, depth=head).to_depth(slowness, np.full(slowness.shape, float(bed))).time
    starts = Starts(profile=used, depth=head,
                    head_speed=None if head_speed is None else np.full(slowness.shape, head_speed))
    depth = starts.depth_after(slowness, time)
    return slowness * starts.to_depth(slowness, depth).stretch, depth


def refraction_error(used: SoundSpeedProfile, water: SoundSpeedProfile, head: RayHead, bed: float,
                     angle: np.ndarray) -> np.ndarray:
    """Return the depth errors of soundings of a level bed (`misplaced`), interpolated at angles from the vertical."""
    # bed [m]; angle (N,) [rad] -> (N,) [m]
    way, depth = misplaced(water, used, head.depth, bed, np.linspace(0.0, 0.999, 400) / head.sound_speed)
    straight = np.arctan2(way, depth - head.depth)
    known = np.isfinite(straight)
    if not known.any():
        return np.full(angle.shape, np.nan)
    order = np.argsort(straight[known])
    return np.interp(np.abs(angle), straight[known][order], (depth - bed)[known][order], right=np.nan)
