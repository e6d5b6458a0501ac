"""Datasets as plain HDF5, for MATLAB, h5py and SAS codes: complex numbers in one piece.

A variable is an HDF5 dataset of its name, its dimensions are HDF5 dimension scales, units and what else is known are
attributes. Complex numbers are a compound of ``r`` and ``i``, as h5py has them: ``h5py.File(path)["image"][:]`` is
complex64, and MATLAB's ``s = h5read(path, "/image")`` gives ``complex(s.r, s.i)`` with the dimensions in reverse order.
Attributes that are no plain value are JSON as in netCDF files (`records`). `mitsonar.read` gives what was written.
"""
from __future__ import annotations

import xarray as xr

from mitsonar.device.files import FilePath, replacing

from .netcdf import full_disk_told, packing, store
from .records import encoded

__all__ = ["SUFFIXES", "write"]

SUFFIXES = (".h5", ".hdf5")


def write(record: xr.Dataset, path: FilePath) -> None:
    """Write a dataset as HDF5, whole or not at all.

    Parameters
    ----------
    record : xarray.Dataset
    path : str or path

    Raises
    ------
    ValueError, OSError
        If the file cannot be written there.
    TypeError
        If an attribute is of a kind that files cannot hold.
    """
    dataset = encoded(record, whole=True)
    encoding = packing(dataset)
    with replacing(path) as temporary, full_disk_told():
        store(dataset, temporary, encoding=encoding)
