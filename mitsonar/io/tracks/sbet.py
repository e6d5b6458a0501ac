"""Smoothed best estimates of trajectories (SBET), as post-processing of inertial systems writes them, with accuracies.

A record is 17 float64, little-endian: time [s of the GPS week], latitude, longitude [rad], height above the ellipsoid
[m], velocities along the wander frame [m/s], roll, pitch, heading of the platform and wander angle [rad], accelerations
[m/s²], angular rates [rad/s]. Heading from true north is the platform's less the wander angle. Accuracy (smrmsg) is 10
float64: time, north, east, down [m], their velocities, roll, pitch, heading [arc minutes] (layouts as in the public
readers of NOAA and PDAL). The file states neither its week nor whether its clock is GPS or UTC.
"""
from __future__ import annotations

import os

import numpy as np

from mitsonar.device.files import FilePath

from .gps_time import WEEK, unwrapped
from .navigation import Navigation

FIELDS, ACCURACY = 17, 10
MOST_RECORDS = 8_000_000           # eleven hours at 200 Hz: 1 GB
STEEPEST = np.pi / 2               # [rad] of pitch; no platform rolls more than half round
SLOW = 60.0                        # [s] over which heights are averaged, for the heave


def recognised(path: FilePath) -> bool:
    """Return True if a file's first records can be those of an SBET, whatever its name."""
    size = os.path.getsize(path)
    if not size or size % (8 * FIELDS):
        return False
    first = np.fromfile(path, "<f8", min(4 * FIELDS, size // 8)).reshape(-1, FIELDS)
    return bool(_sound(first).all() and (np.diff(first[:, 0]) > 0).all())


def read(path: FilePath) -> Navigation:
    """Read an SBET; times are seconds of its week.

    Raises
    ------
    ValueError
        If the file is cut off or too long, or a record cannot be one.
    """
    rows = _rows(path, FIELDS, "navigation")
    bad = np.flatnonzero(~_sound(rows))
    if bad.size:
        raise ValueError(f"cannot read the navigation {path}: record {bad[0] + 1} of {len(rows)} is not one of an SBET "
                         "(its time, place or attitude is impossible); export it anew.")
    time = unwrapped(rows[:, 0])
    if (back := np.flatnonzero(np.diff(time) <= 0)).size:
        raise ValueError(f"cannot read the navigation {path}: the time of record {back[0] + 2} is not later than that "
                         "of the one before it; export it anew.")
    return Navigation(time=time, x=np.unwrap(np.degrees(rows[:, 2]), period=360), y=np.degrees(rows[:, 1]), z=None,
                      heave=heave_of(time, rows[:, 3]), roll=rows[:, 7], pitch=rows[:, 8],
                      heading=np.unwrap(rows[:, 9] - rows[:, 10]), geographic=True, height=rows[:, 3], week=True)


def accuracy(path: FilePath) -> dict[str, np.ndarray]:
    """Read the standard deviations of an SBET (N,): time [s of the week], x, y, height [m], roll, pitch, heading [rad].

    Raises
    ------
    ValueError
        If the file is cut off or too long, or a number cannot be an accuracy.
    """
    rows = _rows(path, ACCURACY, "accuracy")
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    if not (np.isfinite(rows).all() and (rows[:, 1:] >= 0).all() and (np.abs(rows[:, 0]) <= 2 * WEEK).all()):
        raise ValueError(f"cannot read the accuracy {path}: it has numbers that are no standard deviations; give an "
                         "smrmsg file.")
    minutes = np.radians(rows[:, 7:] / 60)
    return dict(zip(("time", "y", "x", "height", "roll", "pitch", "heading"),
                    (rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3], *minutes.T)))


def heave_of(time: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return the heave (N,) [m] in heights (N,) [m]: what they differ from their mean over a minute."""
    whole = np.r_[0.0, np.cumsum(0.5 * (height[1:] + height[:-1]) * np.diff(time))]
    ends = np.clip(time[:, None] + np.array([-0.5, 0.5]) * SLOW, time[0], time[-1])
    lasting = np.diff(ends, axis=1)[:, 0]
    mean = np.diff(np.interp(ends, time, whole), axis=1)[:, 0] / np.where(lasting > 0, lasting, 1.0)
    return np.where(lasting > 0, height - mean, 0.0)


def _rows(path: FilePath, count: int, what: str) -> np.ndarray:
    """Return the records (N, count) of a file."""
    size = os.path.getsize(path)
    if size == 0 or size % (8 * count):
        raise ValueError(f"cannot read the {what} {path}: it has {size} bytes, which is no whole number of records of "
                         f"{8 * count}; it is cut off, or another format.")
    if size > 8 * count * MOST_RECORDS:
        raise ValueError(f"cannot read the {what} {path}: it has {size // (8 * count)} records, more than "
                         f"{MOST_RECORDS}; export the time of the line.")
    return np.fromfile(path, "<f8").reshape(-1, count)


def _sound(rows: np.ndarray) -> np.ndarray:
    """Return True for records (N, 17) that can be those of an SBET."""
    time, latitude, longitude, height = rows[:, :4].T
    roll, pitch, heading, wander = rows[:, 7:11].T
    with np.errstate(invalid="ignore"):
        return (np.isfinite(rows[:, :11]).all(1) & (time >= 0) & (time <= 2 * WEEK) & (np.abs(latitude) <= np.pi / 2)
                & (np.abs(longitude) <= 2 * np.pi) & (np.abs(height) < 1e5) & (np.abs(rows[:, 4:7]) < 1e3).all(1)
                & (np.abs(roll) <= np.pi) & (np.abs(pitch) <= STEEPEST) & (np.abs(heading) <= 4 * np.pi)
                & (np.abs(wander) <= 4 * np.pi) & ((latitude != 0) | (longitude != 0)))
