"""A turn of a rotating head as a fan: its steps in the place of beams, so that all that draws fans draws it.

The picture is the one on the head's screen: every step at its bearing from the platform, which is taken to stand still
for a turn; ahead is up, or what is straight up where the head points forward.
"""
import numpy as np
import xarray as xr

from ..imaging.raster import bearings

__all__ = ["is_scan", "turn_of"]


def is_scan(dataset: xr.Dataset) -> bool:
    """Tell whether a dataset is of a rotating head: levels over (ping, range), a bearing for each of several pings."""
    level, bearing = dataset.get("level"), dataset.coords.get("bearing")
    return level is not None and bearing is not None and set(level.dims) == {"ping", "range"} and (
        bearing.dims == ("ping",)) and bearing.size > 1


def turn_of(dataset: xr.Dataset, ping: int = 0) -> xr.Dataset:
    """Give the turn that a ping belongs to, or the way across the sector, as one ping of a fan.

    Parameters
    ----------
    dataset : xarray.Dataset
        Of a rotating head.
    ping : int
        By position.

    Returns
    -------
    xarray.Dataset
        Variables over (ping, beam, range), one ping; ``beam`` [rad] are the steps' bearings.

    Raises
    ------
    ValueError
        If there is no such ping, or its turn has only one.
    """
    if not 0 <= ping < dataset.sizes["ping"]:
        raise ValueError(f"there is no ping {ping}; there are {dataset.sizes['ping']}, the first is 0.")
    _, turns = bearings(dataset)
    where = next(one for one in turns if one.start <= ping < one.stop)
    steps = dataset.isel(ping=where)
    if steps.sizes["ping"] < 2:
        raise ValueError(f"the turn of ping {ping} has no other ping, so it makes no picture; choose another ping.")
    angle = steps["bearing"].values.astype(float)
    variables = {name: (tuple("beam" if dim == "ping" else dim for dim in variable.dims), variable.values,
                        variable.attrs) for name, variable in steps.data_vars.items()}
    kept = {name: coord for name, coord in steps.coords.items() if "ping" not in coord.dims}
    upright = steps.attrs.get("mount") == "forward"
    towards = (0 * angle, np.sin(angle), -np.cos(angle)) if upright else (np.cos(angle), np.sin(angle), 0 * angle)
    fan = xr.Dataset(variables, kept, steps.attrs).expand_dims("ping").assign_coords(
        beam=angle, **{f"beam_{axis}": ("beam", column) for axis, column in zip("xyz", towards)})
    first = {name: ("ping", steps[name].values[:1]) for name in ("ping", "turn", "ping_time") if name in steps.coords}
    if "altitude" in steps.coords:
        first["altitude"] = ("ping", [float(np.nanmean(steps["altitude"].values))])
    return fan.assign_coords(first)
