"""Write images and signals to netCDF-4 files, and read them; `records` describes the contents."""
import contextlib
import errno
import gc
import json
import os
import shutil
import sys
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import xarray as xr

from mitsonar.device.files import FilePath, check_readable, replacing

from .complex_parts import OF
from .records import ENGINE, SonarImage, SonarSignals, check_numbers, decoded, encoded
from .self_contained import DataElsewhere, check_hdf5

__all__ = ["BESIDE", "WRITTEN", "damage_told", "dataset_in", "full_disk_told", "has_room", "opened", "packing", "read",
           "store", "write"]

WRITTEN = "pings_written"          # in a file that is written ping by ping: number of complete pings
MOST_UNPACKED = 1100               # times the size of a file; zlib packs zeros to a 1032nd
ALWAYS = 100_000_000               # bytes that any file may claim
LISTS = 250_000                    # bytes that HDF5 may write beside the numbers: names, attributes, indices
BESIDE = "attributes_beside"       # lists attributes that a convention adds to a file and the record does not have


def write(record: xr.Dataset | xr.DataArray, path: FilePath) -> None:
    """Write an image or signals to a netCDF-4 file, whole or not at all.

    Parameters
    ----------
    record : xarray.Dataset or xarray.DataArray
    path : str or path

    Raises
    ------
    ValueError, OSError
        If the file cannot be written there.
    TypeError
        If an attribute has a type that files cannot hold.
    """
    dataset = encoded(record)
    with replacing(path) as temporary, full_disk_told():
        store(dataset, temporary, encoding=packing(dataset))


def packing(dataset: xr.Dataset) -> dict[str, dict[str, Any]]:
    """Return the encoding of variables that makes a file small; complex signals get one chunk per ping."""
    packed: dict[str, dict[str, Any]] = {
        str(name): {"zlib": True, "complevel": 1} for name, variable in dataset.variables.items()
        if name not in dataset.indexes and variable.ndim and variable.dtype.kind in "biuf"}
    for name, encoding in packed.items():
        variable = dataset.variables[name]
        if variable.dims[0] == "ping" and OF in variable.attrs and variable.size:
            encoding["chunksizes"] = (1, *variable.shape[1:])
    return packed


@contextlib.contextmanager
def full_disk_told() -> Iterator[None]:
    """Raise `OSError` with its errno for a full disk, which HDF5 reports only in words."""
    try:
        yield
    except (OSError, RuntimeError) as error:
        if os.strerror(errno.ENOSPC) not in str(error):
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error


def store(dataset: xr.Dataset, path: Path, **options: Any) -> None:
    """Write a dataset unchanged to a netCDF-4 file; raise `OSError` if the disk has no room for the file.

    The process can crash after the disk has filled up under the HDF5 library. If little room is left, the file is
    therefore made in memory first, to learn its size. ``options`` are those of `xarray.Dataset.to_netcdf`.
    """
    options["engine"] = ENGINE
    if not has_room(path, 2 * dataset.nbytes) and not has_room(path, len(dataset.to_netcdf(**options))):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    dataset.to_netcdf(path, **options)


def has_room(path: Path, size: int) -> bool:
    """Return True if the disk has room for this many more bytes of a file, and for the lists that HDF5 adds."""
    return shutil.disk_usage(path.parent).free > size + LISTS


