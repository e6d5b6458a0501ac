"""What XTF says of channels: in the file's header, in notes, and in the channel header of every ping."""
import ctypes
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyxtf
import xarray as xr

from .. import __version__
from ..imaging.gain import Tvg
from ..imaging.georeference import origin
from .xtf_input import ANGLES
from .xtf_pings import Passage, navigation
from .xtf_samples import Scale, scale_of

__all__ = ["Channels", "channel_header", "channels_of", "file_header", "note", "notes"]

WORD, TVG_APPLIED, SLANT_RANGE, UNIPOLAR, VOLTS = 3, 4, 1, 1, 5.0          # codes of the format; full scale
DEGREES, METRES = 3, 0             # NavUnits
NOTES = 1                          # type of packet


@dataclass(frozen=True, kw_only=True)
class Channels:
    """Hold one record's two channels: where their samples lie in range, and their scale.

    Attributes
    ----------
    record : xarray.Dataset
    scale : Scale
    silent : int
        Samples before the window.
    near : float [m]
        Where the first sample begins.
    step : float [m]
        Length of a sample.
    """

    record: xr.Dataset
    scale: Scale
    silent: int
    near: float
    step: float

    @property
    def count(self) -> int:
        """Samples of a side."""
        return self.silent + self.record.sizes["range"]

    @property
    def middle(self) -> np.ndarray:
        """Slant ranges of the window's samples [m]."""
        return self.near + (self.silent + np.arange(self.record.sizes["range"]) + 0.5) * self.step


def channels_of(record: xr.Dataset, tvg: Tvg) -> Channels:
    """Lay out a record's channels; `ValueError` as `scale_of`."""
    slant_range = np.asarray(record["range"].values, float)
    step = float(np.diff(slant_range).mean())
    begin = max(float(slant_range[0]) - 0.5 * step, 0.0)
    silent = int(begin / step + 1e-6)
    return Channels(record=record, scale=scale_of(record, tvg), silent=silent, step=step,
                    near=begin - silent * step if begin - silent * step > 1e-6 * step else 0.0)


def file_header(channels: Sequence[Channels], passage: Passage, name: str) -> bytes:
    """Give the header of 1024 bytes of a file of that name."""
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
    """Write what the samples and the auxiliary values of a file mean."""
    for number, each in enumerate(channels):
        yield (f"channels {2 * number}, {2 * number + 1} ({each.record.attrs['frequency'] / 1e3:g} kHz): "
               f"{each.scale.words()}; n a sample, R [m] the slant range of its middle; 0: nothing")
    east, north = origin(channels[0].record.attrs)
    yield (f"AuxVal1-3: x, y, z of the scene [m] from E {east:.3f} N {north:.3f}; "
           f"{channels[0].record.attrs.get('crs') or 'no coordinate system'}")


def note(text: str, passage: Passage) -> bytes:
    """Give a packet of notes, dated as the first ping."""
    first = navigation(passage)
    packet = pyxtf.XTFNotesHeader()
    packet.HeaderType, packet.NumBytesThisRecord = NOTES, ctypes.sizeof(pyxtf.XTFNotesHeader)
    for field in ("Year", "Month", "Day", "Hour", "Minute", "Second"):
        setattr(packet, field, int(np.asarray(first[field])[0]))
    packet.NotesText = _ascii(text, 199)
    return bytes(packet)


def channel_header(channels: Channels, number: int, passage: Passage) -> Mapping[str, np.ndarray | float]:
    """Give the fields of the headers of one of a file's channels, one a ping."""
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
