"""Sidescans of SDF files (Klein): pages of versions 3501 (low frequency) and 3502 (high) of the UUV-3500.

A page begins with 0xFFFFFFFF and the number of bytes that follow. Its header has ``header`` bytes behind the first
four. Then come the samples of port and of starboard, each with their number before them, 32 bits a sample. Other pages
(bathymetry, other instruments) are left out. No recorded file was at hand to prove this: the layout is that of two
public readers, one of which read made files alike (SDF/SDFX Data Page Definitions Specification, Rev. 4.8).
"""
from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.units import hertz_from_khz, radians_from_deg

from ..xtf.navigation import calendar
from .record import SIDES, SideChannel, chosen, dataset, known

START = b"\xff\xff\xff\xff"
VERSIONS = {3501: "low frequency", 3502: "high frequency"}
LEAST_HEADER, MOST_PAGE = 412, 100_000_000               # bytes
MOST_NAMED = 8                     # versions in a sentence
_FIELDS = {"size": ("<u4", 4), "version": ("<u4", 8), "number": ("<u4", 16), "samples": ("<u4", 20),
           "range": ("<u4", 32), "speed": ("<u4", 36), "sound": ("<u4", 40), "Year": ("<u4", 72), "Month": ("<u4", 76),
           "Day": ("<u4", 80), "Hour": ("<u4", 84), "Minute": ("<u4", 88), "Second": ("<u4", 92),
           "heading": ("<f4", 112), "pitch": ("<f4", 116), "roll": ("<f4", 120), "altitude": ("<f4", 128),
           "ship": ("(2,)<f8", 148), "fish": ("(2,)<f8", 164), "gain": ("<u4", 180), "header": ("<u4", 184),
           "aux_pitch": ("<f4", 200), "aux_roll": ("<f4", 204), "aux_depth": ("<f4", 208), "aux_altitude": ("<f4", 212),
           "fraction": ("<f4", 220), "rate": ("<u4", 228), "khz": ("<u4", 408)}
PAGE = np.dtype({"names": list(_FIELDS), "formats": [kind for kind, _ in _FIELDS.values()],
                 "offsets": [at for _, at in _FIELDS.values()], "itemsize": LEAST_HEADER})


