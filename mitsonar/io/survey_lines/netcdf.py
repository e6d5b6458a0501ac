"""A line of soundings as netCDF-4: the record, bit for bit, and beside it the groups of SONAR-netCDF4.

The record's variables stand in the root, where `mitsonar.read` and xarray find them. What the convention calls by other
names or in other units stands in its groups, see `sonar_netcdf4`. Pings are appended block by block.
"""
from __future__ import annotations

import errno
import json
import os
from pathlib import Path

import h5netcdf
import h5py
import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath, replacing

from ..records.netcdf import BESIDE, full_disk_told, has_room, packing, store
from ..records.records import encoded
from .lines import Blocks, Place, Written, line_of
from .passage import passage_of
from .sonar_netcdf4 import BACKSCATTER, add_groups, root_attributes

__all__ = ["write"]

CHUNK_BYTES, CHUNK_PINGS = 1 << 18, 512
_SHADOWED = "_nc4_non_coord_"             # before the name of a variable that a dimension has too


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as netCDF-4; arguments, result and errors as `mitsonar.io.survey_lines.write`.

    An attribute of a kind that files cannot hold is a TypeError.
    """
    line, some = line_of(blocks, place=place, start=start)
    first = next(some)
    if start is not None:
        first = first.assign_attrs(start=start)
    number, found = first.sizes["ping"], int(first["valid"].sum())
    with replacing(path) as temporary, full_disk_told():
        record = encoded(first)
        beside = {name: value for name, value in root_attributes(line).items() if name not in record.attrs}
        record.attrs = record.attrs | beside | {BESIDE: json.dumps(list(beside))}
        store(record, temporary, unlimited_dims=("ping",), encoding=_encoding(record))
        _check_room(temporary, 0)
        with h5py.File(temporary, "a", rdcc_nbytes=2 * CHUNK_BYTES) as file:
            growing = {str(name): file[_SHADOWED + str(name) if _SHADOWED + str(name) in file else str(name)]
                       for name, variable in first.variables.items() if variable.dims[:1] == ("ping",)}
            for block in some:
                _check_room(temporary, block.nbytes)
                number, found = number + _append(growing, block, number), found + int(block["valid"].sum())
            _settle(file, number)
        with h5netcdf.File(temporary, "a") as file:
            add_groups(file, line, passage_of(line))
        if "column_level_db" in record:
            with h5py.File(temporary, "a") as file:    # a second name of the same data, not a copy
                file[BACKSCATTER] = file["column_level_db"]
    return Written(pings=number, soundings=found, words=(line.placed,) if line.placed else ())


def _check_room(path: Path, size: int) -> None:
    """Raise the error of a full disk before HDF5 meets one: it can end the process."""
    if not has_room(path, size):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _encoding(record: xr.Dataset) -> dict[str, dict[str, bool | int | tuple[int, ...]]]:
    packed: dict[str, dict[str, bool | int | tuple[int, ...]]] = {}
    for name, kept in packing(record).items():
        one = packed[name] = {**kept}
        variable = record.variables[name]
        if variable.dims[:1] == ("ping",):
            others = variable.shape[1:]
            size = max(1, variable.dtype.itemsize * int(np.prod(others)))
            most = int(np.clip(CHUNK_BYTES // size, 1, CHUNK_PINGS))
            one["chunksizes"] = (most, *(max(1, other) for other in others))
    return packed


def _settle(file: h5py.File, pings: int) -> None:
    """Give the dimension ``ping`` its final size: h5netcdf reads what may grow ten times more slowly."""
    growing = file["ping"]
    users = [name for name, one in file.items() if isinstance(one, h5py.Dataset) and name != "ping" and one.ndim
             and len(one.dims[0]) and one.dims[0][0] == growing]
    kept = {name: growing.attrs[name] for name in ("_Netcdf4Dimid",) if name in growing.attrs}
    for name in users:
        file[name].dims[0].detach_scale(growing)
    del file["ping"]
    settled = file.create_dataset("ping", (pings,), ">f4")
    settled.make_scale(f"This is a netCDF dimension but not a netCDF variable. {pings:9d}")
    for name, value in kept.items():
        settled.attrs[name] = value
    for name in users:
        file[name].dims[0].attach_scale(settled)


def _append(growing: dict[str, h5py.Dataset], block: xr.Dataset, at: int) -> int:
    pings = block.sizes["ping"]
    # The data sets stay open, so that a chunk is packed once it is full and not at every block.
    for name, one in growing.items():
        one.resize(at + pings, axis=0)
        values = block[name].values
        one[at:at + pings] = values.astype(np.int8) if values.dtype == bool else values
    return pings