@contextlib.contextmanager
def _leftovers_hushed() -> Iterator[None]:
    """Collect objects that HDF5's wrappers leave half made when they fail, without their reports on the terminal."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        yield
    except Exception as error:
        while error is not None:                       # the frames of an exception keep such objects alive
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
        gc.collect()
        raise
    finally:
        sys.unraisablehook = hook


def read(path: FilePath) -> SonarImage | SonarSignals:
    """Read a file written by `write`, or by the ``to_netcdf`` of a record.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is not netCDF-4, or is incomplete.
    """
    check_readable(path, "the record", "a netCDF file")
    with dataset_in(path) as dataset:
        _check_claims(dataset, path)
        with damage_told(path):
            dataset.load()
    record = _decoded(_whole(dataset, path), path)
    check_numbers(record, path)
    return record


@contextlib.contextmanager
def opened(path: FilePath, *, unfinished: bool = False) -> Iterator[SonarImage | SonarSignals]:
    """Open a file written by `write` lazily: values are read when they are used.

    Parameters
    ----------
    path : str or path
    unfinished : bool
        Also open a file that is written ping by ping and not finished; the record then has only its complete pings.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file is not netCDF-4, or is damaged where it is read.
    """
    check_readable(path, "the record", "a netCDF file")
    with dataset_in(path) as dataset:
        _check_claims(dataset, path)
        try:
            yield _decoded(_whole(dataset, path, unfinished), path)
        except (OSError, RuntimeError) as error:
            # errors with a number are of another file: HDF5 gives only words
            if getattr(error, "errno", None) is not None or isinstance(error, (FileNotFoundError, PermissionError)):
                raise
            raise _unreadable(error, path) from None


def dataset_in(path: FilePath) -> xr.Dataset:
    """Open a netCDF-4 file lazily; raise `ValueError` if it refers to other files, is damaged, or is not netCDF-4."""
    with damage_told(path):
        check_hdf5(path)
        return xr.open_dataset(path, engine=ENGINE)


@contextlib.contextmanager
def damage_told(path: FilePath) -> Iterator[None]:
    """Raise `ValueError` for any error of the libraries within the block: a damaged file can lead to all kinds."""
    with _leftovers_hushed():
        try:
            yield
        except MemoryError:
            raise
        except DataElsewhere as error:
            raise ValueError(f"cannot read {path}: {error}") from None
        except Exception as error:
            raise _unreadable(error, path) from None


def _check_claims(dataset: xr.Dataset, path: FilePath) -> None:
    """Raise `ValueError` if a file claims more numbers than its bytes can hold, or contains broken text."""
    claimed, size = sum(variable.nbytes for variable in dataset.variables.values()), os.path.getsize(path)
    if claimed > max(ALWAYS, MOST_UNPACKED * size):
        raise ValueError(f"cannot read {path}: it claims {claimed:.2g} bytes of numbers, and has {size} bytes; write "
                         "it again.")
    every = [dataset.attrs, *(variable.attrs for variable in dataset.variables.values())]
    for word in (*map(str, dataset.variables), *(word for attrs in every for word in (*attrs, *attrs.values()))):
        if isinstance(word, str) and any("\ud800" <= letter <= "\udfff" for letter in word):
            raise ValueError(f"{path} is damaged: it holds {ascii(word[:40])}, which is no text; write it again.")

def _unreadable(error: Exception, path: FilePath) -> ValueError:
    """Return the error for a file that HDF5 does not open or read."""
    if getattr(error, "errno", None) == errno.EAGAIN:
        return ValueError(f"{path} is being written by another program; wait until it ends, or give another name.")
    said = " ".join(str(error).split()) or type(error).__name__
    return ValueError(f"{path} is no netCDF-4 file that can be read ({said}).")


def _whole(dataset: xr.Dataset, path: FilePath, unfinished: bool = False) -> xr.Dataset:
    """Return only the complete pings of a file that is written ping by ping; raise `ValueError` if some are missing."""
    if WRITTEN not in dataset:
        return dataset
    counter, pings = dataset[WRITTEN], dataset.sizes.get("ping", 0)
    if counter.shape or counter.dtype.kind not in "iu" or not 0 <= int(counter) <= pings:
        raise ValueError(f"{path} is damaged: its {WRITTEN} is no number of its {pings} pings; write it again.")
    whole = int(counter)
    if whole < pings and not unfinished:
        raise ValueError(f"{path} is not finished: it has {whole} of {pings} pings; the command that began it goes on "
                         "with it, and io.raw_echoes.opened(path, unfinished=True) reads what is there.")
    return dataset.drop_vars(WRITTEN).isel(ping=slice(0, whole))


def _decoded(dataset: xr.Dataset, path: FilePath) -> SonarImage | SonarSignals:
    """Return the record in a file's dataset; raise `ValueError` if parts of complex numbers do not fit."""
    try:
        if BESIDE in dataset.attrs:
            left = {BESIDE, *json.loads(dataset.attrs[BESIDE])}
            dataset = dataset.drop_attrs(deep=False).assign_attrs(
                {name: value for name, value in dataset.attrs.items() if name not in left})
        return decoded(dataset)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{path} holds parts that do not fit: {error}; write it again.") from None