def read(path: FilePath, numbers: Sequence[int] | None, frequency: float | None, some: slice) -> xr.Dataset:
    """Read the chosen channels and pings; arguments as `sidescan_lines.read`."""
    with open(path, "rb") as file:
        others, of_versions = Counter[int](), {}
        for page, at in _pages(file):
            version = int(page["version"])
            if version in VERSIONS:
                of_versions.setdefault(version, []).append((page, at))
            else:
                others[version] += 1
        if not of_versions:
            raise ValueError(f"its pages are of the versions {', '.join(map(str, sorted(others)[:MOST_NAMED]))}, and "
                             "those of the UUV-3500 are read, 3501 and 3502; export it as XTF.")
        channels = [SideChannel(number=2 * list(VERSIONS).index(version) + number, side=side, name=VERSIONS[version],
                                frequency=float(hertz_from_khz(int(khz))) if (khz := pages[0][0]["khz"]) else None)
                    for version, pages in sorted(of_versions.items()) for number, side in enumerate(SIDES)]
        pairs, left = chosen(channels, numbers, frequency)
        versions = {list(VERSIONS)[channel.number // 2] for channel in pairs}
        if len(versions) > 1:
            raise ValueError("channels of both frequencies were asked for, whose pings are not the same; give those of "
                             "one.")
        pages = of_versions[versions.pop()]
        wanted = pages[some]
        if not wanted:
            raise ValueError(f"it has {len(pages)} sidescan pings, and none of those asked for; give other pings.")
        both = [_samples(file, page, at) for page, at in wanted]
    headers = np.array([page for page, _ in wanted], PAGE)
    samples = [[sides[channel.number % 2] for sides in both] for channel in pairs]
    with np.errstate(all="ignore"):                      # damaged headers hold any bits as numbers
        columns = _columns(headers, samples)
    left_out = [*([left] if left else []),
                *(f"{count} pages of version {kind}" for kind, count in sorted(others.items()))]
    return dataset(samples, [channel.side for channel in pairs], columns, {
        "frequency": pairs[0].frequency, "channel_numbers": [channel.number for channel in pairs],
        "channels": [vars(channel) for channel in channels], "geographic": True, "left_out": left_out,
        "navigation_from": "page headers", "recording_program": "", "sonar": "Klein", "note": ""})


def _pages(file):
    """Yield the header and the place of every page of a file."""
    size, at = os.fstat(file.fileno()).st_size, 0
    while at < size:
        file.seek(at)
        raw = file.read(PAGE.itemsize)
        if raw[:4] != START:
            raise ValueError(f"no page starts at byte {at}: the file is damaged there; record or copy it again.")
        if len(raw) < PAGE.itemsize:
            raise ValueError(f"it ends within the page at byte {at}: the file is cut off; copy it again.")
        page = np.frombuffer(raw, PAGE)[0]
        length = int(page["size"]) + 4
        if length < PAGE.itemsize or length > MOST_PAGE:
            raise ValueError(f"the page at byte {at} has {length} bytes: the file is damaged there.")
        if at + length > size:
            raise ValueError(f"it ends within the page at byte {at}: the file is cut off; copy it again.")
        yield page, at
        at += length


def _samples(file, page, at):
    """Return the samples of port and starboard of a page."""
    found, place, end = [], at + 4 + int(page["header"]), at + 4 + int(page["size"])
    for side in SIDES:
        file.seek(place)
        count = int.from_bytes(file.read(4), "little") if place + 4 <= end else end
        if place + 4 + 4 * count > end:
            raise ValueError(f"the page at byte {at} has {count} samples to {side}, more than its {end - at} bytes; "
                             "the file is damaged there.")
        found.append(np.frombuffer(file.read(4 * count), "<u4"))
        place += 4 + 4 * count
    return found


def _columns(headers, samples):
    """Return the columns of the record."""
    time, sound = calendar(headers)
    count = np.array([[row.size for row in side] for side in samples]).T
    fish = np.any(headers["fish"])
    latitude, longitude = headers["fish" if fish else "ship"].T                       # [rad]
    slant_range = np.repeat(known(headers["range"], 0, 1e5, nothing=0)[:, None], len(samples), 1)
    speed = known(0.01 * headers["sound"], 1000, 2000)
    interval = known(1 / headers["rate"].astype(float), 0, 1)[:, None] + np.zeros(count.shape)
    interval = np.where(np.isfinite(interval), interval,
                        2 * slant_range / np.where(np.isfinite(speed), speed, 1500)[:, None] / np.maximum(count, 1))
    gain = np.repeat(headers["gain"].astype(np.int64)[:, None], len(samples), 1)
    own = {name: headers[name] if np.any(headers[name]) else headers[f"aux_{name}"]
           for name in ("altitude", "pitch", "roll")}
    return {
        "ping_time": np.where(sound, time + known(headers["fraction"], 0, 1), np.nan),
        "ping_number": headers["number"].astype(np.int64),
        "longitude": known(np.rad2deg(longitude), -180, 180, every=True),
        "latitude": known(np.rad2deg(latitude), -90, 90, every=True),
        "altitude": known(own["altitude"], 0, 12000, nothing=0),
        "sensor_depth": known(headers["aux_depth"], 0, 12000, every=True),
        "heading": radians_from_deg(known(headers["heading"], -720, 720, every=True)),
        "pitch": radians_from_deg(known(own["pitch"], -90, 90, every=True)),
        "roll": radians_from_deg(known(own["roll"], -180, 180, every=True)),
        "heave": np.full(len(headers), np.nan), "speed": known(0.01 * headers["speed"], 0, 100, every=True),
        "sound_speed": speed, "sample_interval": interval, "sample_start": np.zeros(count.shape),
        "slant_range": slant_range, "weight": np.zeros(count.shape, np.int64), "gain_code": gain}
