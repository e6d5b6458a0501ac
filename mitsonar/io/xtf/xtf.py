"""Sidescan records as XTF files (eXtended Triton Format), for sidescan software.

A file has a header of 1024 bytes with one channel per side, notes, and for every ping a navigation packet (type 107)
and a sonar packet (type 0): a ping header, and for every channel a channel header and its samples of 16 bits.

    samples           amplitudes, see `samples`; the header's note and notes packets contain their scale
    port              the farthest sample first, by the format's convention for channels 0, 2, ...; starboard reversed
    SlantRange        [m] end of the last sample; the first begins at 0, and zeros fill the time before a later window
    SecondsPerPing    [s] recorded duration of a ping, like TimeDuration, as recorders write it
    SoundVelocity     [m/s] half the speed of sound at the head, as the format's own program writes it
    position          degrees on WGS 84 (NavUnits 3) if the scene's coordinate system is known, else metres (0)
    AuxVal1 to 3      [m] x, y, z of the scene

Records of one track at several frequencies form one file, the lowest frequency first. Times count from 1970 unless a
start is given. The format has no place for labels and other truth, levels without speckle, and the scene.
"""
import ctypes
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyxtf
import xarray as xr

from mitsonar.device.earth import FARTHEST, origin, system
from mitsonar.device.files import FilePath, replacing
from mitsonar.imaging.gain import Tvg
from mitsonar.version import __version__

from .pings import XtfPassage, attitude, navigation, passage_of, ping_headers, structure
from .samples import Scale, scale_of

MOST_RECORDS = 3                   # two channels each; the header has room for six
SIDES = ("port", "starboard")
NEEDED = ("ping_time", "x", "y", "z", "roll", "pitch", "heading", "altitude")
LOUDEST_DB = 300.0                 # [dB re 1 µPa]
ANGLES = ("beam_width", "vertical_beam_width", "depression_angle")      # attributes that need not be there
SAME_TIME, SAME_PLACE = 1e-6, 1e-3          # [s], [m]


def check(record: xr.Dataset) -> None:
    """Check that a record is a complete sidescan record."""
    level = record.get("level")
    if level is None or set(level.dims) != {"ping", "side", "range"} or list(record["side"].values) != list(SIDES):
        dims = "no levels" if level is None else f"levels over {', '.join(map(str, level.dims))}"
        raise ValueError(f"the record has {dims}; XTF takes a sidescan's, over ping, side (port, starboard) and range.")
    lacking = [name for name in NEEDED if name not in record.coords]
    lacking += [name for name in ("sound_speed", "frequency") if record.attrs.get(name) is None]
    if lacking:
        raise ValueError(f"the record has no {lacking[0]}; give a record that mitsonar rendered.")
    for name in ("sound_speed", "frequency"):
        value = record.attrs[name]
        if not isinstance(value, (int, float)) or not 0 < value < np.inf:
            raise ValueError(f"the record's {name} is {value!r}; it takes a number above 0.")
    for name in ANGLES:
        value = record.attrs.get(name, 0.0)
        if not isinstance(value, (int, float)) or not np.isfinite(value):
            raise ValueError(f"the record's {name} is {value!r}; it takes an angle [rad].")
    if (level.values > LOUDEST_DB).any():
        raise ValueError(f"the record has levels of {level.values.max():.4g} dB, beyond any sound; render it again.")
    if not all(np.isfinite(record[name].values).all() for name in NEEDED if name != "altitude"):
        raise ValueError("the record's track has times, places or angles that are not finite; render it again.")
    if any((np.abs(record[axis].values) > FARTHEST).any() for axis in "xyz"):
        raise ValueError(f"the record's track goes beyond {FARTHEST:g} m, farther than any place on Earth.")
    if (np.diff(record["ping_time"].values) <= 0).any():
        raise ValueError("the times of the record's pings do not increase; sort them.")
    if not record.sizes["ping"]:
        raise ValueError("the record has no pings; give one or more.")
    if not np.isfinite(record["range"].values).all() or not _even(np.diff(record["range"].values)):
        raise ValueError("the record needs two or more ranges in even steps, as XTF has no others; resample it.")


def _even(steps):
    return steps.size > 0 and steps.min() > 0 and np.ptp(steps) <= 1e-3 * steps.mean()


def check_same_track(lines: Sequence[xr.Dataset]) -> None:
    """Check that records, in the order of their frequencies, can share ping headers."""
    if not 1 <= len(lines) <= MOST_RECORDS:
        raise ValueError(f"{len(lines)} records were given; an XTF file takes 1 to {MOST_RECORDS} of one track.")
    first = lines[0]
    for other in lines[1:]:
        same = other.sizes["ping"] == first.sizes["ping"] and all(
            np.allclose(other[name].values, first[name].values, rtol=0, atol=slack)
            for name, slack in (("ping_time", SAME_TIME), ("x", SAME_PLACE), ("y", SAME_PLACE), ("z", SAME_PLACE)))
        if not same:
            raise ValueError(f"the records of {first.attrs['frequency'] / 1e3:g} and "
                             f"{other.attrs['frequency'] / 1e3:g} kHz have not the same pings, times and places; write "
                             "a file of each.")


