"""Sidescans of JSF files (EdgeTech): sonar messages (type 80) of the subsystems from 20, low frequency first.

Channels 0 and 1 of a subsystem are port and starboard. Here the number of a channel is its own plus 10 times that of
its subsystem. Envelopes are as recorded, 16 bits with a ``weight`` for each ping. Analytic samples become their
magnitude, in the same steps. Samples before the matched filter are refused, since they are no picture.

A sonar message repeats the navigation that came last. Where the file has messages of sensors, roll, pitch, heave and
heading are theirs (type 2020), interpolated to the ping; so are positions of NMEA sentences (2002), unless all sonar
messages mark their positions as interpolated. Depth and sound speed come from the pressure sensor (2060), and altitude
from the Doppler log (2080), where sonar messages have none.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.units import metres_per_second_from_knots, radians_from_deg

from ..nmea import at_times, fix_of
from . import jsf_messages as jsf
from .jsf_messages import SONAR, SONAR_MESSAGE, JsfMessage
from .record import SIDES, USUAL_SPEED, SideChannel, chosen, dataset, known, text

FIRST, LAST = 20, 29               # subsystems of sidescans
ENVELOPE, ANALYTIC = 0, 1          # kinds of samples
MOST_SMALL = 500_000_000           # bytes of messages of sensors
WITH_HIGH, WITH_LOW, WITH_SPEED, WITH_SWEEP = 0xA, 0xB, 0xC, 0xD       # protocols that have further digits
Series = tuple[np.ndarray, np.ndarray]                   # times [s since 1970], values


def read(path: FilePath, numbers: Sequence[int] | None, frequency: float | None, some: slice) -> xr.Dataset:
    """Read the chosen channels and pings; arguments as `sidescan_lines.read`."""
    with open(path, "rb") as file:
        others, of_channels, small, total = Counter[int](), {}, {kind: [] for kind in jsf.SMALL}, 0
        for message in jsf.walk(file):
            number = 10 * message.subsystem + message.channel
            if (message.kind == SONAR and FIRST <= message.subsystem <= LAST and message.channel < len(SIDES)
                    and message.size >= SONAR_MESSAGE.itemsize):
                of_channels.setdefault(number, []).append(message)
                continue
            if message.kind in small and message.size >= jsf.SMALL[message.kind].itemsize:
                file.seek(message.at)
                small[message.kind].append(file.read(min(message.size, 256)))
                total += len(small[message.kind][-1])
            if total > MOST_SMALL:
                raise ValueError(f"it holds more than {MOST_SMALL / 1e6:.0f} MB of navigation; split it.")
            others[message.kind] += message.kind not in small
        channels = [SideChannel(number=number, side=SIDES[number % 10], frequency=_frequency(file, messages[0]),
                                name=f"subsystem {number // 10}") for number, messages in sorted(of_channels.items())]
        pairs, left = chosen(channels, numbers, frequency)
        headers, samples, versions = _pings(file, [of_channels[channel.number] for channel in pairs], some)
    with np.errstate(all="ignore"):                      # damaged headers hold any bits as numbers
        columns, source = _columns(headers, versions, samples, _sensors(small))
    left_out = [*([left] if left else []), *(f"{count} messages of type {kind} ({jsf.NAMES.get(kind, 'unknown')})"
                                             for kind, count in sorted(others.items()) if count)]
    lows = [channel.frequency for channel in pairs if channel.frequency is not None]
    return dataset(samples, [channel.side for channel in pairs], columns, {
        "frequency": lows[0] if lows else None, "channel_numbers": [channel.number for channel in pairs],
        "channels": [vars(channel) for channel in channels], "geographic": "longitude" in columns,
        "left_out": left_out, "navigation_from": source, "recording_program": "", "sonar": "EdgeTech",
        "note": text(headers[0, 0]["note"])})


def _frequency(file, message: JsfMessage) -> float | None:
    """Return the middle of the band [Hz] of a message."""
    low, high = _band(_header(file, message), np.uint8(message.version))
    return float(low + high) / 2 or None


def _header(file, message):
    file.seek(message.at)
    return np.frombuffer(file.read(SONAR_MESSAGE.itemsize), SONAR_MESSAGE)[0]


def _band(headers, version):
    """Return the first and the last frequency [Hz] of the transmissions."""
    high = np.where(version >= WITH_HIGH, headers["high"], 0).astype(np.int64)
    return 10.0 * (headers["first"] + ((high & 0xF) << 16)), 10.0 * (headers["last"] + ((high >> 4 & 0xF) << 16))


def _pings(file, of_channels, some):
    """Return headers (ping, side), rows of samples ``[side][ping]`` and protocols (ping,) of the pings asked for."""
    groups: list[list[list[tuple[JsfMessage, np.void]]]] = []
    ordered = sorted(((message, number) for number, messages in enumerate(of_channels) for message in messages),
                     key=lambda pair: pair[0].at)
    last = None
    for message, number in ordered:
        header = _header(file, message)
        ping, packet = int(header["number"]), int(header["packet"])
        if ping != last or groups[-1][number] and packet <= 1:
            groups.append([[] for _ in of_channels])
        groups[-1][number].append((message, header))
        last = ping
    wanted = groups[some]
    if not wanted:
        raise ValueError(f"it has {len(groups)} sidescan pings, and none of those asked for; give other pings.")
    headers = np.zeros((len(wanted), len(of_channels)), SONAR_MESSAGE)
    samples: list[list[np.ndarray]] = [[] for _ in of_channels]
    for ping, group in enumerate(wanted):
        there = next(packets for packets in group if packets)[0][1]
        for number, packets in enumerate(group):
            headers[ping, number] = packets[0][1] if packets else there      # a lost side has the other's navigation
            samples[number].append(np.concatenate([_samples(file, *packet) for packet in packets])
                                   if packets else np.zeros(0, np.uint16))
    versions = [next(packets for packets in group if packets)[0][0].version for group in wanted]
    return headers, samples, np.array(versions)


def _samples(file, message, header):
    """Return the samples of a message."""
    kind = int(header["kind"])
    if kind not in (ENVELOPE, ANALYTIC):
        raise ValueError(f"the message at byte {message.at} has samples of kind {kind}; envelopes (0) and analytic "
                         "samples after the matched filter (1) are read.")
    high = int(header["high"]) if message.version >= WITH_HIGH else 0
    count = (int(header["samples"]) + ((high >> 8 & 0xF) << 16)) * (1 + (kind == ANALYTIC))
    if SONAR_MESSAGE.itemsize + 2 * count > message.size:
        raise ValueError(f"the message at byte {message.at} has {count} numbers, more than its {message.size} bytes; "
                         "the file is damaged there.")
    file.seek(message.at + SONAR_MESSAGE.itemsize)
    raw = file.read(2 * count)
    if kind == ENVELOPE:
        return np.frombuffer(raw, "<u2")
    real, imaginary = np.frombuffer(raw, "<i2").reshape(-1, 2).astype(np.float32).T
    return np.hypot(real, imaginary)


def _columns(headers, version, samples, sensors: Mapping[str, Series]):
    """Return the columns of the record, and where navigation comes from."""
    first, valid, units = headers[:, 0], headers[:, 0]["valid"], headers[:, 0]["units"]
    protocol = version[:, None]
    count = np.array([[row.size for row in side] for side in samples]).T
    low = np.where(protocol >= WITH_LOW, headers["low"] & 0xFF, 0)
    interval = known(1e-9 * (headers["interval"] + low / 256), 0, 1, nothing=0)
    start = headers["start"] * interval
    sound = known(np.where(valid & jsf.SOUND, first["sound"], np.nan), 1000, 2000)
    sweep = np.where(protocol >= WITH_SWEEP, headers["low_2"] >> 4 & 0x3FF, 0)
    starting, ending = _band(headers, protocol)
    whole_day = 1e-3 * first["milliseconds"]
    year = (first["year"].astype(np.int64) - 1970).astype("datetime64[Y]").astype("datetime64[D]").astype(np.int64)
    time = np.where(first["time"] > 0, first["time"] + whole_day % 1,
                    86400.0 * (year + first["day"] - 1) + whole_day)
    speed = 0.1 * first["speed"] + np.where(version >= WITH_SPEED, 0.01 * (first["low_2"] & 0xF), 0)
    columns = {
        "ping_time": time, "ping_number": first["number"].astype(np.int64), **_places(first, valid, units),
        "altitude": known(np.where(valid & jsf.ALTITUDE, 1e-3 * first["altitude"], 0), 0, 12000, nothing=0),
        "sensor_depth": known(np.where(valid & jsf.DEPTH, 1e-3 * first["depth"], np.nan), 0, 12000),
        "heading": radians_from_deg(np.where(valid & jsf.HEADING, 0.01 * first["heading"], np.nan)),
        "pitch": radians_from_deg(np.where(valid & jsf.ATTITUDE, jsf.ANGLE * first["pitch"], np.nan)),
        "roll": radians_from_deg(np.where(valid & jsf.ATTITUDE, jsf.ANGLE * first["roll"], np.nan)),
        "heave": known(np.where(valid & jsf.HEAVE, -first["heave"], np.nan), -100, 100),
        "speed": metres_per_second_from_knots(np.where(valid & jsf.SPEED, speed, np.nan)), "sound_speed": sound}
    taken = _replaced(columns, sensors, positions=not (valid & jsf.INTERPOLATED).all())
    travel = start + count * interval
    slant_range = 0.5 * np.where(np.isfinite(columns["sound_speed"]), columns["sound_speed"], USUAL_SPEED)[:, None]
    return {**columns, "sample_interval": interval, "sample_start": start, "slant_range": slant_range * travel,
            "weight": headers["weight"].astype(np.int64), "gain_code": headers["gain"].astype(np.int64),
            "source_level_percent": headers["level"].astype(float), "pulse_start_frequency": starting,
            "pulse_end_frequency": ending, "pulse_length": 1e-3 * headers["sweep"] + 1e-6 * sweep,
            }, f"sonar messages{f'; {chr(44).join(taken)} from messages of sensors' if taken else ''}"


def _places(first, valid, units):
    """Return the positions of sonar messages, in degrees or metres as most of them are."""
    here = (valid & jsf.PLACE).astype(bool)
    if here.any() and np.median(units[here]) != jsf.DEGREES:
        scale = np.select([units == unit for unit in jsf.PLACES], list(jsf.PLACES.values()), np.nan)
        return {name: np.where(here, scale * first[name], np.nan) for name in "xy"}
    here &= units == jsf.DEGREES
    longitude, latitude = (known(np.where(here, first[axis] / jsf.MINUTES, np.nan), -most, most)
                           for axis, most in (("x", 180), ("y", 90)))
    return {"longitude": longitude, "latitude": latitude}


def _replaced(columns, sensors, positions):
    """Put what sensors measured, interpolated to the pings, into the columns; return its names."""
    taken = []
    for name, (clock, values) in sensors.items():
        place, angle = name in ("longitude", "latitude"), name in ("heading", "pitch", "roll", "heave")
        if name not in columns or clock.size < 2 or place and not positions or not (
                place or angle or not np.isfinite(columns[name]).any()):
            continue
        if name == "heading":
            order = np.argsort(clock, kind="stable")
            clock, values = clock[order], np.unwrap(values[order])
        measured = at_times(columns["ping_time"], clock, values)
        columns[name] = np.where(np.isfinite(measured), measured, columns[name])
        if name == "heading":
            columns[name] %= 2 * np.pi
        taken.append(name)
    return taken


def _sensors(small) -> dict[str, Series]:
    """Return what the messages of sensors hold, by the names of the record's columns."""
    found: dict[str, Series] = {}
    messages = {kind: np.array([np.frombuffer(raw, layout, 1)[0] for raw in small[kind]], layout)
                for kind, layout in jsf.SMALL.items()}
    times = {kind: rows["time"] + 1e-3 * rows["milliseconds"] for kind, rows in messages.items()}
    motion, time = messages[jsf.MOTION], times[jsf.MOTION]
    for name, bit, values in (("pitch", jsf.PITCH_2020, radians_from_deg(jsf.ANGLE * motion["pitch"])),
                              ("roll", jsf.ROLL_2020, radians_from_deg(jsf.ANGLE * motion["roll"])),
                              ("heave", jsf.HEAVE_2020, -1e-3 * motion["heave"]),
                              ("heading", jsf.HEADING_2020, radians_from_deg(0.01 * motion["heading"]))):
        there = (motion["valid"] & bit).astype(bool)
        found[name] = time[there], values[there]
    water, time = messages[jsf.PRESSURE], times[jsf.PRESSURE]
    for name, bit, values in (("sensor_depth", jsf.DEPTH_2060, water["depth"].astype(float)),
                              ("sound_speed", jsf.SOUND_2060, 1e-3 * water["sound"])):
        there = (water["valid"] & bit).astype(bool)
        found[name] = time[there], values[there]
    bottom, time = messages[jsf.DOPPLER], times[jsf.DOPPLER]
    reached = np.where(bottom["distance"] > 0, bottom["distance"], np.nan) * 0.01
    there = (bottom["valid"] & jsf.DISTANCE_2080).astype(bool) & np.isfinite(reached).any(1)
    found["altitude"] = time[there], np.nanmean(reached[there], 1)
    fixes = [(clock, fix) for clock, raw in zip(times[jsf.NMEA], small[jsf.NMEA], strict=True)
             if (fix := fix_of(raw[jsf.NMEA_MESSAGE.itemsize:]))]
    clock = np.array([time for time, _ in fixes])
    for number, name in enumerate(("latitude", "longitude")):
        found[name] = clock, np.array([fix[number] for _, fix in fixes])
    return found
