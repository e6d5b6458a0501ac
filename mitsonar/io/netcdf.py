"""Images and signals in netCDF-4 files; see `records` for what stands in them."""
import contextlib
import errno
import json
import os
from collections.abc import Iterator

import xarray as xr

from .files import FilePath, check_readable, replacing
from .records import ENGINE, SonarImage, SonarSignals, decoded, encoded

__all__ = ["BESIDE", "full_disk_told", "opened", "packing", "read", "write"]

BESIDE = "attributes_beside"       # lists attributes of a file that are not the record's, but of a convention


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
        If an attribute is of a kind that files cannot hold.
    """
    dataset = encoded(record)
    with replacing(path) as temporary, full_disk_told():
        dataset.to_netcdf(temporary, engine=ENGINE, encoding=packing(dataset))


def packing(dataset: xr.Dataset) -> dict[str, dict[str, bool | int]]:
    """Give the encoding of a dataset's variables that makes a file small."""
    return {str(name): {"zlib": True, "complevel": 1} for name, variable in dataset.variables.items()
            if name not in dataset.indexes and variable.ndim and variable.dtype.kind in "biuf"}


@contextlib.contextmanager
def full_disk_told() -> Iterator[None]:
    """Give the error of a full disk its number, which HDF5 tells in words alone.

    Raises
    ------
    OSError
        If the disk fills up within the block.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        if os.strerror(errno.ENOSPC) not in str(error):
            raise
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error


def read(path: FilePath) -> SonarImage | SonarSignals:
    """Read what `write`, or the ``to_netcdf`` of a record, wrote.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no netCDF-4 file, or holds half of something.
    """
    check_readable(path, "the record", "a netCDF file")
    try:
        with xr.open_dataset(path, engine=ENGINE) as dataset:
            dataset.load()
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise ValueError(f"{path} is no netCDF-4 file that can be read ({error}).") from None
    return _decoded(dataset, path)


@contextlib.contextmanager
def opened(path: FilePath) -> Iterator[SonarImage | SonarSignals]:
    """Open what `write` wrote without reading all of it: values come from the file when they are used.

    Parameters
    ----------
    path : str or path

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no netCDF-4 file, or damaged where it is read.
    """
    check_readable(path, "the record", "a netCDF file")
    refused = f"{path} is no netCDF-4 file that can be read"
    try:
        dataset = xr.open_dataset(path, engine=ENGINE)
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise ValueError(f"{refused} ({error}).") from None
    with dataset:
        try:
            yield _decoded(dataset, path)
        except (OSError, RuntimeError) as error:
            if getattr(error, "errno", None) is not None:  # it is of another file: HDF5 gives words alone
                raise
            raise ValueError(f"{refused} ({error}).") from None


def _decoded(dataset: xr.Dataset, path: FilePath) -> SonarImage | SonarSignals:
    """The record in a dataset of a file; `ValueError` where parts of complex numbers do not fit."""
    try:
        return decoded(_own(dataset))
    except ValueError as error:
        raise ValueError(f"{path} holds parts that do not fit: {error}; write it again.") from None


def _own(dataset: xr.Dataset) -> xr.Dataset:
    """The dataset without attributes that are not the record's."""
    if BESIDE not in dataset.attrs:
        return dataset
    left = {BESIDE, *json.loads(dataset.attrs[BESIDE])}
    return dataset.drop_attrs(deep=False).assign_attrs(
        {name: value for name, value in dataset.attrs.items() if name not in left})
