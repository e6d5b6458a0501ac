"""Write a netCDF-4 file ping by ping, with the room for every ping allocated at the start.

HDF5 keeps lists of where data lie, and a file whose lists are half written cannot be opened. The file is therefore
first made complete, with room for every ping, and closed. From then on only numbers change, in place: those of a ping
and, once these are on the disk, the count of complete pings.
"""
from __future__ import annotations

import contextlib
import errno
import hashlib
import itertools
import json
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.files import FULL, replacing

from .netcdf import BESIDE, WRITTEN, packing
from .records import JSON, encoded, plain_value
from .self_contained import DataElsewhere, check_hdf5

RUN = "run"                        # attribute: a digest of everything that the pings have in common
TOLD = ("seed", "file", "parameters", "sonar", "versions", "scene")     # differences between runs that errors name


class OtherRun(ValueError):
    """Error of an unfinished file whose pings are not those of this run."""


def part_of(path: Path) -> Path:
    """Return the name of a file while it is written."""
    return path.with_name(path.name + ".part")


def size_of(first: xr.Dataset, count: int) -> int:
    """Return the size of ``count`` pings like the first [bytes], to within some thousands."""
    return sum(int(variable.nbytes) * (count if "ping" in variable.dims else 1)
               for variable in first.variables.values())


def fill(pings_from: Callable[[int], Iterator[xr.Dataset]], path: Path, *, count: int,
         check: Callable[[xr.Dataset], object], progress: Callable[[int, int], None] | None = None,
         target: Path | None = None) -> int:
    """Write pings to a file of `lay_out`, or continue an interrupted file of the same pings; return the first written.
    """
    start = 0
    if path.exists():
        with PingFile(path, count) as file:
            # if all pings are there, the last is made again to check that they belong to this run
            start = min(file.written, count - 1)
    made = iter(pings_from(start))
    first = next(made, None)
    if first is None:
        raise ValueError(f"there is no ping {start}, and {count} were announced")
    check(first)
    if not path.exists():
        _check_room(first, count, path)
        lay_out(path, encoded(first), count)
    with PingFile(path, count) as file:
        file.check_run(encoded(first))
        for number, ping in enumerate(itertools.chain([first], made), start):
            if number == count:
                raise ValueError(f"there are more pings than the {count} that were announced")
            file.put(number, encoded(ping[[name for name, values in ping.variables.items() if "ping" in values.dims]]))
            if progress is not None:
                progress(number + 1, count)
        if file.written < count:
            raise ValueError(f"{count} pings were announced, and there were {file.written}")
        if target is not None:
            file.finish(target)
    return start


