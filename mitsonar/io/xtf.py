"""Sidescan records as XTF files (eXtended Triton Format), for sidescan software.

A file has a header of 1024 bytes with a channel a side, notes, and for every ping a navigation packet (type 107) and a
sonar packet (type 0): a ping header, and for every channel a channel header and its samples of 16 bits.

    samples           amplitudes, see `xtf_samples`; their scale stands in the header's note and in notes packets
    port              the farthest sample first, as the format has it of channels 0, 2, ...; starboard the nearest first
    SlantRange        [m] where the last sample ends; the first begins at 0, silent ones fill up to a later window
    SecondsPerPing    [s] what a ping records, TimeDuration, as recorders write it; times tell how often it pings
    SoundVelocity     [m/s] half the speed of sound at the head, as the format's own program writes it
    position          degrees on WGS 84 (NavUnits 3) where the scene's coordinate system is known, else metres (0)
    AuxVal1 to 3      [m] x, y, z of the scene

Records of one track at several frequencies make one file, the lowest frequency first. Time counts from 1970 unless
a start is given. Labels and all other truth, levels without speckle, and the scene find no room in it.
"""
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pyxtf
import xarray as xr

from ..imaging.gain import Tvg
from ..imaging.georeference import system
from .files import FilePath, replacing
from .xtf_channels import channel_header, channels_of, file_header, note, notes
from .xtf_input import SIDES, check, check_same_track
from .xtf_layouts import structure
from .xtf_pings import navigation, passage_of, ping_headers
from .xtf_samples import Scale

__all__ = ["Written", "write"]

MOST_BYTES = (1 << 31) - 1         # of a file: what readers can address that count in 32 bits with a sign
BLOCK_BYTES = 1 << 24              # written at a time
PACKET = NAVIGATION_BYTES = 64     # bytes: of which lengths are multiples; of a navigation packet


@dataclass(frozen=True, kw_only=True)
class Written:
    """Say what went into a file.

    Attributes
    ----------
    scales : tuple of Scale
        Of each record, in the order of the file.
    geographic : bool
        Positions are degrees.
    saturated : int
        Samples that are full and stand for higher levels.
    left_out : tuple of str
        Variables that found no room.
    """

    scales: tuple[Scale, ...]
    geographic: bool
    saturated: int
    left_out: tuple[str, ...]


def write(records: xr.Dataset | Sequence[xr.Dataset], path: FilePath, *, tvg: Tvg = "seabed", start: float = 0.0,
          geographic: bool | None = None) -> Written:
    """Write a sidescan record, or several of one track, as an XTF file; whole or not at all.

    Parameters
    ----------
    records : xarray.Dataset or sequence of them
        As `mitsonar.render` gives them: ``level`` (ping, side, range). Several must share pings, times and places.
    path : str or path
    tvg : {'seabed', 'target', 'recorder', None}
        Gain in the samples: 30 log R + 2 a R, 40 log R + 2 a R, or none.
    start : float [s]
        Since 1970, UTC, of the record's time 0.
    geographic : bool or None
        Positions in degrees; False: in metres of the scene's coordinate system. None: degrees where they are known.

    Returns
    -------
    Written

    Raises
    ------
    ValueError
        If a record is no sidescan's or has uneven ranges, several do not share a track, times lie outside 1970 to 9999,
        degrees are asked for and not known, or the file would pass 2 GiB.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.

    Examples
    --------
    ``mitsonar.io.xtf.write(mitsonar.read("swath.exr"), "swath.xtf")``
    """
    lines = [records] if isinstance(records, xr.Dataset) else list(records)
    for line in lines:
        check(line)
    lines.sort(key=lambda line: float(line.attrs["frequency"]))
    check_same_track(lines)
    known = system(lines[0].attrs) is not None
    if geographic and not known:
        raise ValueError("the record names no coordinate system, so its positions have no degrees; write metres, or "
                         "say the bathymetry's crs in the scene.")
    passage = passage_of(lines[0], start, known if geographic is None else geographic)
    channels = [channels_of(line, tvg) for line in lines]
    length = _padded(256 + sum(2 * (64 + 2 * each.count) for each in channels))
    total = 1024 + (NAVIGATION_BYTES + length) * passage.time.size
    if total > MOST_BYTES:
        raise ValueError(f"the file would have {total / 1e9:.3g} GB, more than the {MOST_BYTES / 1e9:.3g} GB that "
                         "readers of XTF can address; write fewer pings at a time.")
    saturated = 0
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(file_header(channels, passage, os.path.basename(path)))
        for text in notes(channels):
            stream.write(note(text, passage))
        for packets, full in _packets(channels, passage, length):
            stream.write(packets.tobytes())
            saturated += full
    return Written(scales=tuple(each.scale for each in channels), geographic=passage.geographic, saturated=saturated,
                   left_out=tuple(str(name) for name in lines[0].data_vars if name != "level"))


def _packets(channels, passage, length) -> Iterator[tuple[np.ndarray, int]]:
    """Blocks of packets, and how many of their samples are saturated."""
    fields = [("navigation", structure(pyxtf.XTFPosRawNavigation)), ("ping", structure(pyxtf.XTFPingHeader))]
    for number, each in enumerate(channels):
        for side in SIDES:
            fields += [(f"{side}{number}", structure(pyxtf.XTFPingChanHeader)),
                       (f"{side}{number}_samples", np.uint16, (each.count,))]
    bare = np.dtype(fields)
    layout = np.dtype([*fields, ("padding", np.uint8, (NAVIGATION_BYTES + length - bare.itemsize,))])
    common = {"navigation": navigation(passage), "ping": ping_headers(passage, 2 * len(channels), length)}
    pings, step = passage.time.size, max(1, BLOCK_BYTES // layout.itemsize)
    for start in range(0, pings, step):
        some = slice(start, min(start + step, pings))
        packets, full = np.zeros(some.stop - some.start, layout), 0
        for name, values in common.items():
            _fill(packets[name], values, some)
        for number, each in enumerate(channels):
            level = each.record["level"].transpose("ping", "side", "range")[some].values
            samples, saturated = each.scale.samples(level, each.middle)
            full += saturated
            for side, name in enumerate(SIDES):
                _fill(packets[f"{name}{number}"], channel_header(each, 2 * number + side, passage), some)
                own = packets[f"{name}{number}_samples"]
                own[:, each.silent:] = samples[:, side]
                if name == "port":
                    own[:] = own[:, ::-1].copy()
        yield packets, full


def _fill(packets, values, some):
    for name, value in values.items():
        packets[name] = value[some] if np.ndim(value) else value


def _padded(length):
    return -(-length // PACKET) * PACKET
