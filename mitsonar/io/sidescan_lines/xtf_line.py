"""Sonar packets (type 0) of XTF files (Triton, eXtended Triton Format, Rev. 41).

Positions, attitude and speed are those of the ping headers: the sensor's, else the ship's. What no header has comes
from the packets of navigation and attitude between them (`io.xtf.navigation`), interpolated to the pings. By the
format's convention, port channels are stored with the farthest sample first. ``SoundVelocity`` is half the speed of
sound, as the format's own program writes it, or the whole. The frequency of a channel is in kHz.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.units import hertz_from_khz, metres_per_second_from_knots, radians_from_deg

from ..xtf import navigation
from ..xtf.packets import SONAR, file_header, walk
from ..xtf.pings import structure
from .record import SIDES, SideChannel, chosen, dataset, known, text

HEADER, CHANNEL = 256, 64          # bytes of the headers of a ping
MOST_PACKET = 100_000_000          # bytes
_SIDES = {1: SIDES[0], 2: SIDES[1]}                      # TypeOfChannel
_KINDS = {1: "ping notes", 3: "attitude", 42: "navigation", 107: "navigation", 23: "gyro", 84: "gyro",
          65: "R2Sonic bathymetry"}
_INTEGERS = {1: "u1", 2: "<u2", 4: "<u4"}
_IBM, _FLOAT = 1, 5                # SampleFormat
_FASTEST_HALF = 1000.0             # [m/s]: a sound speed below is half of it
_OF_CHANNEL = {"gain_code": "GainCode", "initial_gain_code": "InitialGainCode", "processing_flags": "ProcessingFlags",
               "weight": "Weight"}


def read(path: FilePath, numbers: Sequence[int] | None, frequency: float | None, some: slice) -> xr.Dataset:
    """Read the chosen channels and pings; arguments as `sidescan_lines.read`."""
    import pyxtf

    ping_layout, channel_layout = structure(pyxtf.XTFPingHeader), structure(pyxtf.XTFPingChanHeader)
    others, headers, count = Counter[int](), bytearray(), 0
    with open(path, "rb") as file:
        header, head = file_header(file)
        infos = [pyxtf.XTFChanInfo.from_buffer_copy(head, HEADER + 128 * number)
                 for number in range(min(header.channel_count(), (len(head) - HEADER) // 128))]
        some_channels, left = chosen(_channels(infos), numbers, frequency)
        first, stop = some.start or 0, some.stop
        samples: list[list[np.ndarray]] = [[] for _ in some_channels]
        of_channels = [bytearray() for _ in some_channels]
        for kind, at, length in walk(file, len(head)):
            if kind != SONAR:
                others[kind] += 1
                continue
            count += 1
            if count <= first or stop is not None and count > stop:
                continue
            file.seek(at)
            packet = file.read(_bounded(at, length))
            headers += packet[:HEADER]
            rows = _samples(packet, at, infos, channel_layout)
            for number, channel in enumerate(some_channels):
                if channel.number not in rows:
                    raise ValueError(f"the ping at byte {at} has no channel {channel.number}; choose others, or pings "
                                     "that have it.")
                own, row = rows[channel.number]
                of_channels[number] += own
                samples[number].append(row[::-1].copy() if channel.side == SIDES[0] else row.copy())
    if not headers:
        raise ValueError(f"it has {count} sidescan pings, and none of those asked for; give a sidescan's file, or "
                         "other pings.")
    pings = np.frombuffer(headers, ping_layout)
    sides = np.stack([np.frombuffer(own, channel_layout) for own in of_channels], 1)
    with np.errstate(all="ignore"):                      # damaged headers hold any bits as numbers
        columns = {**_of_pings(pings, header.NavUnits == 3), **_of_sides(sides, samples)}
    columns, source = _completed(path, columns, set(others) & set(_KINDS) - {1})
    left_out = [*([left] if left else []), *(f"{number} packets of type {kind} ({_KINDS.get(kind, 'unknown')})"
                                             for kind, number in sorted(others.items()))]
    lows = [channel.frequency for channel in some_channels if channel.frequency is not None]
    every = _channels(infos)
    return dataset(samples, [channel.side for channel in some_channels], columns, {
        "frequency": lows[0] if lows else _frequency(sides),
        "channel_numbers": [channel.number for channel in some_channels],
        "channels": [vars(channel) for channel in every], "geographic": header.NavUnits == 3, "left_out": left_out,
        "navigation_from": source, "recording_program": text(header.RecordingProgramName),
        "sonar": text(header.SonarName), "note": text(header.NoteString)})


def _channels(infos):
    """Return the channels to port and starboard."""
    return [SideChannel(number=number, side=_SIDES[info.TypeOfChannel], name=text(info.ChannelName),
                        frequency=float(hertz_from_khz(info.Frequency)) if 0 < info.Frequency < 1e5 else None)
            for number, info in enumerate(infos) if info.TypeOfChannel in _SIDES]


def _bounded(at, length):
    if length > MOST_PACKET:
        raise ValueError(f"the packet at byte {at} has {length / 1e6:.0f} MB; the file is damaged there.")
    return length


def _samples(packet, at, infos, layout):
    """Return the header and the samples, as stored, of each channel of a packet, by the channel's number."""
    found, place = {}, HEADER
    channels = int.from_bytes(packet[4:6], "little")
    for _ in range(channels):
        if place + CHANNEL > len(packet):
            raise ValueError(f"the ping at byte {at} has {channels} channels, and room for {len(found)}; the file is "
                             "damaged there.")
        own = packet[place:place + CHANNEL]
        place += CHANNEL
        fields = np.frombuffer(own, layout)[0]
        number = int(fields["ChannelNumber"])
        if number >= len(infos):
            raise ValueError(f"the ping at byte {at} has a channel {number}, and the file {len(infos)} channels; the "
                             "file is damaged there.")
        kind = _kind(infos[number], number)
        count = int(fields["NumSamples"]) or int(infos[number].Reserved)     # older files have it in their header
        size = count * kind.itemsize
        if place + size > len(packet):
            raise ValueError(f"the ping at byte {at} has {count} samples on channel {number}, more than its "
                             f"{len(packet)} bytes; the file is damaged there.")
        found[number] = own, np.frombuffer(packet, kind, count, place)
        place += size
    return found


