"""The grid that the options of the command focus ask for."""
from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    from ..synthetic_aperture.grids import Grid

__all__ = ["chosen_grid"]


def chosen_grid(arguments: argparse.Namespace, trajectory: xr.Dataset, raw: xr.Dataset, times: np.ndarray) -> Grid:
    """Lay the grid.

    Parameters
    ----------
    arguments : argparse.Namespace
        Of the command: grid, spacing, along, across, depth.
    trajectory : xarray.Dataset
        With ``motion_time`` and so on.
    raw : xarray.Dataset
        One ping.
    times : (P,) [s]
        Of all pings.

    Raises
    ------
    ValueError
        If an option is no number, or there is no such grid.
    """
    from ..synthetic_aperture.grids import default_grid, ground_grid, slant_grid

    motion = {name: variable for name, variable in trajectory.variables.items() if str(name).startswith("motion_")}
    known = raw.drop_vars([name for name in raw.variables if str(name).startswith("motion_")]).assign(motion)
    if arguments.depth is not None:
        known = known.assign_attrs(bed_depth=arguments.depth)
    spacing = _spacing(arguments.spacing)
    usual = default_grid(known, spacing=spacing, kind=arguments.grid, ping_time=times)
    if arguments.along is None and arguments.across is None:
        return usual
    step = tuple(float(np.diff(axis[:2])[0]) if len(axis) > 1 else 1.0
                 for axis in (usual.along_track, usual.across_track)) if spacing is None else spacing
    along = _between(arguments.along, usual.along_track)
    across = _between(arguments.across, usual.across_track)
    place = {"origin": usual.origin, "heading": usual.heading}
    if usual.kind == "ground":
        return ground_grid(along, across, (step[0], step[1]), known.attrs["bed_depth"], **place)
    farthest = int(np.argmax(np.abs(usual.across_track)))
    depth = float(usual.depth[0, farthest])
    height = np.sqrt(usual.across_track[farthest] ** 2 - usual.ground[farthest] ** 2)
    side = 1 if usual.across_track[farthest] > 0 else -1
    if min(side * across[0], side * across[1]) < 0:
        raise ValueError(f"--across is {across[0]:g} to {across[1]:g} m; slant ranges to "
                         f"{'starboard are not below' if side > 0 else 'port are not above'} 0.")
    near, far = sorted((side * across[0], side * across[1]))
    return slant_grid(along, (near, far), (step[0], step[1]), depth, line_depth=depth - height, side=side, **place)


def _between(asked: list[float] | None, axis: np.ndarray) -> tuple[float, float]:
    return (float(axis[0]), float(axis[-1])) if asked is None else (float(asked[0]), float(asked[1]))


def _spacing(text: str | None) -> tuple[float, float] | None:
    """One number, or two with an x between."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.lower().split("x")]
        along, across = numbers if len(numbers) == 2 else numbers * 2
    except ValueError:
        raise ValueError(f"--spacing is {text!r}; give metres, such as 0.02, or along x across, such as 0.03x0.01."
                         ) from None
    return along, across
