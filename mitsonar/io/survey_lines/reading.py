"""Lines of soundings from files of survey software, whole or in blocks of pings.

    .all, .wcd      Kongsberg's datagrams until 2018       .kmall, .kmwcd   since then      .gsf   Generic Sensor Format

A water column is taken from the file itself or from the one beside it (LINE.wcd, LINE.kmwcd).
"""
from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import xarray as xr

from mitsonar.device import files
from mitsonar.device.files import FilePath

from .assembly import dataset
from .gsf.read_gsf import GsfFile
from .kongsberg.read_all import AllFile
from .kongsberg.read_kmall import KmallFile

BLOCK = 64                         # pings
COLUMNS = {"all": ".wcd", "kmall": ".kmwcd"}
MAINS = {".wcd": ".all", ".kmwcd": ".kmall"}
READERS = {"all": AllFile, "kmall": KmallFile, "gsf": GsfFile}


def recognised(head: bytes) -> str | None:
    """Tell by a file's first eight bytes what it is: 'all', 'kmall', 'gsf' or None."""
    if head[4:5] == b"#":
        return "kmall"
    if head[4:8] == b"\x00\x00\x00\x01" or head[4:8] == b"\x80\x00\x00\x01":
        return "gsf"
    return "all" if head[4:5] == b"\x02" else None


def read(path: FilePath, *, pings: slice | None = None, water_column: bool = True,
         head: int | None = None) -> xr.Dataset:
    """Read a line of soundings."""
    whole = next(blocks(path, pings=pings, water_column=water_column, size=None))
    return whole if head is None else of_head(whole, head)


def blocks(path: FilePath, *, pings: slice | None = None, water_column: bool = True,
           size: int | None = BLOCK) -> Iterator[xr.Dataset]:
    """Read a line of soundings some pings at a time; memory holds one block. Arguments and errors as `read`."""
    main, column = _pair(path)
    try:
        reader = READERS[_kind(main)](main, column, water_column=water_column)
        start, stop, step = (pings or slice(None)).indices(len(reader))
        if step != 1 or stop <= start:
            raise ValueError(f"it has the pings 0 to {len(reader) - 1}; {pings} are none of these in a row.")
        line, held = reader.line, []
        for ping in reader.pings(start, stop):
            held.append(ping)
            if len(held) == size:
                yield dataset(line, held)
                held = []
        if held:
            yield dataset(line, held)
    except ValueError as error:
        raise ValueError(f"cannot read {path}: {error}") from None


def of_head(soundings: xr.Dataset, head: int) -> xr.Dataset:
    """Pick the pings of one receiving head of a line of several, with its lever arm and mounting."""
    if "head" not in soundings:
        if head != 0:
            raise ValueError(f"the line has one receiving head, 0; head {head} was asked for.")
        return soundings
    count = soundings.sizes["receive_head"]
    if not 0 <= head < count:
        raise ValueError(f"the line has the receiving heads 0 to {count - 1}; head {head} was asked for.")
    one = soundings.isel(ping=np.flatnonzero(soundings["head"].values == head))
    mine = {name: one[f"head_{name}"][head].drop_vars(one.coords, errors="ignore") for name in (
        "receive_offset", "receive_mounting")}
    return one.assign(mine).drop_vars(["head", "head_receive_offset", "head_receive_mounting"])


def sources(path: FilePath) -> tuple[str, ...]:
    """Name the files that `read` would open: that of soundings, and that of the water column beside it."""
    return tuple(one for one in _pair(path) if one)


def _pair(path):
    """Return the file of soundings and that of the water column beside it, or None."""
    files.check_readable(path, "the line", "an .all, .kmall or .gsf file")
    name, suffix = os.path.splitext(os.fspath(path))
    main = os.fspath(path)
    if suffix.lower() in MAINS:
        main = next((name + ending for ending in (MAINS[suffix.lower()], MAINS[suffix.lower()].upper())
                     if os.path.isfile(name + ending)), "")
        if not main:
            raise ValueError(f"cannot read {path}: it has a water column alone; put {os.path.basename(name)}"
                             f"{MAINS[suffix.lower()]}, the soundings, beside it.")
        return main, os.fspath(path)
    ending = COLUMNS.get(_kind(main) or "", "")
    return main, next((name + one for one in (ending, ending.upper()) if one and os.path.isfile(name + one)), None)


def _kind(path):
    with open(path, "rb") as stream:
        kind = recognised(stream.read(8))
    # an EXR image looks like the first bytes of an .all file
    if kind is None or files.described(path):
        if not os.path.getsize(path):
            raise ValueError(f"cannot read {path}: it is empty.")
        raise ValueError(f"cannot read {path}: it is {files.described(path) or 'another file'}, not a line of "
                         "soundings; give an .all, .kmall or .gsf file.")
    return kind
