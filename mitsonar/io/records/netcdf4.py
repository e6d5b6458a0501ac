"""Write netCDF-4 files of many variables through h5py, in a third of the time that h5netcdf takes.

h5netcdf looks up the dimensions of a file again for each variable. Here every group gets its dimensions when all of its
variables are there (`Group.set_dimensions`). In HDF5 a dimension is a dataset, its scale, to which variables refer: the
variable of its name or, without one, a dataset whose name says that it is no variable.
"""
from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
import xarray as xr
from xarray import conventions

__all__ = ["Group", "conventional"]

NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable. {:9d}"
SHADOWED = "_nc4_non_coord_"       # before the name of a variable that has the name of a dimension


def conventional(dataset: xr.Dataset) -> tuple[Mapping[Any, xr.Variable], Mapping[Any, Any]]:
    """Return the variables and attributes of a dataset as xarray writes them to netCDF files."""
    return conventions.cf_encoder(*conventions.encode_dataset_coordinates(dataset))


class Group:
    """Write a group of a netCDF-4 file; the root group comes first."""

    def __init__(self, group: h5py.Group, above: Group | None = None):
        self._group, self._above = group, above
        self._variables: list[tuple[h5py.Dataset, tuple[str, ...]]] = []
        self._scales: dict[str, tuple[h5py.Dataset, int]] = {} if above is None else dict(above._scales)
        self._numbers: itertools.count[int] = itertools.count() if above is None else above._numbers
        if above is None:
            properties = f"version=2,hdf5={h5py.version.hdf5_version},h5py={h5py.__version__}".encode("ascii")
            group.attrs["_NCProperties"] = np.bytes_(properties)

    def group(self, name: str, attrs: Mapping[str, Any] | None = None) -> Group:
        """Make a group in this one, whose dimensions are set."""
        made = Group(self._group.create_group(name, track_order=True), self)
        made.set_attributes(attrs or {})
        return made

    def set_attributes(self, attrs: Mapping[Any, Any]) -> None:
        """Set attributes of the group."""
        _set(self._group, attrs)

    def put(self, name: str, dims: tuple[Any, ...], values: np.ndarray, attrs: Mapping[Any, Any],
            encoding: Mapping[str, Any] | None = None, *, growing: bool = False) -> h5py.Dataset:
        """Write a variable; ``encoding`` is that of xarray, and the first dimension can be ``growing``."""
        attrs, packed = dict(attrs), dict(encoding or {})
        if (texts := values.dtype.kind in "OU"):
            values = values.astype(object)
        fill = attrs.pop("_FillValue", None)
        if packed.pop("zlib", False):
            packed |= {"compression": "gzip", "compression_opts": packed.pop("complevel")}
        chunks = packed.pop("chunksizes", None)
        if 0 in values.shape and packed:
            chunks = chunks or tuple(max(1, size) for size in values.shape)
        most = tuple(None if not size or growing and not axis else size for axis, size in enumerate(values.shape))
        made = self._group.create_dataset(
            name, data=values, dtype=h5py.string_dtype() if texts else values.dtype, fillvalue=fill,
            chunks=chunks, maxshape=most if None in most else None, track_order=True, **packed)
        self._variables.append((made, tuple(map(str, dims))))
        _set(made, attrs if fill is None else {"_FillValue": values.dtype.type(fill), **attrs})
        return made

    def lay_out(self, name: str, dims: tuple[Any, ...], shape: tuple[int, ...], dtype: np.dtype,
                attrs: Mapping[Any, Any], **storage: Any) -> None:
        """Make room for a variable; ``storage`` are options of `h5py.Group.create_dataset`."""
        made = self._group.create_dataset(name, shape, dtype, track_order=True, **storage)
        self._variables.append((made, tuple(map(str, dims))))
        _set(made, attrs)

    def set_dimensions(self) -> None:
        """Make the scales of the dimensions that the group's variables have and groups above lack; attach them all."""
        own = {dims[0]: made for made, dims in self._variables if dims == (made.name.rpartition("/")[-1],)}
        for made, dims in self._variables:
            for dim, size in zip(dims, made.shape):
                if dim not in self._scales:
                    self._scales[dim] = _scale(self._group, dim, own.get(dim), size), next(self._numbers)
                    self._scales[dim][0].attrs["_Netcdf4Dimid"] = np.int32(self._scales[dim][1])
        for made, dims in self._variables:
            if not dims:
                continue
            made.attrs["_Netcdf4Coordinates"] = np.array([self._scales[dim][1] for dim in dims], np.int32)
            if made in own.values():
                continue
            for number, dim in enumerate(dims):
                made.dims[number].attach_scale(self._scales[dim][0])
            made.attrs["_Netcdf4Dimid"] = np.int32(self._scales[dims[0]][1])


def _scale(group: h5py.Group, name: str, variable: h5py.Dataset | None, size: int) -> h5py.Dataset:
    if variable is not None:
        variable.make_scale(name)
        return variable
    if name in group:
        group.move(name, SHADOWED + name)
    scale = group.create_dataset(name, (size,), ">f4", maxshape=None if size else (None,), track_order=True)
    scale.make_scale(NO_VARIABLE.format(size))
    return scale


def _set(holder: h5py.Group | h5py.Dataset, attrs: Mapping[Any, Any]) -> None:
    for key, value in attrs.items():
        scalar = np.isscalar(value) and not isinstance(value, (str, bytes))
        holder.attrs[str(key)] = np.atleast_1d(value) if scalar else value
