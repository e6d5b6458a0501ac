"""A netCDF-4 file whose places are all given away at the start, and filled ping by ping.

HDF5 keeps lists of where things lie; a file whose lists are half written cannot be opened. So the file is made whole,
with room for every ping, and closed. From then on only numbers change, in place: those of a ping, and, once these are
on the disk, the count of whole pings.
"""
from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import xarray as xr

from .files import FULL, replacing
from .netcdf import BESIDE, WRITTEN, packing
from .records import ENGINE, plain_value
from .self_contained import DataElsewhere, check_hdf5

__all__ = ["PingFile", "lay_out", "part_of"]

RUN = "run"                        # attribute: a digest of all that the pings have in common
TOLD = ("seed", "file", "parameters", "sonar", "versions", "scene")     # what tells runs apart in words, in this order


def part_of(path: Path) -> Path:
    """Give the name of a file while it is written."""
    return path.with_name(path.name + ".part")


def lay_out(path: Path, first: xr.Dataset, count: int) -> None:
    """Make the file with room for all pings and none of them, whole or not at all.

    Parameters
    ----------
    path : pathlib.Path
    first : xarray.Dataset
        A record of one ping, as `records.encoded` gives it.
    count : int
        Of all pings.

    Raises
    ------
    ValueError
        If a variable over ``ping`` is text, or has ``ping`` in another place than the first; or if another program has
        made the file meanwhile.
    OSError
        If the file cannot be written there.
    """
    import h5netcdf
    import h5py

    names = _moving(first)
    still = first.drop_vars(names)
    coords = [str(name) for name in names if name in first.coords and name != "ping"]
    still = still.assign_attrs({**first.attrs, RUN: _digest(first), BESIDE: json.dumps([RUN])})
    early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    early.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    with _alone(path), replacing(path, anew=True) as temporary:
        still.to_netcdf(temporary, engine=ENGINE, encoding=packing(still))
        with h5netcdf.File(temporary, "r+") as file:
            file.dimensions["ping"] = count
            for name in names:
                variable = first.variables[name]
                stored = file.create_variable(str(name), variable.dims, variable.dtype, dcpl=early.copy())
                for key, value in variable.attrs.items():
                    stored.attrs[key] = value
            counter = file.create_variable(WRITTEN, (), np.dtype(np.int64), dcpl=early.copy())
            counter[...] = 0
            counter.attrs["long_name"] = "pings that are whole, from the first on"
            if coords:
                file.attrs["coordinates"] = " ".join([*file.attrs.get("coordinates", "").split(), *coords])


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Raise `ValueError` where another program makes, fills or has just finished the same file."""
    try:
        yield
    except (BlockingIOError, FileExistsError, FileNotFoundError):
        raise ValueError(f"{path} is being written by another program; wait until it ends, or give another name."
                         ) from None


class PingFile:
    """A file of `lay_out`, open to be filled.

    Parameters
    ----------
    path : pathlib.Path
    count : int
        Of all pings.

    Raises
    ------
    ValueError
        If it has another number of pings, or another program writes it.
    """

    def __init__(self, path: Path, count: int):
        import h5py

        self.path, self.count = path, count
        try:
            with _alone(path):
                check_hdf5(path)
                self.file = h5py.File(path, "r+")
        except DataElsewhere as error:
            raise ValueError(f"cannot go on with {path}: {error}") from None
        except OSError as error:
            raise ValueError(f"{path} is damaged ({error}); remove it.") from None
        if WRITTEN not in self.file or RUN not in self.file.attrs:
            self.file.close()
            raise ValueError(f"{path} is whole, or of another program; remove it, or give another name.")
        self.written = int(self.file[WRITTEN][()])
        there = len(self.file["ping"]) if "ping" in self.file else -1
        if there != count:
            self.file.close()
            raise ValueError(f"{path} is of {there} pings, and these echoes have {count}; remove it, or give another "
                             "name.")

    def __enter__(self) -> PingFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.file.close()

    def check_run(self, first: xr.Dataset) -> None:
        """Refuse a ping, as `records.encoded` gives it, that is of other echoes than those in the file.

        Raises
        ------
        ValueError
            With what is not the same.
        """
        if self.file.attrs.get(RUN) == _digest(first):
            return
        for name in (*TOLD, *(key for key in first.attrs if key not in TOLD)):
            there, here = (np.asarray(attrs[name]).reshape(-1).tolist() if name in attrs else None
                           for attrs in (self.file.attrs, first.attrs))
            if there and here and there != here:
                (there, *_), (here, *_) = there, here
                words = "" if max(len(str(there)), len(str(here))) > 40 else f" ({there}, and here it is {here})"
                raise ValueError(f"{self.path} was begun with another {name}{words}; remove it, or give another name.")
        raise ValueError(f"{self.path} was begun with another scene; remove it, or give another name.")

    def put(self, number: int, one: xr.Dataset) -> None:
        """Write a ping, as `records.encoded` gives it, and once it is on the disk the count.

        Raises
        ------
        ValueError
            If its variables are not those of the file.
        OSError
            If the disk is full; the pings before stay.
        """
        for name in _moving(one):
            found, place = one.variables[name], self.file.get(str(name))
            if place is None or found.shape != (1, *place.shape[1:]) or found.dtype != place.dtype:
                there = "nothing" if place is None else f"{place.dtype} {place.shape[1:]}"
                raise ValueError(f"{name} of ping {number} is {found.dtype} {found.shape[1:]}, and the file has room "
                                 f"for {there}")
        try:
            for name in _moving(one):
                self.file[str(name)][number] = one.variables[name].values[0]
            self._to_disk()
            self.file[WRITTEN][()] = number + 1
            self._to_disk()
        except (OSError, RuntimeError) as error:
            raise self._told(error, number) from error
        self.written = number + 1

    def finish(self, target: Path) -> None:
        """Give the file its final name while it is still locked: nobody else can begin to write it.

        Raises
        ------
        ValueError
            If another program has taken the file away, where files cannot be locked.
        """
        with _alone(self.path):
            os.replace(self.path, target)

    def _to_disk(self) -> None:
        self.file.flush()
        try:
            os.fsync(self.file.id.get_vfd_handle())
        except OSError as error:
            if error.errno not in (errno.EINVAL, errno.ENOTSUP):       # some network file systems cannot
                raise

    def _told(self, error: Exception, number: int) -> Exception:
        """A full disk in words; HDF5 does not always give it a number."""
        for code, words in FULL.items():
            if getattr(error, "errno", None) == code or os.strerror(code) in str(error):
                plain = OSError(f"cannot write ping {number}: {words}; {self.path} keeps the pings before it, free "
                                "some space and run it again.")
                plain.errno = code
                return plain
        return error


def _moving(first: xr.Dataset) -> list[Any]:
    """Names of the variables over pings."""
    names = [name for name, variable in first.variables.items() if "ping" in variable.dims]
    for name in names:
        variable = first.variables[name]
        if variable.dims[0] != "ping" or variable.dtype.kind not in "biuf":
            raise ValueError(f"{name} is {variable.dtype} over {variable.dims}, and what changes from ping to ping are "
                             "numbers with ping as their first dimension")
    return names


def _digest(first: xr.Dataset) -> str:
    """What all pings of one run have in common, and no other run has."""
    digest = hashlib.sha256()
    digest.update(json.dumps({str(name): plain_value(value) for name, value in first.attrs.items()}, default=str,
                             sort_keys=True).encode())
    for name in sorted(map(str, first.variables)):
        variable = first.variables[name]
        moves = "ping" in variable.dims
        about = (name, variable.dims, variable.dtype.str, variable.shape[moves:])
        digest.update(repr(about).encode())
        if not moves:
            digest.update(np.ascontiguousarray(variable.values).tobytes() if variable.dtype.kind != "O"
                          else repr(variable.values.tolist()).encode())
    return digest.hexdigest()
