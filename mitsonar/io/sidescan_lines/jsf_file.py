"""Write sidescan records as JSF files (EdgeTech), by the same scale and the same passage as `io.xtf`.

    A = 10^((level + gain(R) - offset) / 20) = sample · 2^-N          N: the weight of a ping and side

Samples are envelopes of 16 bits, of which 15 are used, as readers differ on the sign of the last. The lowest frequency
is subsystem 20, the next 21. Before the sonar messages of a ping (type 80) come its attitude (2020) and, in degrees,
its position as an NMEA sentence (2002), since sonar messages hold positions to 0.2 m. The annotation of a sonar message
has the scale, such as ``A+58.80-30lgR-.1921R``, with A in decibels.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath, replacing
from mitsonar.imaging.gain import Tvg

from ..xtf.pings import XtfPassage, clock
from ..xtf.samples import FULL
from ..xtf.xtf import BLOCK_BYTES, Channels, XtfWritten, channels_of, on_one_track
from . import jsf_messages as jsf
from .record import SIDES

PROTOCOL = 0xD
SUBSYSTEM, SERIAL, TOPSIDE = 20, 101, 100                # first sidescan; parsed and raw messages of sensors
LARGEST, MOST_BITS = 32767, 15     # of a sample; of a weight
MOST_SAMPLES = (1 << 20) - 1
LATEST = (1 << 31) - 1             # [s] from 1970 that the time of a message can hold
MOST_MILLIMETRES = (1 << 31) - 1


def write(records: xr.Dataset | Sequence[xr.Dataset], path: FilePath, *, tvg: Tvg = "seabed", start: float = 0.0,
          geographic: bool | None = None) -> XtfWritten:
    """Write a sidescan record, or several of one track, as a JSF file. A failed write leaves no file.

    Parameters
    ----------
    records, path, tvg, start, geographic
        As for `io.xtf.write`.

    Returns
    -------
    XtfWritten

    Raises
    ------
    ValueError
        As `io.xtf.write`; also if times lie after January 2038, or a ping has more than 2^20 samples.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.

    Examples
    --------
    ``mitsonar.io.sidescan_lines.jsf_file.write(mitsonar.read("swath.exr"), "swath.jsf")``
    """
    lines, passage = on_one_track(records, start, geographic)
    if passage.time[-1] > LATEST:
        raise ValueError("the last ping is after January 2038, and JSF holds no later times; give another start.")
    channels = [_of_15_bits(channels_of(line, tvg)) for line in lines]
    if max(each.count for each in channels) > MOST_SAMPLES:
        raise ValueError(f"a ping has {max(each.count for each in channels)} samples, and JSF holds {MOST_SAMPLES}; "
                         "resample the record.")
    saturated = 0
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        stream.write(_system(len(channels)))
        for block, full in _blocks(channels, passage):
            stream.write(block.tobytes())
            saturated += full
    return XtfWritten(scales=tuple(each.scale for each in channels), geographic=passage.geographic, saturated=saturated,
                      left_out=tuple(str(name) for name in lines[0].data_vars if name != channels[0].source))


def _of_15_bits(channels: Channels) -> Channels:
    """Return channels whose levels end at the largest sample; counts stay as they are."""
    if channels.source != "level":
        return channels
    offset = channels.scale.offset_db + 20 * np.log10(FULL / LARGEST)
    return replace(channels, scale=replace(channels.scale, offset_db=float(np.ceil(100 * offset) / 100)))


def _system(subsystems):
    """Return the message of system information."""
    return _header(182, 0, 0, 24).tobytes() + np.array([0, 0, 0, subsystems, 0, 0], "<i4").tobytes()


def _header(kind, subsystem, channel, size):
    header = np.zeros((), jsf.HEADER)
    for name, value in (("sync", 0x1601), ("version", PROTOCOL), ("type", kind), ("command", 2),
                        ("subsystem", subsystem), ("channel", channel), ("size", size)):
        header[name] = value
    return header


def _blocks(channels: Sequence[Channels], passage: XtfPassage) -> Iterator[tuple[np.ndarray, int]]:
    """Yield the messages of blocks of pings, and the number of their saturated samples."""
    sensors = _sensors(passage)
    fields = [(name, values.dtype) for name, values in sensors.items()]
    for number, each in enumerate(channels):
        for side in SIDES:
            fields += [(f"header_{side}{number}", jsf.HEADER), (f"message_{side}{number}", jsf.SONAR_MESSAGE),
                       (f"samples_{side}{number}", "<u2", (each.count,))]
    layout = np.dtype(fields)
    common = _common(passage)
    step = max(1, BLOCK_BYTES // layout.itemsize)
    for first in range(0, passage.time.size, step):
        some = slice(first, min(first + step, passage.time.size))
        block, full = np.zeros(some.stop - some.start, layout), 0
        for name, values in sensors.items():
            block[name] = values[some]
        for number, each in enumerate(channels):
            values = each.record[each.source].transpose("ping", "side", "range")[some].values
            if each.source == "level":
                values = each.scale.amplitude(values, each.middle)
                full += int(np.count_nonzero(values > LARGEST + 0.5))
                values = np.minimum(values, LARGEST)
            samples, weight = _weighted(values)
            own = _of_channel(each, passage)
            micro = round(1e6 * (each.record.attrs.get("pulse_length") or 0.0)) % 1000
            for index, side in enumerate(SIDES):
                block[f"header_{side}{number}"] = _header(
                    jsf.SONAR, SUBSYSTEM + number, index, jsf.SONAR_MESSAGE.itemsize + 2 * each.count)
                message = block[f"message_{side}{number}"]
                for name, value in {**common, **own}.items():
                    message[name] = value[some] if np.ndim(value) else value
                message["low_2"] |= micro << 4
                message["weight"], message["largest"] = weight[:, index], samples[:, index].max(-1)
                block[f"samples_{side}{number}"][:, each.silent:] = samples[:, index]
        yield block, full


def _weighted(amplitude):
    """Return samples (P, S, N) of 15 bits and their weights (P, S), the largest that amplitudes leave room for.

    Counts stay as they are, but those of a ping with more than 15 bits lose the last.
    """
    most = np.maximum(amplitude.max(-1), 1.0)
    weight = np.clip(np.floor(np.log2((LARGEST + 0.5) / most)), -1, 0 if amplitude.dtype.kind == "u" else MOST_BITS)
    samples = np.minimum(np.rint(amplitude * np.exp2(weight)[..., None]), LARGEST)
    return samples.astype("<u2"), weight.astype(np.int16)


def _times(passage):
    """Return seconds since 1970 and milliseconds of the day (P,), rounded together."""
    whole = np.rint(1e3 * passage.time).astype(np.int64)
    return whole // 1000, whole % 86_400_000


def _sensors(passage: XtfPassage) -> dict[str, np.ndarray]:
    """Return the messages of attitude and position at the pings, headers and contents (P,)."""
    seconds, milliseconds = _times(passage)
    motion = np.zeros(passage.time.size, jsf.MOTION_MESSAGE)
    for name, value in (("time", seconds), ("milliseconds", milliseconds % 1000),
                        ("pitch", _steps(passage.pitch)), ("roll", _steps(passage.roll)),
                        ("heading", _hundredths(passage.heading)),
                        ("valid", jsf.PITCH_2020 | jsf.ROLL_2020 | jsf.HEADING_2020)):
        motion[name] = value
    found = {"motion_header": np.full(passage.time.size, _header(jsf.MOTION, SERIAL, 0, motion.itemsize)),
             "motion": motion}
    if passage.geographic:
        sentences = np.array([_sentence(*fix) for fix in zip(passage.time, passage.y, passage.x, strict=True)])
        layout = np.dtype([("head", jsf.NMEA_MESSAGE), ("text", sentences.dtype)])
        fixes = np.zeros(passage.time.size, layout)
        fixes["head"]["time"], fixes["head"]["milliseconds"] = seconds, milliseconds % 1000
        fixes["head"]["source"], fixes["text"] = 1, sentences
        found |= {"fix_header": np.full(passage.time.size, _header(jsf.NMEA, TOPSIDE, 0, layout.itemsize)),
                  "fix": fixes}
    return found


def _sentence(time, latitude, longitude):
    """Return the NMEA sentence of a fix [degrees], minutes to 0.2 mm."""
    day = np.rint(1e3 * time) % 86_400_000 / 1e3
    parts = []
    for angle, width, names in ((latitude, 2, "NS"), ((longitude + 180) % 360 - 180, 3, "EW")):
        minutes = round(abs(angle) * 60, 7)
        parts.append(f"{int(minutes // 60):0{width}d}{minutes % 60:010.7f},{names[int(angle < 0)]}")
    body = (f"GPGGA,{int(day // 3600):02d}{int(day // 60 % 60):02d}{day % 60:06.3f},{','.join(parts)},"
            "1,12,1.0,0.0,M,0.0,M,,")
    return f"${body}*{np.bitwise_xor.reduce(np.frombuffer(body.encode(), np.uint8)):02X}\r\n".encode()


def _steps(angle):
    """Return pitch or roll [degrees] in the steps of the format."""
    return np.clip(np.rint(((angle + 180) % 360 - 180) / jsf.ANGLE), -32768, 32767)


def _hundredths(heading):
    return np.rint(100 * heading) % 36000


def _common(passage: XtfPassage):
    """Return the fields of the sonar messages that all channels share."""
    seconds, milliseconds = _times(passage)
    date = clock(seconds.astype(float), 1)
    valid = jsf.PLACE | jsf.SPEED | jsf.HEADING | jsf.ATTITUDE | jsf.DEPTH | jsf.NOTE | jsf.SOUND
    if passage.geographic:
        places, units = (jsf.MINUTES * ((passage.x + 180) % 360 - 180), jsf.MINUTES * passage.y), jsf.DEGREES
    else:
        far = max(np.abs(passage.x).max(), np.abs(passage.y).max())
        units = 1 if 1e3 * far < MOST_MILLIMETRES else 3
        places = passage.x / jsf.PLACES[units], passage.y / jsf.PLACES[units]
    knots = np.rint(100 * np.minimum(passage.speed_knots, 3000)).astype(np.int64)
    return {"time": seconds, "number": passage.number, "identity": 1,
            "valid": np.where(passage.altitude > 0, valid | jsf.ALTITUDE, valid), "units": units,
            "x": np.rint(places[0]), "y": np.rint(places[1]), "depth": np.rint(-1e3 * passage.scene[:, 2]),
            "altitude": np.rint(1e3 * passage.altitude), "sound": passage.sound_speed, "year": date["Year"],
            "day": date["JulianDay"], "hour": date["Hour"], "minute": date["Minute"], "second": date["Second"],
            "basis": 3, "pulses": 1, "heading": _hundredths(passage.heading), "pitch": _steps(passage.pitch),
            "roll": _steps(passage.roll), "fix_hour": date["Hour"], "fix_minute": date["Minute"],
            "fix_second": date["Second"], "fix_day": date["JulianDay"], "fix_year": date["Year"],
            "speed": knots // 10, "low_2": knots % 10, "milliseconds": milliseconds, "packet": 1}


def _of_channel(channels: Channels, passage: XtfPassage):
    """Return the fields that the messages of a record's two channels share."""
    interval = round(256e9 * 2 * channels.step / passage.sound_speed)                # in 256ths of a nanosecond
    frequency, scale = channels.record.attrs["frequency"], channels.scale
    band = round(frequency / 10)
    length = round(1e6 * (channels.record.attrs.get("pulse_length") or 0.0))
    gain = f"-{scale.spreading_db:g}lgR-{scale.absorption_db:.4f}R".replace("-0.", "-.") if scale.spreading_db else ""
    return {"samples": channels.count & 0xFFFF, "interval": interval >> 8, "low": interval & 0xFF,
            "high": (channels.count >> 16 << 8) | (band >> 16) | (band >> 16 << 4), "first": band & 0xFFFF,
            "last": band & 0xFFFF, "sweep": min(length // 1000, 65535), "mixer": frequency,
            "rate": round(passage.sound_speed / 2 / channels.step) & 0xFFFF,
            "note": f"A{scale.offset_db:+.2f}{gain}".encode()[:24]}
