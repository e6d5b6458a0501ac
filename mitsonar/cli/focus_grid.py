"""The grid that the options of the command focus ask for."""
from __future__ import annotations

import argparse
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import xarray as xr

    from mitsonar.synthetic_aperture.focusing.grids import Grid

__all__ = ["WINDOW", "Usual", "chosen_grid"]

WINDOW = "taylor 4 30"


@dataclass(frozen=True, kw_only=True)
class Usual:
    """What holds where an option is left out: of a scene what its sensor says.

    Attributes
    ----------
    grid : {"ground", "slant"}
    spacing : float or None [m]
        None: half the resolution.
    window, range_window : str
    """

    grid: str = "ground"
    spacing: float | None = None
    window: str = WINDOW
    range_window: str = WINDOW


def chosen_grid(arguments: argparse.Namespace, usual: Usual, trajectory: xr.Dataset, raw: xr.Dataset,
                times: np.ndarray) -> Grid:
    """Lay the grid.

    Parameters
    ----------
    arguments : argparse.Namespace
        Of the command: grid, spacing, along, across, depth.
    usual : Usual
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
    import numpy as np

    from mitsonar.synthetic_aperture.focusing.grids import default_grid, ground_grid, slant_grid

    motion = {name: variable for name, variable in trajectory.variables.items() if str(name).startswith("motion_")}
    known = raw.drop_vars([name for name in raw.variables if str(name).startswith("motion_")]).assign(motion)
    if arguments.depth is not None:
        known = known.assign_attrs(bed_depth=arguments.depth)
    spacing = _spacing(arguments.spacing)
    whole = default_grid(known, spacing=usual.spacing if spacing is None else spacing,
                         kind=arguments.grid or usual.grid, ping_time=times)
    if arguments.grid == "slant" and whole.kind != "slant":
        raise ValueError("a slant grid lies beside a straight line, and this track is a circle; leave out --grid "
                         "slant.")
    if arguments.along is None and arguments.across is None:
        return whole
    step = tuple(float(np.diff(axis[:2])[0]) if len(axis) > 1 else 1.0
                 for axis in (whole.along_track, whole.across_track)) if spacing is None else spacing
    along = _between(arguments.along, whole.along_track)
    across = _between(arguments.across, whole.across_track)
    place = {"origin": whole.origin, "heading": whole.heading}
    if whole.kind == "ground":
        return ground_grid(along, across, (step[0], step[1]), known.attrs["bed_depth"], **place)
    farthest = int(np.argmax(np.abs(whole.across_track)))
    depth = float(whole.depth[0, farthest])
    height = np.sqrt(whole.across_track[farthest] ** 2 - whole.ground[farthest] ** 2)
    side = 1 if whole.across_track[farthest] > 0 else -1
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
