"""Compare a real record with a simulated one of the same line."""
from __future__ import annotations

import os

import xarray as xr

from mitsonar.device.files import FilePath

from .record import LineComparison

KINDS = {"soundings": "a line of soundings", "sidescan": "a sidescan"}
NEITHER = ("is neither a line of soundings nor a sidescan; give a recorded line of either, an image of a sidescan, or "
           "soundings in netCDF.")
Record = xr.Dataset | FilePath


def compare(real: Record, simulated: Record, *, seed: int = 0) -> LineComparison:
    """Compare a real record with a simulated one of the same line.

    Parameters
    ----------
    real : str, path or xarray.Dataset
        Line of soundings (.all, .kmall, .gsf, .s7k, .xtf, .hsx, .nc), or a recorded sidescan (.xtf, .jsf, .sdf).
    simulated : str, path or xarray.Dataset
        Simulated record of the same line: soundings or a rendered sidescan (.exr, .nc), the same as XTF, or the scene
        (.xml), which is sounded or rendered first.
    seed : int
        Random seed of a scene.

    Returns
    -------
    LineComparison
        An `xarray.Dataset`: of soundings terms by angle from the vertical, differences simulated - real; of sidescans
        statistics, clues by which records are told apart, and pictures of the same gain. Each variable has the
        attribute ``evidence``, a sentence on what it can and cannot prove; printing the comparison shows figures and
        sentences.

    Raises
    ------
    FileNotFoundError
        If a file does not exist.
    ValueError
        If a record is of another kind, the records differ in kind, or lines of soundings have no two common pings.

    Examples
    --------
    ``mitsonar.compare("line.kmall", "twin.nc").to_netcdf("compare.nc")``

    Notes
    -----
    Pings of soundings are paired by time, or by place if the lines have no common time; of sidescans the pings of the
    time that both cover are compared as a whole. Spreads are of the median absolute deviation, so that outliers do not
    change them.
    """
    one = _opened(real)
    other = _of_scene(simulated, one, seed) if _is_scene(simulated) else _opened(simulated)
    names = _name(real, one), _name(simulated, other)
    kinds = [_kind(line, name) for line, name in zip((one, other), names)]
    if kinds[0] != kinds[1]:
        raise ValueError(f"{names[0]} is {KINDS[kinds[0]]} and {names[1]} {KINDS[kinds[1]]}; give two records of one "
                         "kind.")
    if kinds[0] == "soundings":
        from .soundings import compare_soundings as compared
    else:
        from .sidescans import compare_sidescans as compared
    return compared(one, other, names)


def _kind(line, name):
    """Return the kind of a record."""
    if "travel_time" in line:
        return "soundings"
    if "side" in line.dims and ("amplitude" in line or "level" in line):
        return "sidescan"
    raise ValueError(f"{name} {NEITHER}")


def _is_scene(record):
    return not isinstance(record, xr.Dataset) and os.fspath(record).lower().endswith(".xml")


def _of_scene(scene, real, seed):
    """Return the soundings of a scene, with a water column if the real line has one, or its image."""
    from mitsonar.verbs.images import render, soundings

    if "side" in real.dims:
        return render(scene, seed)
    return soundings(scene, seed, column="column_level_db" in real)


def _opened(record):
    """Return the dataset of a file, or a dataset as it is."""
    if isinstance(record, xr.Dataset):
        return record
    from mitsonar.io.reading import read

    found = read(record)
    if not isinstance(found, xr.Dataset):
        raise ValueError(f"{record} {NEITHER}")
    return found


def _name(record, line):
    if isinstance(record, xr.Dataset):
        return str(line.attrs.get("file") or line.attrs.get("title") or "a dataset")
    return os.path.basename(os.fspath(record))
