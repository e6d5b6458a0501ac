"""Lines of soundings in the files of survey software, as a file's name asks.

    .gsf          Generic Sensor Format 03.09: soundings, sectors, cast, attitude, snippets
    .kmall        Kongsberg's datagrams: the same, and the water column
    .nc           the record itself, every bit of it, and beside it the groups of SONAR-netCDF4
    .csv          one sounding a line, with units
    .las          a point cloud

Pings come in blocks, and memory holds one block at a time. A file is whole or not there. `reading` knows what is read.
"""
from __future__ import annotations

import importlib
import os
from collections.abc import Iterator

import xarray as xr

from mitsonar.device.files import FilePath, check_readable, check_writable
from mitsonar.hydrography.record import check

from . import lines
from .lines import Blocks, Place, Written

__all__ = ["SUFFIXES", "Blocks", "Place", "Written", "check_asked", "read_blocks", "sources", "stored", "write"]

BLOCK = 64                         # pings
_WRITERS = {".gsf": "gsf.gsf", ".kmall": "kongsberg.kmall", ".nc": "netcdf", ".csv": "table", ".las": "las"}
SUFFIXES = tuple(_WRITERS)


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as the name of the file asks; whole or not at all.

    Parameters
    ----------
    blocks : xarray.Dataset or iterable of them
        As `mitsonar.hydrography.record` says, some pings each.
    path : str or path
        Ends in one of `SUFFIXES`.
    place : (latitude, longitude) [degrees], optional
        Of x = y = 0, where the scene names no coordinate system; default: 0, 0.
    start : str, optional
        ISO 8601, UTC, of time 0; default: as the line says, or 1970.

    Returns
    -------
    Written
        With words on what the format cannot hold.

    Raises
    ------
    ValueError
        If the name ends otherwise, there is no ping, a block is no line of soundings or unlike the first, ``place`` or
        ``start`` are none or not needed, or the values do not fit.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.

    Examples
    --------
    ``mitsonar.io.survey_lines.write(mitsonar.soundings(scene), "line.gsf")``
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in _WRITERS:
        raise ValueError(f"cannot write {path}: its name says no kind of file; let it end in one of "
                         f"{', '.join(SUFFIXES)}.")
    check_writable(path)
    return importlib.import_module(f"{__name__}.{_WRITERS[suffix]}").write(blocks, path, place=place, start=start)


def read_blocks(path: FilePath, *, column: bool = True, size: int = BLOCK) -> Iterator[xr.Dataset]:
    """Read a line of soundings some pings at a time.

    Parameters
    ----------
    path : str or path
        .all, .wcd, .kmall, .kmwcd, .gsf, or a record in netCDF.
    column : bool
        Take the water column, where there is one.
    size : int
        Pings of a block.

    Yields
    ------
    xarray.Dataset
        As `mitsonar.hydrography.record` says.

    Raises
    ------
    FileNotFoundError, PermissionError
        If there is no such file, or it may not be read.
    ValueError
        If it is none of these, damaged, or holds no soundings.
    """
    if os.path.splitext(path)[1].lower() != ".nc":
        from . import reading

        yield from reading.blocks(path, water_column=column, size=size)
        return
    from ..records import netcdf

    with netcdf.opened(path) as record:
        if not isinstance(record, xr.Dataset):
            raise ValueError(f"cannot read {path}: it holds signals; give soundings.")
        check(record, os.fspath(path))
        if not column:
            record = record.drop_vars([name for name in record.variables if str(name).startswith("column_")])
        for start in range(0, record.sizes["ping"], size):
            yield record.isel(ping=slice(start, start + size)).load()


def check_asked(place: Place | None, start: str | None, first: xr.Dataset | None = None) -> None:
    """Check ``place`` and ``start`` as `write` does, before the pings are made; with the first, also against it.

    Raises
    ------
    ValueError
        As `write`.
    """
    lines.check_asked(place, start)
    if first is not None:
        lines.line_of(first, place=place, start=start)


def stored(path: FilePath) -> Iterator[xr.Dataset]:
    """Return the pings of a line that was made ping by ping (`io.ping_file`), one a block; raises as `read_blocks`."""
    from ..records import netcdf

    with netcdf.opened(path, unfinished=True) as record:
        for number in range(record.sizes["ping"]):
            yield record.isel(ping=slice(number, number + 1)).load()


def sources(path: FilePath) -> tuple[str, ...]:
    """Name the files that `read_blocks` would open: the soundings', and the water column's beside them.

    Raises
    ------
    FileNotFoundError, PermissionError, ValueError
        As `read_blocks`, of a file that cannot be opened.
    """
    if os.path.splitext(path)[1].lower() == ".nc":
        check_readable(path, "the record", "a netCDF file")
        return (os.fspath(path),)
    from . import reading

    return reading.sources(path)
