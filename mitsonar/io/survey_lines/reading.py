"""Read lines of soundings from files of survey software, whole or in blocks of pings.

    .all, .wcd      Kongsberg datagrams until 2018       .kmall, .kmwcd   since then      .gsf   Generic Sensor Format
    .s7k            records of Teledyne Reson, Norbit and others        .xtf     of R2Sonic and Reson in Triton's format
    .hsx            text of HYPACK

A water column is read from the file itself or from the file beside it (LINE.wcd, LINE.kmwcd).
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import xarray as xr

from mitsonar.device import files
from mitsonar.device.files import FilePath

from .assembly import LineCast, cast_of, dataset
from .gsf.read_gsf import GsfFile
from .hypack.hsx import MARK
from .hypack.read_hsx import HsxFile
from .kongsberg.read_all import AllFile
from .kongsberg.read_kmall import KmallFile
from .s7k.read_s7k import S7kFile
from .s7k.s7k_records import SYNC
from .xtf.read_xtf import XtfFile

BLOCK = 64                         # pings
COLUMNS = {"all": ".wcd", "kmall": ".kmwcd"}
MAINS = {".wcd": ".all", ".kmwcd": ".kmall"}
READERS = {"all": AllFile, "kmall": KmallFile, "gsf": GsfFile, "s7k": S7kFile, "xtf": XtfFile, "hsx": HsxFile}
LINES = "an .all, .kmall, .gsf, .s7k, .xtf or .hsx file"


def recognised(head: bytes) -> str | None:
    """Return the format of a file, a key of `READERS` or None, from its first eight bytes."""
    if head[4:8] == SYNC:
        return "s7k"
    if head == MARK:
        return "hsx"
    if head[4:5] == b"#":
        return "kmall"
    if head[4:8] in (b"\x00\x00\x00\x01", b"\x80\x00\x00\x01"):
        return "gsf"
    if head[4:5] == b"\x02":
        return "all"
    # a brace that opens JSON is followed by text
    return "xtf" if head[:1] == b"{" and not head[1:2].isspace() and not 32 <= head[1] < 127 else None


def read(path: FilePath, *, pings: slice | None = None, water_column: bool = True,
         head: int | None = None) -> xr.Dataset:
    """Read a line of soundings, or a range of its pings, or the pings of one receiving head."""
    line = next(blocks(path, pings=pings, water_column=water_column, size=None))
    return line if head is None else of_head(line, head)


def blocks(path: FilePath, *, pings: slice | None = None, water_column: bool = True,
           size: int | None = BLOCK) -> Iterator[xr.Dataset]:
    """Read a line of soundings in blocks of ``size`` pings; arguments and errors as `read`."""
    main, column = _pair(path)
    try:
        reader = READERS[_format(main)](main, column, water_column=water_column)
        start, stop, step = (pings or slice(None)).indices(len(reader))
        if step != 1 or stop <= start:
            raise ValueError(f"it has the pings 0 to {len(reader) - 1}; {pings} selects no consecutive pings of these.")
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


def line_casts(path: FilePath) -> tuple[LineCast, ...]:
    """Return the casts of a line, in the order of its file, with increasing depths."""
    main, _ = _pair(path)
    try:
        casts = READERS[_format(main)](main, None, water_column=False).casts
        return tuple(replace(one, nodes=np.stack(cast_of(one.nodes), -1)) for one in casts)
    except ValueError as error:
        raise ValueError(f"cannot read {path}: {error}") from None


def of_head(soundings: xr.Dataset, head: int) -> xr.Dataset:
    """Return the pings of one of several receiving heads, with its lever arm and mounting."""
    if "head" not in soundings:
        if head != 0:
            raise ValueError(f"the line has one receiving head, 0; head {head} was asked for.")
        return soundings
    count = soundings.sizes["receive_head"]
    if not 0 <= head < count:
        raise ValueError(f"the line has the receiving heads 0 to {count - 1}; head {head} was asked for.")
    kept = soundings.isel(ping=np.flatnonzero(soundings["head"].values == head))
    arrays = {name: kept[f"head_{name}"][head].drop_vars(kept.coords, errors="ignore")
              for name in ("receive_offset", "receive_mounting")}
    return kept.assign(arrays).drop_vars(["head", "head_receive_offset", "head_receive_mounting"])


def sources(path: FilePath) -> tuple[str, ...]:
    """Return the files that `read` would open: soundings and, if present, the water column beside them."""
    return tuple(file for file in _pair(path) if file)


def _pair(path):
    """Return the file of soundings and the file of the water column beside it, or None."""
    files.check_readable(path, "the line", LINES)
    path = os.fspath(path)
    name, suffix = os.path.splitext(path)
    if main := MAINS.get(suffix.lower()):
        if soundings := _beside(name, main):
            return soundings, path
        raise ValueError(f"cannot read {path}: it has a water column alone; put {os.path.basename(name)}{main}, the "
                         "soundings, beside it.")
    return path, _beside(name, COLUMNS.get(_format(path), ""))


def _beside(name, suffix):
    paths = (name + suffix, name + suffix.upper())
    return next((path for path in paths if suffix and os.path.isfile(path)), None)


def _format(path):
    with open(path, "rb") as stream:
        kind = recognised(stream.read(8))
    # an EXR image begins like an .all file
    if kind is None or (kind == "all" and files.described(path)):
        if not os.path.getsize(path):
            raise ValueError(f"cannot read {path}: it is empty.")
        raise ValueError(f"cannot read {path}: it is {files.described(path) or 'another file'}, not a line of "
                         f"soundings; give {LINES}.")
    return kind
