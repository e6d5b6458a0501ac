"""Compare a real record with a simulated one of the same line."""
from __future__ import annotations

import os

import xarray as xr

from mitsonar.device.files import FilePath

from .record import LineComparison

Record = xr.Dataset | FilePath


def compare(real: Record, simulated: Record, *, seed: int = 0) -> LineComparison:
    """Compare a real record with a simulated one of the same line.

    Parameters
    ----------
    real : str, path or xarray.Dataset
        Line of soundings (.all, .kmall, .gsf, .nc).
    simulated : str, path or xarray.Dataset
        Simulated line of the same track: soundings of a scene that `mitsonar like` made, or the scene (.xml), which is
        sounded first.
    seed : int
        Random seed of a scene.

    Returns
    -------
    LineComparison
        An `xarray.Dataset` of terms by angle from the vertical, simulated - real. Each variable has the attribute
        ``evidence``, a sentence on what it can and cannot prove; printing the comparison shows figures and sentences.

    Raises
    ------
    FileNotFoundError
        If a file does not exist.
    ValueError
        If a record is of another kind, or the records have no two common pings.

    Examples
    --------
    ``mitsonar.compare("line.kmall", "twin.nc").to_netcdf("compare.nc")``

    Notes
    -----
    Pings are paired by time, or by place if the lines have no common time. Spreads are of the median absolute
    deviation, so that outliers do not change them.
    """
    from .soundings import compare_soundings

    one = _opened(real)
    other = _of_scene(simulated, one, seed) if _is_scene(simulated) else _opened(simulated)
    names = _name(real, one), _name(simulated, other)
    for line, name in zip((one, other), names):
        if "travel_time" not in line:
            raise ValueError(f"{name} is no line of soundings, and a comparison takes two of them; give an .all, "
                             ".kmall or .gsf file, or soundings in netCDF.")
    return compare_soundings(one, other, names)


def _is_scene(record):
    return not isinstance(record, xr.Dataset) and os.fspath(record).lower().endswith(".xml")


def _of_scene(scene, real, seed):
    """Return the soundings of a scene, with a water column if the real line has one."""
    from mitsonar.verbs.images import soundings

    return soundings(scene, seed, column="column_level_db" in real)


def _opened(record):
    """Return the dataset of a file, or a dataset as it is."""
    if isinstance(record, xr.Dataset):
        return record
    from mitsonar.io.reading import read

    found = read(record)
    if not isinstance(found, xr.Dataset):
        raise ValueError(f"{record} holds no line of soundings; give an .all, .kmall or .gsf file, or soundings in "
                         "netCDF.")
    return found


def _name(record, line):
    if isinstance(record, xr.Dataset):
        return str(line.attrs.get("file") or line.attrs.get("title") or "a dataset")
    return os.path.basename(os.fspath(record))
