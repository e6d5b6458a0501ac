"""Scattering functions of targets: the pressure f at 1 m by frequency and angles, from CSV or netCDF.

    frequency_khz, aspect_deg, target_strength_db, phase_deg
    90, 0, -32.1, 14
    90, 5, -33.0, 20

f is 10^(target_strength_db / 20) e^(i phase), or ``real`` and ``imaginary`` [m]. Rows may come in any order; every
combination of frequency and angles is there once. In netCDF the same names are variables whose dimensions are
``frequency_khz`` and the angles, with coordinates.
"""
from __future__ import annotations

import numpy as np
import xarray as xr

from mitsonar.device.files import CLASSIC, HDF5, FilePath, check_readable
from mitsonar.scattering.bodies.scattering_functions import AXES, ScatteringTable

from ..records.netcdf import damage_told, dataset_in
from .tables import floats, records

__all__ = ["read"]

FREQUENCY = "frequency_khz"
ANGLES = {f"{name}_deg": name for name in AXES}
VALUES = ("target_strength_db", "phase_deg", "real", "imaginary")
LARGEST_DB = 300.0                 # of a strength, either way
LARGEST_KHZ = 1e5
LARGEST_DEG = 360.0
MOST_VALUES = 20_000_000


def read(path: FilePath) -> ScatteringTable:
    """Read a scattering function.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    ScatteringTable

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such table, has gaps, holds a combination twice or a number that is none.
    """
    check_readable(path, "the scattering function", "a CSV or netCDF file")
    with open(path, "rb") as file:
        binary = file.read(4) in (HDF5, *CLASSIC)
    return _from_netcdf(path) if binary else _from_csv(path)


def _from_csv(path: FilePath) -> ScatteringTable:
    names, lines, rows = records(path, "scattering function")
    twice = [name for name in names if names.count(name) > 1]
    unknown = [name for name in names if name not in (FREQUENCY, *ANGLES, *VALUES)]
    if twice or unknown:
        raise ValueError(f"cannot read the scattering function {path}: the column {(twice or unknown)[0]} is "
                         f"{'there twice' if twice else 'unknown'}; columns are {', '.join(_known())}.")
    if len(rows) > MOST_VALUES:
        raise ValueError(f"the scattering function {path} has {len(rows)} rows; {MOST_VALUES} is the most: thin it.")
    column = {name: floats(path, lines, name, [row[number] for row in rows]) for number, name in enumerate(names)}
    if FREQUENCY not in column:
        raise ValueError(f"cannot read the scattering function {path}: it has no column {FREQUENCY}; add it.")
    axes = [name for name in names if name in ANGLES] + [FREQUENCY]
    nodes, where = zip(*(np.unique(column[name], return_inverse=True) for name in axes))
    shape = tuple(map(len, nodes))
    size = int(np.prod(shape, dtype=float))
    flat = np.ravel_multi_index(tuple(part.ravel() for part in where), shape) if size == len(rows) else None
    if flat is None or len(np.unique(flat)) < size:
        by = " x ".join(f"{count} of {name}" for count, name in zip(shape, axes))
        raise ValueError(f"the scattering function {path} has {len(rows)} rows, and {by} make {size}; give every "
                         "combination once.")
    values = np.empty(size, complex)
    values[flat] = _form(path, column)
    return _table(path, dict(zip(axes, nodes)), values.reshape(shape))


def _from_netcdf(path: FilePath) -> ScatteringTable:
    with dataset_in(path) as dataset:
        wanted = [name for name in VALUES if name in dataset.data_vars]
        axes = [str(name) for name in dataset[wanted[0]].dims if name != FREQUENCY] + [FREQUENCY] if wanted else []
        if wrong := _wrong(dataset, wanted, axes):
            raise ValueError(f"cannot read the scattering function {path}: {wrong}; dimensions and variables are "
                             f"{', '.join(_known())}.")
        with damage_told(path):
            nodes = {name: np.asarray(dataset[name].values, float) for name in axes}
            column = {name: np.asarray(dataset[name].transpose(*axes).values, float) for name in wanted}
    for name, values in [*nodes.items(), *column.items()]:
        if not np.isfinite(values).all():
            raise ValueError(f"the scattering function {path} has values of {name} that are not finite; mend them.")
    return _table(path, nodes, _form(path, column))


def _wrong(dataset: xr.Dataset, wanted: list[str], axes: list[str]) -> str:
    """Return what is wrong with the variables and dimensions of a scattering function; an empty text if nothing is."""
    if not wanted:
        return "it holds none of its variables"
    if any(dataset[name].size > MOST_VALUES for name in (*wanted, *dataset.coords)):
        return f"it holds more than {MOST_VALUES} values"
    odd = [name for name in axes if name not in (*ANGLES, FREQUENCY) or name not in dataset.coords]
    if odd or any(set(map(str, dataset[name].dims)) != set(axes) for name in wanted):
        return (f"its dimensions are {', '.join(map(str, dataset[wanted[0]].dims))}, each to have coordinates and all "
                "variables the same")
    words = [name for name in (*axes, *wanted) if dataset[name].dtype.kind not in "fiu"]
    return f"{words[0]} holds {dataset[words[0]].dtype}, not numbers" if words else ""


def _known() -> tuple[str, ...]:
    return (FREQUENCY, *ANGLES, *VALUES)


def _form(path: FilePath, column: dict[str, np.ndarray]) -> np.ndarray:
    """Return f [m] from its columns."""
    parts, level = [name for name in ("real", "imaginary") if name in column], column.get("target_strength_db")
    if (level is None) == (len(parts) < 2) or (level is not None and parts) or ("phase_deg" in column and parts):
        raise ValueError(f"cannot read the scattering function {path}: it needs target_strength_db, with phase_deg or "
                         "without, or real and imaginary; give the one or the others.")
    if level is None:
        form = column["real"] + 1j * column["imaginary"]
        level = 20 * np.log10(np.maximum(np.abs(form), 1e-20))
        if np.max(level) > LARGEST_DB:
            raise ValueError(f"the scattering function {path} has a pressure of {np.abs(form).max():g} m; check it.")
        return form
    if np.max(np.abs(level)) > LARGEST_DB:
        raise ValueError(f"the scattering function {path} has a target strength of {level[np.argmax(np.abs(level))]:g} "
                         f"dB; it must lie within -{LARGEST_DB:g} to {LARGEST_DB:g} dB.")
    return 10 ** (level / 20) * np.exp(1j * np.radians(column.get("phase_deg", 0.0)))


def _table(path: FilePath, nodes: dict[str, np.ndarray], values: np.ndarray) -> ScatteringTable:
    frequency = nodes[FREQUENCY]
    if not frequency.size or np.max(frequency) > LARGEST_KHZ:
        raise ValueError(f"the scattering function {path} has frequencies up to {np.max(frequency, initial=0):g} kHz; "
                         f"{LARGEST_KHZ:g} is the most, in kHz.")
    angles = {ANGLES[name]: at for name, at in nodes.items() if name != FREQUENCY}
    wide = [name for name, at in angles.items() if np.max(np.abs(at), initial=0) > LARGEST_DEG]
    if wide:
        raise ValueError(f"the scattering function {path} has a {wide[0]} beyond {LARGEST_DEG:g} degrees; mend it.")
    try:
        return ScatteringTable(frequency=1e3 * frequency, values=values,
                               axes={name: np.radians(at) for name, at in angles.items()})
    except ValueError as error:
        raise ValueError(f"cannot read the scattering function {path}: {error}") from None
