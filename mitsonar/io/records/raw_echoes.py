"""Raw echoes of a synthetic aperture in a netCDF-4 file, written and read ping by ping.

A netCDF-4 file is an HDF5 file, so that xarray, MATLAB, h5py and all else read it without mitsonar. ``signal_real`` and
``signal_imag`` (ping, rx, sample) are float32 and lie in the file as they lie in memory, one ping after the other, not
packed: noise does not shrink, and whoever wants may map them. Everything else stands beside them by the names of
`synthetic_aperture.record`.

While it is written the file is called FILE.part. All its places are given away at the start, so a ping changes no more
than its own bytes; the number of pings that are whole, the variable ``pings_written``, is raised once these are on
the disk. Whatever ends the writing, the file can be opened, and `write` goes on at the first ping that is missing. The
finished file has the same bytes as if nothing had come between.
"""
from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

import xarray as xr

from mitsonar.device.files import FilePath, check_readable, check_writable
from mitsonar.synthetic_aperture.record import check_raw

from . import netcdf
from .ping_file import fill, part_of, size_of
from .records import SonarImage, SonarSignals

__all__ = ["opened", "part_of", "pings", "read", "size_of", "write", "written"]


def write(pings_from: Callable[[int], Iterator[xr.Dataset]], path: FilePath, *, count: int,
          progress: Callable[[int, int], None] | None = None) -> int:
    """Write raw echoes ping by ping, or go on where the writing of the same echoes was interrupted.

    Parameters
    ----------
    pings_from : callable(start) -> iterator of xarray.Dataset
        The pings from that number on, each a record of one ping, all with the same variables without ``ping``.
    path : str or path
        The finished file; meanwhile it has .part at its end.
    count : int
        Of all pings.
    progress : callable(done, total) or None
        Called after every ping.

    Returns
    -------
    int
        Number of the first ping that was written now; above 0 if an earlier writing goes on.

    Raises
    ------
    ValueError
        If what is there is of other echoes, or `pings_from` gives no raw echoes, too few pings or unlike ones.
    FileNotFoundError, PermissionError
        If the file cannot be written there.
    OSError
        If the disk has not enough room; the pings that are whole stay.
    """
    target = check_writable(path)
    if count < 1:
        raise ValueError(f"raw echoes have at least one ping, got {count}")
    return fill(pings_from, part_of(target), count=count, check=check_raw, progress=progress, target=target)


def written(path: FilePath) -> int:
    """Return the number of whole pings that an interrupted writing left for a file of that name; 0 if there was none.

    Raises
    ------
    ValueError
        If FILE.part is no such file.
    """
    part = part_of(check_writable(path))
    if not part.exists():
        return 0
    try:
        with opened(part, unfinished=True) as record:
            return record.sizes["ping"]
    except FileNotFoundError:                          # another program has just finished it
        return 0
    except ValueError as error:
        why = str(error).rstrip(".")
        raise ValueError(f"cannot go on with {part}: {why}; remove it, or give another name.") from None


@contextlib.contextmanager
def opened(path: FilePath, *, unfinished: bool = False) -> Iterator[SonarImage]:
    """Open a file of raw echoes; ``signal`` comes from the file where it is used.

    Parameters
    ----------
    path : str or path
    unfinished : bool
        Also open what an interrupted writing left; the record has the pings that are whole, which may be none.

    Yields
    ------
    SonarImage
        An `xarray.Dataset` as `synthetic_aperture.record` says.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it holds no raw echoes, is damaged where it is read, or is not finished.
    """
    check_readable(path, "the raw echoes", "a netCDF file of raw echoes")
    with netcdf.opened(path, unfinished=unfinished) as record:
        yield _checked(record, path)


def pings(record: xr.Dataset, start: int = 0) -> Iterator[xr.Dataset]:
    """Return the pings of a record one by one, in memory; of an opened file no more than one is held.

    Parameters
    ----------
    record : xarray.Dataset
    start : int
        The first of them.
    """
    still = record.drop_vars([name for name, variable in record.variables.items() if "ping" in variable.dims]).load()
    for number in range(start, record.sizes["ping"]):
        one = record[[name for name in record.variables if name not in still.variables]]
        one = one.isel(ping=slice(number, number + 1)).load()
        yield still.assign(one.data_vars).assign_coords(one.coords).assign_attrs(record.attrs)


def read(path: FilePath) -> SonarImage:
    """Read raw echoes, all at once; raises as `opened`."""
    check_readable(path, "the raw echoes", "a netCDF file of raw echoes")
    return _checked(netcdf.read(path), path)


def _checked(record: SonarImage | SonarSignals, path: FilePath) -> SonarImage:
    """The record, or `ValueError` if it is no raw echoes."""
    if not isinstance(record, SonarImage):
        raise ValueError(f"{path} holds element signals of an array, and raw echoes of a synthetic aperture were "
                         "wanted; write them by `mitsonar signals` of a synthetic_aperture sensor.")
    try:
        check_raw(record)
    except ValueError as error:
        raise ValueError(f"{path} holds no raw echoes: {error}.") from None
    return record