WORD, TVG_APPLIED, SLANT_RANGE, UNIPOLAR, VOLTS = 3, 4, 1, 1, 5.0          # codes of the format; full scale
DEGREES, METRES = 3, 0             # NavUnits
NOTES = 1                          # type of packet


def on_one_track(records: xr.Dataset | Sequence[xr.Dataset], start: float,
                 geographic: bool | None) -> tuple[list[xr.Dataset], XtfPassage]:
    """Return the records of a track by frequency, checked, and their passage; ``geographic`` as in `write`."""
    lines = [records] if isinstance(records, xr.Dataset) else list(records)
    for line in lines:
        check(line)
    lines.sort(key=lambda line: float(line.attrs["frequency"]))
    check_same_track(lines)
    known = system(lines[0].attrs) is not None
    if geographic and not known:
        raise ValueError("the record names no coordinate system, so its positions have no degrees; write metres, or "
                         "say the bathymetry's crs in the scene.")
    return lines, passage_of(lines[0], start, known if geographic is None else geographic)


@dataclass(frozen=True, kw_only=True)
class Channels:
    """The two channels of a record: ranges of their samples, and their scale."""

    record: xr.Dataset
    source: str  # variable of the record that the samples hold: its levels or its counts
    scale: Scale
    silent: int  # number of zero samples before the window
    near: float  # [m]: range at which the first sample begins
    step: float  # [m]: length of a sample

    @property
    def count(self) -> int:
        """Number of samples of a side."""
        return self.silent + self.record.sizes["range"]

    @property
    def middle(self) -> np.ndarray:
        """Slant ranges [m] of the middles of the window's samples."""
        return self.near + (self.silent + np.arange(self.record.sizes["range"]) + 0.5) * self.step


def channels_of(record: xr.Dataset, tvg: Tvg) -> Channels:
    """Return the channels of a record; errors as `scale_of`."""
    slant_range = np.asarray(record["range"].values, float)
    step = float(np.diff(slant_range).mean())
    begin = max(float(slant_range[0]) - 0.5 * step, 0.0)
    silent = int(begin / step + 1e-6)
    source = "recorded" if tvg == "counts" else "level"
    return Channels(record=record, source=source, scale=scale_of(record, tvg), silent=silent, step=step,
                    near=begin - silent * step if begin - silent * step > 1e-6 * step else 0.0)


