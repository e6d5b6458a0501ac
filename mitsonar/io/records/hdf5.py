"""Write datasets as plain HDF5 with complex numbers in one piece, for MATLAB, h5py and SAS codes.

A variable is an HDF5 dataset of its name, its dimensions are HDF5 dimension scales, and units and metadata are
attributes. Complex numbers are a compound of ``r`` and ``i``, as in h5py: ``h5py.File(path)["image"][:]`` is
complex64, and in MATLAB ``s = h5read(path, "/image")`` gives ``complex(s.r, s.i)`` with the dimensions in reverse
order. Attributes that are not plain values are JSON as in netCDF files (`records`). `mitsonar.read` restores
the dataset.
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
        If an attribute has a type that files cannot hold.
    """
    dataset = encoded(record, whole=True)
    with replacing(path) as temporary, full_disk_told():
        store(dataset, temporary, encoding=packing(dataset))
