"""Write and read raw echoes of a synthetic aperture in a netCDF-4 file, ping by ping.

A netCDF-4 file is an HDF5 file, so xarray, MATLAB and h5py read it without mitsonar. ``signal_real`` and
``signal_imag`` (ping, rx, sample) are float32, one ping after the other and not compressed, because noise does not
shrink; the file can therefore be mapped into memory. The other variables have the names of `synthetic_aperture.record`.

While it is written the file is called FILE.part. Its room is allocated at the start, so a ping changes only its own
bytes; the variable ``pings_written``, the number of complete pings, is raised once these are on the disk. After any
interruption the file can be opened, and `write` continues at the first missing ping. The finished file has the same
bytes as without an interruption.
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
    """Write raw echoes ping by ping, or continue an interrupted file of the same echoes.

    Parameters
    ----------
    pings_from : callable(start) -> iterator of xarray.Dataset
        Returns the pings from number ``start`` on, each a record of one ping. Variables without ``ping`` are the same
        in all.
    path : str or path
        Finished file; until then its name has .part at the end.
    count : int
        Number of all pings.
    progress : callable(done, total) or None
        Called after every ping.

    Returns
    -------
    int
        Number of the first ping that was written now; above 0 if an earlier file was continued.

    Raises
    ------
    ValueError
        If an interrupted file has other echoes, or `pings_from` yields no raw echoes, too few pings or unlike ones.
    FileNotFoundError, PermissionError
        If the file cannot be written there.
    OSError
        If the disk has not enough room; complete pings are kept.
    """
    target = check_writable(path)
    if count < 1:
        raise ValueError(f"raw echoes have at least one ping, got {count}")
    return fill(pings_from, part_of(target), count=count, check=check_raw, progress=progress, target=target)


def written(path: FilePath) -> int:
    """Return the number of complete pings in an interrupted file of that name, or 0 if there is none.

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
        raise ValueError(f"cannot go on with {part}: {str(error).rstrip('.')}; remove it, or give another name."
                         ) from None


@contextlib.contextmanager
def opened(path: FilePath, *, unfinished: bool = False) -> Iterator[SonarImage]:
    """Open a file of raw echoes lazily: ``signal`` is read when it is used.

    Parameters
    ----------
    path : str or path
    unfinished : bool
        Also open an interrupted file; the record then has only its complete pings, which may be none.

    Yields
    ------
    SonarImage
        An `xarray.Dataset` as `synthetic_aperture.record` describes it.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file has no raw echoes, is damaged where it is read, or is not finished.
    """
    check_readable(path, "the raw echoes", "a netCDF file of raw echoes")
    with netcdf.opened(path, unfinished=unfinished) as record:
        yield _checked(record, path)


def pings(record: xr.Dataset, start: int = 0) -> Iterator[xr.Dataset]:
    """Yield the pings of a record one by one, loaded; only one ping of an opened file is in memory.

    Parameters
    ----------
    record : xarray.Dataset
    start : int
        Number of the first ping.
    """
    still = record.drop_vars([name for name, variable in record.variables.items() if "ping" in variable.dims]).load()
    for number in range(start, record.sizes["ping"]):
        ping = record[[name for name in record.variables if name not in still.variables]]
        ping = ping.isel(ping=slice(number, number + 1)).load()
        yield still.assign(ping.data_vars).assign_coords(ping.coords).assign_attrs(record.attrs)


def read(path: FilePath) -> SonarImage:
    """Read raw echoes completely; raise the errors of `opened`."""
    check_readable(path, "the raw echoes", "a netCDF file of raw echoes")
    return _checked(netcdf.read(path), path)


def _checked(record: SonarImage | SonarSignals, path: FilePath) -> SonarImage:
    """Return the record, or raise `ValueError` if it is not raw echoes."""
    if not isinstance(record, SonarImage):
        raise ValueError(f"{path} holds element signals of an array, and raw echoes of a synthetic aperture were "
                         "wanted; write them by `mitsonar signals` of a synthetic_aperture sensor.")
    try:
        check_raw(record)
    except ValueError as error:
        raise ValueError(f"{path} holds no raw echoes: {str(error).rstrip('.')}.") from None
    return record
