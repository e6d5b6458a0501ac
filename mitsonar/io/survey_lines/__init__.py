"""Read and write lines of soundings in the file formats of survey software; the file suffix selects the format.

    .gsf          Generic Sensor Format 03.09: soundings, sectors, cast, attitude, snippets
    .kmall        Kongsberg datagrams: the same, and the water column
    .s7k          records of Teledyne Reson: soundings, cast, attitude
    .nc           the record itself without loss, and beside it the groups of SONAR-netCDF4
    .csv          one sounding a row, units in the header
    .las          a point cloud

Pings are written in blocks, so that memory holds one block at a time. An unfinished file is not left behind.
`reading` lists the formats that are read.
"""
from __future__ import annotations

import importlib
import os
from collections.abc import Iterator

import xarray as xr

from mitsonar.device.files import FilePath, check_readable, check_writable, checked_suffix
from mitsonar.hydrography.record import check

from . import lines
from .lines import Blocks, Place, Written

__all__ = ["SUFFIXES", "Blocks", "Place", "Written", "check_asked", "read_blocks", "sources", "stored", "write"]

BLOCK, BLOCK_BYTES = 64, 1 << 26   # pings that are read at once, and most of their bytes
_WRITERS = {".gsf": "gsf.gsf", ".kmall": "kongsberg.kmall", ".s7k": "s7k.s7k", ".nc": "netcdf", ".csv": "table",
            ".las": "las"}
SUFFIXES = tuple(_WRITERS)


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings in the format that the file suffix names.

    Parameters
    ----------
    blocks : xarray.Dataset or iterable of xarray.Dataset
        The line, whole or in blocks of pings, with the variables of `mitsonar.hydrography.record`.
    path : str or path
        Output file; its suffix is one of `SUFFIXES`.
    place : (latitude, longitude) [degrees], optional
        Position of x = y = 0, for scenes without a coordinate system. The default is 0, 0.
    start : str, optional
        UTC date and time of time 0, ISO 8601. The default is the start that the line states, else 1970.

    Returns
    -------
    Written
        Numbers of pings and soundings, and remarks on what the format cannot hold.

    Raises
    ------
    ValueError
        If the suffix is unknown, there is no ping, a block is not a line of soundings or differs from the first block,
        ``place`` or ``start`` is invalid or superfluous, or values do not fit the format.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.

    Examples
    --------
    ``mitsonar.io.survey_lines.write(mitsonar.soundings(scene), "line.gsf")``
    """
    suffix = checked_suffix(path, SUFFIXES)
    check_writable(path)
    return importlib.import_module(f"{__name__}.{_WRITERS[suffix]}").write(blocks, path, place=place, start=start)


def read_blocks(path: FilePath, *, column: bool = True, size: int = BLOCK) -> Iterator[xr.Dataset]:
    """Read a line of soundings block by block.

    Parameters
    ----------
    path : str or path
        An .all, .wcd, .kmall, .kmwcd, .gsf, .s7k, .xtf or .hsx file, or a record in netCDF.
    column : bool
        Read the water column and the snippets where there are any.
    size : int
        Number of pings of a block.

    Yields
    ------
    xarray.Dataset
        Record of soundings, see `mitsonar.hydrography.record`.

    Raises
    ------
    FileNotFoundError, PermissionError
        If the file does not exist or may not be read.
    ValueError
        If the file has another format, is damaged, or holds no soundings.
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
    """Check ``place`` and ``start`` of `write` before pings are computed, if possible against the first block.

    Raises
    ------
    ValueError
        As `write`.
    """
    lines.check_asked(place, start)
    if first is not None:
        lines.line_of(first, place=place, start=start)


def stored(path: FilePath, like: xr.Dataset) -> Iterator[xr.Dataset]:
    """Yield the pings of a line stored ping by ping (`io.records.ping_file`) in blocks; ``like`` is one of them."""
    import h5py

    moving = {str(name): variable for name, variable in like.variables.items() if "ping" in variable.dims}
    size = max(1, sum(variable.nbytes for variable in moving.values()))
    step = max(1, min(BLOCK, BLOCK_BYTES // size))
    with h5py.File(path) as file:
        for start in range(0, len(file["ping"]), step):
            values = {name: (variable.dims, file[name][start:start + step].astype(variable.dtype, copy=False),
                             variable.attrs) for name, variable in moving.items()}
            coords = {name: values.pop(name) for name in moving if name in like.coords}
            yield like.drop_vars(list(moving)).assign(values).assign_coords(coords)


def sources(path: FilePath) -> tuple[str, ...]:
    """Return the files that `read_blocks` would open: the soundings and, if present, the water column beside them.

    Raises
    ------
    FileNotFoundError, PermissionError, ValueError
        As `read_blocks`, if a file cannot be opened.
    """
    if os.path.splitext(path)[1].lower() == ".nc":
        check_readable(path, "the record", "a netCDF file")
        return (os.fspath(path),)
    from . import reading

    return reading.sources(path)
