"""Rays of one ping over the bed, through the profile in use and through the true water."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from mitsonar.hydrography.reduction.ray_paths import (
    RayHead,
    head_of,
    launches,
    ray_places,
    receiving_axes,
    used_profile,
    water_profile,
)
from mitsonar.water.profile import SoundSpeedProfile

from .line_sheet import curve_axes, key_above, sounded

MOST_RAYS = 25
POINTS = 60                        # points of a ray
USED, WATER = "#0072b2", "#d55e00"


def draw_rays(axes: Axes, line: xr.Dataset, ping: int, water: SoundSpeedProfile | None = None) -> None:
    """Draw some rays of a ping through the profile in use and through the true water, soundings and the bed."""
    record = line.isel(ping=[ping])
    there = np.flatnonzero(_usable(record, ping))
    across, depth = (record[name].values[0] for name in ("across_track", "depth"))
    chosen = there[np.unique(np.linspace(0, there.size - 1, MOST_RAYS).round().astype(int))]
    chosen = chosen[np.argsort(across[chosen], kind="stable")]
    head = head_of(line, ping)
    water = water_profile(line) if water is None else water
    for profile, colour, style, words in ((used_profile(line, head), USED, "-", "rays by the profile in use"),
                                          (water, WATER, "--", "rays by the water's own")):
        if profile is not None:
            ways, depths = ray_lines(record.isel(beam=chosen), head, profile)
            axes.plot(ways.T, depths.T, color=colour, linestyle=style, linewidth=0.8)
            axes.plot([], [], color=colour, linestyle=style, linewidth=1.2, label=words)
    if "true_depth" in record:
        order = there[np.argsort(across[there], kind="stable")]
        axes.plot(across[order], record["true_depth"].values[0][order], color="#000000", linewidth=1.4, label="bed")
    axes.plot(across[there], depth[there], ".", color="#cc79a7", markersize=4, label="soundings")
    axes.plot(head.across, head.depth, "v", color="#000000", markersize=7)
    axes.invert_yaxis()
    curve_axes(axes, "port   ←   across track [m]   →   starboard", "depth [m]")
    key_above(axes)


def _usable(record: xr.Dataset, ping: int) -> np.ndarray:
    try:
        known = np.isfinite(record["angle"].values[0]) & np.isfinite(record["travel_time"].values[0])
        return sounded(record)[0] & known
    except ValueError:
        raise ValueError(f"ping {ping} has no valid sounding, so there are no rays to draw; choose another.") from None


def ray_lines(beams: xr.Dataset, head: RayHead, profile: SoundSpeedProfile) -> tuple[np.ndarray, np.ndarray]:
    """Return the rays from the head to the soundings of some beams of one ping."""
    # -> across, depth (N, POINTS) [m]
    time = beams["travel_time"].values[0]
    towards = launches(head, beams["angle"].values[0], beams["transmit_angle"].values[0],
                       receiving_axes(beams, 0, head, time))
    level = np.hypot(towards[:, 0], towards[:, 1])
    way, depth = ray_places(profile, head.depth, level / head.sound_speed,
                            0.5 * time[:, None] * np.linspace(0, 1, POINTS))
    aside = np.divide(towards[:, 1], level, out=np.ones_like(level), where=level > 0)
    return head.across + way * aside[:, None], depth


def draw_profiles(axes: Axes, line: xr.Dataset, ping: int, deepest: float,
                  water: SoundSpeedProfile | None = None) -> None:
    """Draw the profile in use, the true profile and the speed of the head's sensor over depth."""
    water = water_profile(line) if water is None else water
    head = head_of(line, ping)
    for profile, colour, style, words in ((used_profile(line, head), USED, "-", "in use"),
                                          (water, WATER, "--", "water's own")):
        if profile is not None:
            depth = np.unique(np.concatenate([[0.0, deepest], profile.depth[profile.depth < deepest]]))
            axes.plot(profile.at(depth), depth, color=colour, linestyle=style, linewidth=1.6, label=words)
    axes.plot(head.sound_speed, head.depth, "v", color="#000000", markersize=7, label="head's sensor")
    curve_axes(axes, "sound speed [m/s]", "depth [m]")
    axes.ticklabel_format(useOffset=False, style="plain")
    axes.margins(x=0.15)
    key_above(axes)
