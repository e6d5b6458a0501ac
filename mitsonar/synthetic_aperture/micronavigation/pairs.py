"""Displaced phase centres: receivers of one ping at the place of receivers of the previous ping.

    C = (P_t(t) + P_r(t + τ)) / 2          the phase centre of a transmitter and a receiver
    d = (C' - C) · a                       of a pair of them from successive pings, along the array's axis a

Both echoes of a bed are alike while |d| is small compared with half an element (see `coherence.aperture_coherence`).
Delays are computed for the bed beside a pair's middle, perpendicular to the array, as the mean of two directions, ahead
and astern of abeam by the rms angle of the beam's power. Averaged over the beam, a sway s counts as
s (1 - <sin²θ> / 2 cos² g), g the grazing angle.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..focusing.poses import Poses, two_way_delay

NODES = 49                         # of delays along a line of the bed; cubics err by 1e-12 s beyond 1.05 altitudes


@dataclass(frozen=True, kw_only=True)
class Arrays:
    """Arrays in the body frame, and the water and bed below them."""

    tx: np.ndarray  # (tx, 3) [m]
    rx: np.ndarray  # (rx, 3) [m]
    bank: np.ndarray  # (rx,)
    side: float  # 1 to starboard, -1 to port
    sound_speed: float  # [m/s], one value between arrays and bed
    bed_depth: float  # [m]


@dataclass(frozen=True, kw_only=True)
class Correction:
    """Error of the navigation at the second of two pings, in the frame of the first: metres and radians."""

    surge: float = 0.0
    sway: float = 0.0
    heave: float = 0.0
    yaw: float = 0.0


def together(one: Correction, other: Correction) -> Correction:
    """Return the sum of two small corrections."""
    return Correction(surge=one.surge + other.surge, sway=one.sway + other.sway, heave=one.heave + other.heave,
                      yaw=one.yaw + other.yaw)


@dataclass(frozen=True, kw_only=True)
class PingPairs:
    """Pairs of phase centres of two successive pings."""

    first: np.ndarray  # (Q,), receivers of the first ping
    second: np.ndarray  # (Q,), receivers of the second
    apart: np.ndarray  # (Q,) [m], distance of their phase centres along the array, by navigation
    centre_first: np.ndarray  # (Q,) [m], phase centres along the array, from the first ping's body
    centre_second: np.ndarray  # (Q,) [m], the same of the second ping


def arrays_of(raw: xr.Dataset) -> Arrays:
    """Return the arrays of raw echoes and one sound speed between them and the bed: that of the mean slowness."""
    bed = float(raw.attrs["bed_depth"])
    depth, speed = (np.asarray(raw[name].values, float) for name in ("cast_depth", "cast_sound_speed"))
    inside = np.linspace(float(np.mean(raw["motion_depth"].values)), bed, 257)
    return Arrays(tx=np.asarray(raw["tx_position"].values, float), rx=np.asarray(raw["rx_position"].values, float),
                  bank=np.asarray(raw["rx_bank"].values), side=float(np.sign(raw.attrs["look"][1])) or 1.0,
                  sound_speed=float(1 / np.mean(1 / np.interp(inside, depth, speed))), bed_depth=bed)


def overlapping(poses: Poses, arrays: Arrays,
                time: np.ndarray, sender: np.ndarray,  # (2,) [s]; (2,)
                slant_range: float, reach: float | None,  # [m]
                correction: Correction) -> PingPairs:
    """Return the pairs of two pings whose phase centres are at most `reach` apart along the array."""
    delay = 2 * slant_range / arrays.sound_speed
    centres = [0.5 * (_placed(poses, arrays, time[n], time[n], arrays.tx[sender[n]], n, correction)
                      + _placed(poses, arrays, time[n], time[n] + delay, arrays.rx, n, correction)) for n in (0, 1)]
    axis = poses.rotation(time[0] + delay)[:, 0]
    along = [(centre - poses.position(time[0])) @ axis for centre in centres]
    between = along[1][None, :] - along[0][:, None]
    steps = np.diff(np.unique(np.round(arrays.rx[:, 0], 9)))
    near = reach if reach is not None else 0.375 * float(steps.min() if len(steps) else np.inf)
    first, second = np.nonzero((np.abs(between) <= near) & (arrays.bank[:, None] == arrays.bank))
    if not len(first):
        raise ValueError(f"pings at {time[0]:.3f} and {time[1]:.3f} s have no phase centres in common within "
                         f"{near:.3g} m; micronavigation needs pings that overlap: sail slower, or give overlap")
    return PingPairs(first=first, second=second, apart=between[first, second], centre_first=along[0][first],
                     centre_second=along[1][second])


def ground_points(poses: Poses, arrays: Arrays, time: np.ndarray, sender: np.ndarray, pairs: PingPairs,
                  slant_range: np.ndarray, correction: Correction, ahead: float) -> np.ndarray:
    """Return points of the bed at slant ranges from every pair's middle, (Q, N, 3) [m].

    The sine of their angle from abeam, positive ahead, is `ahead`.
    """
    delay = 2 * float(np.mean(slant_range)) / arrays.sound_speed
    middle = 0.5 * np.mean([
        _placed(poses, arrays, time[n], time[n], arrays.tx[sender[n]], n, correction)
        + _placed(poses, arrays, time[n], time[n] + delay, arrays.rx[receivers], n, correction)
        for n, receivers in ((0, pairs.first), (1, pairs.second))], axis=0)
    heading = float(np.mean([poses.heading(time[n] + part) for n in (0, 1) for part in (0.0, delay)]))
    heading += 0.5 * correction.yaw
    abeam = arrays.side * np.array([np.cos(heading), -np.sin(heading)])
    above = arrays.bed_depth + middle[:, None, 2]
    aside = np.sqrt(np.maximum(slant_range ** 2 * (1 - ahead ** 2) - above ** 2, 0.0))
    flat = middle[:, None, :2] + aside[..., None] * abeam + (ahead * slant_range)[:, None] * _frame(heading)[0][:2]
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), -arrays.bed_depth)], -1)


def pair_delays(poses: Poses, arrays: Arrays, time: np.ndarray, sender: np.ndarray, pairs: PingPairs,
                target: np.ndarray, correction: Correction) -> tuple[np.ndarray, np.ndarray]:
    """Return two-way delays (2, Q, N) [s] of both pings' receivers, and derivatives (Q, N, 3) [s/m, s/m, s/rad].

    The derivatives are those of the second ping's delay by its sway, heave and yaw.
    """
    first = two_way_delay(poses, np.full(target.shape[:2], time[0]), arrays.tx[sender[0]],
                          arrays.rx[pairs.first][:, None], target, arrays.sound_speed)
    # Moving and turning the body has the same effect as moving and turning the bed back.
    second = two_way_delay(poses, np.full(target.shape[:2], time[1]), arrays.tx[sender[1]],
                           arrays.rx[pairs.second][:, None], target, arrays.sound_speed)
    for _ in range(3):
        out = _placed(poses, arrays, time[1], np.full(target.shape[:2], time[1]), arrays.tx[sender[1]], 1, correction)
        home = _placed(poses, arrays, time[1], time[1] + second, arrays.rx[pairs.second][:, None], 1, correction)
        legs = [target - out, target - home]
        lengths = [np.linalg.norm(leg, axis=-1, keepdims=True) for leg in legs]
        second = (lengths[0] + lengths[1])[..., 0] / arrays.sound_speed
    towards = [leg / length for leg, length in zip(legs, lengths)]
    ahead, aside, down = _frame(float(poses.heading(time[0])))
    pull = -(towards[0] + towards[1]) / arrays.sound_speed
    origin = poses.position(np.array(time[1]))
    turn = sum(-np.sum(toward * np.cross(down, place - origin), -1) / arrays.sound_speed
               for toward, place in zip(towards, (out, home)))
    return np.stack([first, second]), np.stack([pull @ aside, pull @ down, turn], -1)


def _frame(heading: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the directions ahead, to starboard and down in the scene's frame, z up."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return np.array([sine, cosine, 0.0]), np.array([cosine, -sine, 0.0]), np.array([0.0, 0.0, -1.0])


def _placed(poses: Poses, arrays: Arrays, sent: float, time: np.ndarray | float, lever: np.ndarray, number: int,
            correction: Correction) -> np.ndarray:
    """Return the places of elements; those of the second ping (number 1) are moved and turned by the correction."""
    place = poses.place(np.asarray(time, float), lever)
    if not number:
        return place
    ahead, aside, down = _frame(float(poses.heading(np.array(sent))))
    origin = poses.position(np.asarray(time, float))
    moved = place + correction.surge * ahead + correction.sway * aside + correction.heave * down
    return moved + correction.yaw * np.cross(down, place - origin)