def _kind(info, number):
    """Return the type of a channel's samples."""
    if info.SampleFormat == _FLOAT and info.BytesPerSample == 4:
        return np.dtype("<f4")
    if info.SampleFormat == _IBM or info.BytesPerSample not in _INTEGERS:
        raise ValueError(f"channel {number} has samples of format {info.SampleFormat} and {info.BytesPerSample} bytes; "
                         "integers of 1, 2 or 4 bytes and IEEE floats are read.")
    return np.dtype(_INTEGERS[info.BytesPerSample])


def _of_pings(pings, geographic):
    """Return columns (ping,) of the headers."""
    time, sound = navigation.dates(pings)
    place = {}
    for axis in "XY":
        sensor, ship = (pings[f"{name}{axis}coordinate"].astype(float) for name in ("Sensor", "Ship"))
        place[axis] = sensor if np.any(sensor) else ship
    here = np.isfinite(place["X"]) & np.isfinite(place["Y"]) & ((place["X"] != 0) | (place["Y"] != 0))
    if geographic:
        here &= (np.abs(place["X"]) <= 360) & (np.abs(place["Y"]) <= 90)
    names = ("longitude", "latitude") if geographic else ("x", "y")
    heading = pings["SensorHeading"] if np.any(pings["SensorHeading"]) else pings["ShipGyro"]
    speed = pings["SensorSpeed"] if np.any(pings["SensorSpeed"]) else pings["ShipSpeed"]
    sound_speed = pings["SoundVelocity"].astype(float)
    return {
        "ping_time": np.where(sound, time, np.nan), "ping_number": pings["PingNumber"].astype(np.int64),
        **{name: np.where(here, place[axis], np.nan) for name, axis in zip(names, "XY", strict=True)},
        "altitude": known(pings["SensorPrimaryAltitude"], 0, 12000, nothing=0),
        "sensor_depth": known(pings["SensorDepth"], 0, 12000, every=True),
        "heading": radians_from_deg(known(heading, -720, 720, every=True)),
        "pitch": radians_from_deg(known(pings["SensorPitch"], -90, 90, every=True)),
        "roll": radians_from_deg(known(pings["SensorRoll"], -180, 180, every=True)),
        "heave": known(pings["Heave"], -100, 100, every=True),
        "speed": metres_per_second_from_knots(known(speed, 0, 100, every=True)),
        "sound_speed": known(np.where(sound_speed < _FASTEST_HALF, 2 * sound_speed, sound_speed), 1000, 2000)}


def _of_sides(sides, samples):
    """Return columns (ping, side) of the channels' headers."""
    count = np.array([[row.size for row in side] for side in samples]).T
    slant_range = known(sides["SlantRange"], 0, 1e5, nothing=0)
    # most recorders write the duration; the range at 1500 m/s takes its place where they do not
    duration = known(sides["TimeDuration"], 0, 1000, nothing=0)
    duration = np.where(np.isfinite(duration), duration, 2 * slant_range / 1500)
    return {"sample_interval": duration / np.maximum(count, 1), "sample_start": known(sides["TimeDelay"], 0, 1000),
            "slant_range": slant_range, **{name: sides[field].astype(np.int64) for name, field in _OF_CHANNEL.items()}}


def _frequency(sides):
    khz = sides["Frequency"].astype(float)
    return float(hertz_from_khz(np.median(khz))) if khz.any() else None


def _completed(path, columns, kinds):
    """Return the columns, with what no header has taken from packets of navigation and attitude; and their source."""
    names = ("longitude", "latitude") if "longitude" in columns else ("x", "y")
    lacking = [name for name in (*names, "heading", "pitch", "roll", "heave") if not np.isfinite(columns[name]).any()]
    time = columns["ping_time"]
    if not lacking or not kinds or not np.isfinite(time).any():
        return columns, "ping headers"
    try:
        track = navigation.read(path)
    except ValueError:                                   # these packets hold no track: the headers stay as they are
        return columns, "ping headers"
    values = {names[0]: track.x, names[1]: track.y, "heading": track.heading, "pitch": track.pitch,
              "roll": track.roll, "heave": track.heave}
    there = {name: values[name] for name in lacking if values[name] is not None and np.any(values[name])}
    if "heading" in there:
        there["heading"] = np.unwrap(there["heading"])
    inside = (time >= track.time[0]) & (time <= track.time[-1])
    found = {name: np.where(inside, np.interp(time, track.time, value), np.nan) for name, value in there.items()}
    if "heading" in found:
        found["heading"] %= 2 * np.pi
    return {**columns, **found}, f"ping headers{f'; {chr(44).join(there)} from packets' if there else ''}"