def file_header(channels: Sequence[Channels], passage: XtfPassage, name: str) -> bytes:
    """Return the header (1024 bytes) of a file with the given name."""
    header = pyxtf.XTFFileHeader()
    header.RecordingProgramName, header.RecordingProgramVersion = b"mitsonar", _ascii(__version__, 7)
    header.SonarName = b"mitsonar"
    header.NoteString = _ascii(channels[0].scale.words() if len(channels) == 1 else "scales: see the notes packets", 63)
    header.ThisFileName = _ascii(name, 63)
    header.NavUnits = DEGREES if passage.geographic else METRES
    header.NumberOfSonarChannels = 2 * len(channels)
    for number in range(2 * len(channels)):
        each, info = channels[number // 2], header.ChanInfo[number]
        khz = each.record.attrs["frequency"] / 1e3
        info.TypeOfChannel, info.SubChannelNumber = 1 + number % 2, number
        info.CorrectionFlags, info.UniPolar, info.BytesPerSample, info.SampleFormat = SLANT_RANGE, UNIPOLAR, 2, WORD
        info.Reserved, info.VoltScale, info.Frequency, info.BeamsPerArray = each.count, VOLTS, khz, 1
        info.HorizBeamAngle, info.BeamWidth, info.TiltAngle = (
            np.rad2deg(each.record.attrs.get(angle, 0.0))
            for angle in ANGLES)
        info.ChannelName = _ascii(f"{('Port', 'Starboard')[number % 2]} {khz:g}", 15)
    return bytes(header)


def notes(channels: Sequence[Channels]) -> Iterator[str]:
    """Return notes on the meaning of a file's samples and auxiliary values."""
    for number, each in enumerate(channels):
        yield (f"channels {2 * number}, {2 * number + 1} ({each.record.attrs['frequency'] / 1e3:g} kHz): "
               f"{each.scale.words()}; n a sample, R [m] the slant range of its middle; 0: nothing")
    east, north = origin(channels[0].record.attrs)
    yield (f"AuxVal1-3: x, y, z of the scene [m] from E {east:.3f} N {north:.3f}; "
           f"{channels[0].record.attrs.get('crs') or 'no coordinate system'}")


def note(text: str, passage: XtfPassage) -> bytes:
    """Return a notes packet with the date of the first ping."""
    first = navigation(passage)
    packet = pyxtf.XTFNotesHeader()
    packet.HeaderType, packet.NumBytesThisRecord = NOTES, ctypes.sizeof(pyxtf.XTFNotesHeader)
    for field in ("Year", "Month", "Day", "Hour", "Minute", "Second"):
        setattr(packet, field, int(np.asarray(first[field])[0]))
    packet.NotesText = _ascii(text, 199)
    return bytes(packet)


def channel_header(channels: Channels, number: int, passage: XtfPassage) -> Mapping[str, np.ndarray | float]:
    """Return the fields of the channel headers of all pings, for one channel."""
    far = channels.near + channels.count * channels.step
    duration = 2 * (far - channels.near) / passage.sound_speed
    return {"ChannelNumber": number, "SlantRange": far, "NumSamples": channels.count,
            "GroundRange": np.sqrt(np.maximum(far**2 - passage.altitude**2, 0.0)),
            "TimeDelay": 2 * channels.near / passage.sound_speed, "TimeDuration": duration, "SecondsPerPing": duration,
            "ProcessingFlags": TVG_APPLIED if channels.scale.spreading_db else 0,
            "Frequency": min(round(channels.record.attrs["frequency"] / 1e3), 65535),
            "MillivoltScale": int(1e3 * VOLTS)}


def _ascii(text, most):
    return str(text).encode("ascii", "replace")[:most]


MOST_BYTES = (1 << 31) - 1         # of a file, which readers address by signed 32-bit numbers
BLOCK_BYTES = 1 << 24              # written at once
PACKET = 64                        # bytes: packet lengths are multiples of it, and those of navigation and attitude
BEFORE_PING = 2 * PACKET           # bytes


@dataclass(frozen=True, kw_only=True)
class XtfWritten:
    """Content of a written file.

    Attributes
    ----------
    scales : tuple of Scale
        Scale of each record, in the order of the file.
    geographic : bool
        True for positions in degrees.
    saturated : int
        Number of saturated samples.
    left_out : tuple of str
        Variables that the format cannot hold.
    """

    scales: tuple[Scale, ...]
    geographic: bool
    saturated: int
    left_out: tuple[str, ...]


def write(records: xr.Dataset | Sequence[xr.Dataset], path: FilePath, *, tvg: Tvg = "seabed", start: float = 0.0,
          geographic: bool | None = None) -> XtfWritten:
    """Write a sidescan record, or several of one track, as an XTF file. A failed write leaves no file.

    Parameters
    ----------
    records : xarray.Dataset or sequence of them
        Results of `mitsonar.render`: ``level`` (ping, side, range). Several must share pings, times and places.
    path : str or path
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain in the samples: 30 log R + 2 a R, 40 log R + 2 a R, or none; ``counts``: the recorder's own samples.
    start : float [s]
        Time of the record's time 0 since 1970, UTC.
    geographic : bool or None
        True: positions in degrees. False: in metres of the scene's coordinate system. None: degrees if they are known.

    Returns
    -------
    XtfWritten

    Raises
    ------
    ValueError
        If a record is no sidescan's or has uneven ranges, several do not share a track, times lie outside 1970 to 9999,
        degrees are requested but unknown, or the file would exceed 2 GiB.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.

    Examples
    --------
    ``mitsonar.io.xtf.xtf.write(mitsonar.read("swath.exr"), "swath.xtf")``
    """
    lines, passage = on_one_track(records, start, geographic)
    channels = [channels_of(line, tvg) for line in lines]
    length = _padded(256 + sum(2 * (64 + 2 * each.count) for each in channels))
    total = 1024 + (BEFORE_PING + length) * passage.time.size
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
    return XtfWritten(scales=tuple(each.scale for each in channels), geographic=passage.geographic, saturated=saturated,
                   left_out=tuple(str(name) for name in lines[0].data_vars if name != channels[0].source))


def _packets(channels, passage, length) -> Iterator[tuple[np.ndarray, int]]:
    """Yield blocks of packets, and the number of their saturated samples."""
    fields = [("navigation", structure(pyxtf.XTFPosRawNavigation)), ("attitude", structure(pyxtf.XTFAttitudeData)),
              ("ping", structure(pyxtf.XTFPingHeader))]
    for number, each in enumerate(channels):
        for side in SIDES:
            fields += [(f"{side}{number}", structure(pyxtf.XTFPingChanHeader)),
                       (f"{side}{number}_samples", np.uint16, (each.count,))]
    bare = np.dtype(fields)
    layout = np.dtype([*fields, ("padding", np.uint8, (BEFORE_PING + length - bare.itemsize,))])
    common = {"navigation": navigation(passage), "attitude": attitude(passage),
              "ping": ping_headers(passage, 2 * len(channels), length)}
    pings, step = passage.time.size, max(1, BLOCK_BYTES // layout.itemsize)
    for start in range(0, pings, step):
        some = slice(start, min(start + step, pings))
        packets, full = np.zeros(some.stop - some.start, layout), 0
        for name, values in common.items():
            _fill(packets[name], values, some)
        for number, each in enumerate(channels):
            values = each.record[each.source].transpose("ping", "side", "range")[some].values
            samples, saturated = ((values, 0) if each.source == "recorded"
                                  else each.scale.samples(values, each.middle))
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