def lay_out(path: Path, first: xr.Dataset, count: int) -> None:
    """Make the file with room for all pings and none of them, completely or not at all."""
    import h5py

    from . import netcdf4

    names = _moving(first)
    still = first.drop_vars(names)
    coords = [str(name) for name in names if name in first.coords and name != "ping"]
    packed = packing(still)
    variables, attrs = netcdf4.conventional(still.assign_attrs({
        **first.attrs, RUN: _digest(first), BESIDE: json.dumps([RUN])}))
    if coords:
        attrs = {**attrs, "coordinates": " ".join([*attrs.get("coordinates", "").split(), *coords])}
    early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    early.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    with _alone(path), replacing(path, anew=True) as temporary, h5py.File(temporary, "w", track_order=True) as file:
        root = netcdf4.Group(file)
        root.set_attributes(attrs)
        for name, variable in variables.items():
            root.put(str(name), variable.dims, variable.values, variable.attrs, packed.get(str(name)))
        for name in names:
            variable = first.variables[name]
            dtype = _stored(variable)
            root.lay_out(str(name), variable.dims, (count, *variable.shape[1:]), dtype, variable.attrs if
                         dtype == variable.dtype else {**variable.attrs, "dtype": "bool"}, dcpl=early.copy())
        root.put(WRITTEN, (), np.array(0), {"long_name": "pings that are whole, from the first on"})
        root.set_dimensions()


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Raise `ValueError` if another program makes, fills or has just finished the same file."""
    try:
        yield
    except (BlockingIOError, FileExistsError, FileNotFoundError):
        raise ValueError(f"{path} is being written by another program; wait until it ends, or give another name."
                         ) from None


class PingFile:
    """Fill a file of `lay_out` with pings."""

    def __init__(self, path: Path, count: int):
        import h5py

        self.path, self.count = path, count
        try:
            with _alone(path):
                check_hdf5(path)
                self.file = h5py.File(path, "r+")
        except DataElsewhere as error:
            raise ValueError(f"cannot go on with {path}: {error}") from None
        except (OSError, RuntimeError, KeyError) as error:
            raise ValueError(f"{path} is no netCDF-4 file that can be read ({error}); remove it.") from None
        if WRITTEN not in self.file or RUN not in self.file.attrs:
            self.file.close()
            raise ValueError(f"{path} is whole, or of another program; remove it, or give another name.")
        self.written = int(self.file[WRITTEN][()])
        there = len(self.file["ping"]) if "ping" in self.file else -1
        if there != count:
            self.file.close()
            raise OtherRun(f"{path} is of {there} pings, and these echoes have {count}; remove it, or give another "
                             "name.")

    def __enter__(self) -> PingFile:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.file.close()

    def check_run(self, first: xr.Dataset) -> None:
        """Refuse a ping, as encoded by `records.encoded`, of another run than the file's."""
        if self.file.attrs.get(RUN) == _digest(first):
            return
        for name in (*TOLD, *(key for key in first.attrs if key not in TOLD)):
            there, here = (np.asarray(attrs[name]).reshape(-1).tolist() if name in attrs else None
                           for attrs in (self.file.attrs, first.attrs))
            if there and here and there != here:
                there, here = _said(there[0]), _said(here[0])
                words = "" if max(len(there), len(here)) > 40 else f" ({there}, and here {here})"
                other = "other parameters" if name == "parameters" else f"another {name}"
                raise OtherRun(f"{self.path} was begun with {other}{words}; remove it, or give another name.")
        raise OtherRun(f"{self.path} was begun with another scene; remove it, or give another name.")

    def put(self, number: int, ping: xr.Dataset) -> None:
        """Write a ping, as encoded by `records.encoded`, and then the count, once the ping is on the disk."""
        names = _moving(ping)
        for name in names:
            values, place = ping.variables[name], self.file.get(str(name))
            if place is None or values.shape != (1, *place.shape[1:]) or _stored(values) != place.dtype:
                there = "nothing" if place is None else f"{place.dtype} {place.shape[1:]}"
                raise ValueError(f"{name} of ping {number} is {values.dtype} {values.shape[1:]}, and the file has room "
                                 f"for {there}")
        try:
            for name in names:
                self.file[str(name)][number] = ping.variables[name].values[0]
            self._to_disk()
            self.file[WRITTEN][()] = number + 1
            self._to_disk()
        except (OSError, RuntimeError) as error:
            raise self._told(error, number) from error
        self.written = number + 1

    def finish(self, target: Path) -> None:
        """Rename the file to its final name while it is still locked, so that no other program begins to write it."""
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
        """Return an error of a full disk in words; HDF5 does not always give its number."""
        for code, words in FULL.items():
            if getattr(error, "errno", None) == code or os.strerror(code) in str(error):
                plain = OSError(f"cannot write ping {number}: {words}; {self.path} keeps the pings before it, free "
                                "some space and run it again.")
                plain.errno = code
                return plain
        return error


def _said(value: Any) -> str:
    """Return an attribute in words; dictionaries are JSON in the file."""
    text = str(value)
    held = json.loads(text[len(JSON):]) if text.startswith(JSON) else text
    return (", ".join(f"{key}={item}" for key, item in held.items()) or "none") if isinstance(held, dict) else str(held)


def _stored(variable: xr.Variable) -> np.dtype:
    """Return the type of a variable in the file: xarray reads int8 marked as bool, because netCDF has no booleans."""
    return np.dtype(np.int8) if variable.dtype == bool else variable.dtype


def _check_room(first: xr.Dataset, count: int, path: Path) -> None:
    """Refuse to begin a file that does not fit on the disk."""
    needed, free = size_of(first, count), shutil.disk_usage(path.parent).free
    if needed > free:
        raise OSError(f"cannot write {path}: {count} pings take {needed / 1e9:.3g} GB, and the disk has "
                      f"{free / 1e9:.3g} GB left; free some space or choose another disk.")


def _moving(first: xr.Dataset) -> list[Any]:
    """Return the names of the variables over pings."""
    names = [name for name, variable in first.variables.items() if "ping" in variable.dims]
    for name in names:
        variable = first.variables[name]
        if variable.dims[0] != "ping" or variable.dtype.kind not in "biuf":
            raise ValueError(f"{name} is {variable.dtype} over {variable.dims}, and what changes from ping to ping are "
                             "numbers with ping as their first dimension")
    return names


def _digest(first: xr.Dataset) -> str:
    """Return a digest of everything that all pings of one run have in common."""
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
