"""Lists of soundings as text: x, y and z a line, with or without names of the columns."""
import itertools
import os
import re

import numpy as np

from mitsonar.device.files import FilePath

from .rasters import crs_of, is_metric, refuse_degrees, utm
from .sounding_grids import Soundings

_SUFFIXES = (".xyz", ".txt", ".csv", ".tsv", ".pts", ".dat")
_MOST_SOUNDINGS = 50_000_000     # 1.2 GB
_LINES = 1_000_000               # read at a time
_NAMES = {"x": ("x", "easting", "east", "e", "lon", "long", "longitude"),
          "y": ("y", "northing", "north", "n", "lat", "latitude"),
          "z": ("z", "depth", "elevation", "height", "altitude")}
_GEOGRAPHIC = ("lon", "long", "longitude")


def holds_soundings(path: FilePath) -> bool:
    """Tell whether a file is text that starts with three numbers a line, or is called as such files are."""
    if os.path.isfile(path) and str(path).lower().endswith(_SUFFIXES):
        return True
    try:
        with open(path, "rb") as file:
            lines = file.read(4096).decode("ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        return False
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith("#")), "")
    return len(_numbers(first)) >= 3


def read(path: FilePath, *, crs: str | None = None, nodata: float | None = None) -> Soundings:
    """Read a list of soundings.

    Blanks, tabs, commas or semicolons divide the columns, and ``#`` starts a comment. A header may name the columns;
    without one, or where it names others, the first three are x, y and z. Soundings whose z is NaN are left out.

    Parameters
    ----------
    path : path
    crs : str, optional
        Coordinate system; without one, columns called longitude and latitude are "EPSG:4326", others metres.
    nodata : float, optional
        z that stands for no sounding.

    Returns
    -------
    Soundings
        Degrees and feet become metres of the UTM zone of their middle.

    Raises
    ------
    ValueError
        If a line does not hold three numbers, or there are fewer than three soundings or too many.
    """
    divider, skipped, columns, geographic = _layout(path)
    parts, total = [], 0
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for _ in range(skipped):
            file.readline()
        while True:
            lines = list(itertools.islice(file, _LINES))
            if not lines:
                break
            parts.append(_parsed(lines, divider, columns, skipped + total))
            total += len(lines)
            if total > _MOST_SOUNDINGS:
                raise ValueError(f"the file has more than {_MOST_SOUNDINGS} lines; grid it, or thin it out.")
    x, y, z = np.concatenate(parts).T if parts else np.empty((3, 0))
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("a sounding has no place: x or y is not a finite number; remove it.")
    kept = np.isfinite(z) if nodata is None else np.isfinite(z) & (z != nodata)
    x, y, z = (values[kept] for values in (x, y, z))
    if z.size < 3:
        raise ValueError(f"the file holds {z.size} soundings; a seabed needs three at least.")
    source = crs_of(crs) if crs is not None else crs_of("EPSG:4326") if geographic else None
    if source is None:
        refuse_degrees((x.min(), y.min(), x.max(), y.max()))
    if is_metric(source):
        return Soundings(x=x, y=y, z=z, crs=source, source=source)
    return _in_metres(x, y, z, source)


def _in_metres(x, y, z, source):
    import pyproj

    target = utm((x.min() + x.max()) / 2, (y.min() + y.max()) / 2, source)
    x, y = pyproj.Transformer.from_crs(source.to_wkt(), target.to_wkt(), always_xy=True).transform(x, y)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError("some soundings have no place in their coordinate system; is it another, or are x and y "
                         "exchanged?")
    return Soundings(x=x, y=y, z=z, crs=target, source=source)


def _layout(path):
    """Give the divider, the lines before the first sounding, the columns of x, y, z, and whether they are degrees."""
    with open(path, "rb") as file:
        head = file.read(1 << 16)
    if b"\0" in head:
        raise ValueError("this is no text; soundings are lines of x, y and z.")
    if b"\n" not in head and len(head) == 1 << 16:
        raise ValueError("the first line has no end; soundings are lines of x, y and z.")
    names, skipped = [], 0
    for line in head.decode("utf-8-sig", "replace").splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            if len(_numbers(line)) >= 2:
                break
            if names:
                raise ValueError(f'line {skipped + 1}, "{line.strip()[:60]}", does not hold x, y and z.')
            names = re.split(r"[,;\s]+", re.sub(r"[(\[].*?[)\]]", "", line).strip().strip('"').lower())
        skipped += 1
    else:
        raise ValueError("the file holds no soundings; they are lines of x, y and z.")
    divider = next((mark for mark in ",;" if mark in line), None)
    columns = [next((index for index, name in enumerate(names) if name in _NAMES[key]), -1) for key in "xyz"]
    if -1 in columns:
        return divider, skipped, (0, 1, 2), False
    return divider, skipped, tuple(columns), names[columns[0]] in _GEOGRAPHIC


def _parsed(lines, divider, columns, before):
    """Give x, y and z (N, 3) of some lines, the first of which has number ``before + 1``."""
    try:
        return np.loadtxt(lines, delimiter=divider, usecols=columns, ndmin=2, comments="#").reshape(-1, 3)
    except ValueError:
        pass
    for number, line in enumerate(lines, before + 1):      # NumPy counts without empty lines and comments
        words = line.partition("#")[0]
        try:
            if words.strip():
                np.loadtxt([line], delimiter=divider, usecols=columns)
        except ValueError:
            raise ValueError(f'line {number}, "{line.strip()[:60]}", does not hold x, y and z as numbers.') from None
    raise ValueError("the file does not hold x, y and z as numbers.")


def _numbers(line):
    """Give the numbers that a line starts with."""
    found = []
    for word in re.split(r"[,;\s]+", line.partition("#")[0].strip()):
        try:
            found.append(float(word))
        except ValueError:
            break
    return found
