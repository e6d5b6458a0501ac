"""Angles of soundings from the vertical."""
from __future__ import annotations

import numpy as np
import xarray as xr


def vertical_angle(line: xr.Dataset) -> np.ndarray:
    """Return the angles of soundings from the vertical (ping, beam) [rad], positive to starboard.

    The vertex is the midpoint of both arrays of a level ship. For a sounding without a place, the angle at the array is
    returned.
    """
    receive = line["receive_offset"].values[None]
    if {"head", "head_receive_offset"} <= set(line):
        heads = line["head_receive_offset"].values
        receive = heads[np.clip(line["head"].values, 0, len(heads) - 1)]
    arm = np.nan_to_num(0.5 * (line["transmit_offset"].values + receive))              # (ping or 1, axis)
    below = line["depth"].values - line["ping_depth"].values[:, None] - arm[:, 2:]
    placed = np.arctan2(line["across_track"].values - arm[:, 1:2], below)
    return np.where(np.isfinite(placed), placed, line["angle"].values)
