"""Changes of a recorded line before its reduction: another tide, ellipsoid heights, another motion, a delayed heave.

    depth below the datum = depth below the surface - water level
    water level = ping_height - separation + depth below the surface                                            by gnss

Depths of the motion keep their own course between pings; the change of the water level is linear between pings. The
cast lies below the surface, and moves with the mean of the level.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr

from ..record import variable
from .attitude import PlatformMotion

__all__ = ["by_ellipsoid", "by_tide", "navigated", "with_heave"]

MARGIN = 2.0                       # [s] of motion kept before the first and after the last ping
FEWEST = 4                         # samples of another motion in a block of pings


def by_tide(soundings: xr.Dataset, level: Callable[[np.ndarray], np.ndarray]) -> xr.Dataset:
    """Return a line whose motion is reduced with another tide; reduce it again for its soundings.

    Parameters
    ----------
    soundings : xarray.Dataset
    level : function of times (ping,) [s] after the line's start
        Function that returns water levels (ping,) [m] above the datum.

    Returns
    -------
    xarray.Dataset
    """
    changed = _on(soundings, np.broadcast_to(level(soundings["ping_time"].values), soundings.sizes["ping"]))
    return changed.assign_attrs(heights="tide")


def by_ellipsoid(soundings: xr.Dataset, separation: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> xr.Dataset:
    """Return a line whose motion is reduced by heights above the ellipsoid; reduce it again for its soundings.

    Parameters
    ----------
    soundings : xarray.Dataset
        Line with `ping_height`.
    separation : function of x, y (ping,) [m]
        Function that returns heights (ping,) [m] of the vertical datum above the ellipsoid.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    ValueError
        If the line states no heights above the ellipsoid.
    """
    height = soundings["ping_height"].values if "ping_height" in soundings else np.full(1, np.nan)
    if not np.isfinite(height).all():
        raise ValueError("the line states no heights above the ellipsoid, or not of all pings; reduce it with a tide, "
                         "or take the heights from navigation.")
    apart = separation(soundings["ping_x"].values, soundings["ping_y"].values)
    level = height - apart + soundings["ping_depth"].values + _level(soundings)
    changed = _on(soundings, level).assign(separation=variable("separation", apart))
    return changed.assign_attrs(heights="gnss")


def with_heave(soundings: xr.Dataset, deeper: Callable[[np.ndarray], np.ndarray]) -> xr.Dataset:
    """Return a line whose heave is corrected, such as by a delayed heave.

    Parameters
    ----------
    soundings : xarray.Dataset
    deeper : function of times (N,) [s] after the line's start
        Function that returns by how much deeper (N,) [m] the reference point was than the line states.

    Returns
    -------
    xarray.Dataset
    """
    depths = {f"{of}_depth": soundings[f"{of}_depth"].values + deeper(soundings[f"{of}_time"].values)
              for of in ("motion", "ping")}
    return soundings.assign({name: variable(name, values) for name, values in depths.items()})


def navigated(soundings: xr.Dataset, motion: PlatformMotion, height: np.ndarray | None = None) -> xr.Dataset:
    """Return a line with the positions and attitude of another record; reduce it again for its soundings.

    Parameters
    ----------
    soundings : xarray.Dataset
    motion : PlatformMotion
        Motion of the reference point, in seconds after the line's start; its depths are not used, as the line's own
        heave stays.
    height : array (M,) [m] or None
        Heights of the reference point above the ellipsoid.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    ValueError
        If the motion does not cover the pings.
    """
    time = soundings["ping_time"].values
    last = float(np.nanmax(time + np.nanmax(soundings["travel_time"].values, axis=1, initial=0.0)))
    some = (motion.time >= time[0] - MARGIN) & (motion.time <= last + MARGIN)
    if some.sum() < FEWEST or motion.time[some][0] > time[0] or motion.time[some][-1] < last:
        raise ValueError(f"the navigation lasts from {motion.time[0]:.6g} to {motion.time[-1]:.6g} s after the line's "
                         f"start, and its pings from {time[0]:.6g} to {last:.6g} s; give the navigation of this line, "
                         "and the date of its week.")
    own = PlatformMotion.of(soundings)
    kept = PlatformMotion(time=motion.time[some], depth=own.at(motion.time[some]).place[:, 2],
                          **{name: getattr(motion, name)[some] for name in ("x", "y", "roll", "pitch", "heading")})
    pose = kept.at(time)
    values = {**{f"motion_{name}": getattr(kept, name) for name in ("time", "x", "y", "depth", "roll", "pitch")},
              "motion_heading": kept.heading % (2 * np.pi), "ping_x": pose.place[:, 0], "ping_y": pose.place[:, 1],
              "ping_roll": pose.roll, "ping_pitch": pose.pitch, "ping_heading": pose.heading % (2 * np.pi)}
    if height is not None:
        values["ping_height"] = replace(kept, depth=-height[some]).at(time).place[:, 2] * -1
    left = soundings.drop_vars([name for name in soundings.variables if "motion" in soundings[name].dims])
    return left.assign({name: variable(name, value) for name, value in values.items()})


def _level(soundings: xr.Dataset) -> np.ndarray:
    """Return the water level (ping,) [m] that a line is reduced with."""
    return soundings["tide"].values if "tide" in soundings else np.zeros(soundings.sizes["ping"])


def _on(soundings: xr.Dataset, level: np.ndarray) -> xr.Dataset:
    """Return a line with its motion and cast below the datum of another water level (ping,) [m]."""
    change = level - _level(soundings)
    time = soundings["ping_time"].values
    order = np.argsort(time, kind="stable")
    moved = np.interp(soundings["motion_time"].values, time[order], change[order])
    values = {"tide": level, "ping_depth": soundings["ping_depth"].values - change,
              "motion_depth": soundings["motion_depth"].values - moved}
    if soundings.sizes["node"] > 1:
        values["cast_depth"] = soundings["cast_depth"].values - change.mean()
    return soundings.assign({name: variable(name, value) for name, value in values.items()})
