"""Images and signals in netCDF-4 files; see `records` for what stands in them."""
import errno
import os

import xarray as xr

from .files import FilePath, check_readable, replacing
from .records import ENGINE, SonarImage, SonarSignals, decoded, encoded

__all__ = ["read", "write"]


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
    packed = {name: {"zlib": True, "complevel": 1} for name, variable in dataset.data_vars.items()
              if variable.ndim and variable.dtype.kind in "biuf"}
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine=ENGINE, encoding=packed)
        except (OSError, RuntimeError) as error:
            # HDF5 tells the reason in words alone
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
        If it is no netCDF-4 file.
    """
    check_readable(path, "the record", "a netCDF file")
    try:
        with xr.open_dataset(path, engine=ENGINE) as dataset:
            dataset.load()
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(f"{path} is no netCDF-4 file that can be read ({error}).") from None
    return decoded(dataset)
