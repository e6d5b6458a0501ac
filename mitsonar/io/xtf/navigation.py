"""Navigation from XTF files (eXtended Triton Format, rev. 40): where a survey's ship or towed body went.

Positions come from the first of these that the file has: raw navigation packets (type 107), navigation packets (42),
headers of sonar and bathymetry pings (the towed body's, else the ship's). Attitude comes from attitude packets (3),
else from where the positions come from; heading also from gyro packets (23, 84). Roll is positive to starboard, pitch
nose up and heave up, as here. The depth is that of the sensor in ping headers; without one it is not known.

All is interpolated to the clock of positions or of attitude, whichever is finer, over the time both cover. Records that
cannot be true are left out and counted: impossible dates and places, repeated times, jumps.

The packets' layouts are pyxtf's; `packets.walk` goes from one to the next, so that a damaged length, or a file of
100 GB, costs neither an endless loop nor memory.
"""
import logging

import numpy as np

from mitsonar.device.files import FilePath

from ..tracks.navigation import Navigation, unrepeated
from .packets import file_header, walk
from .pings import structure

_log = logging.getLogger(__name__)

_MOST_BYTES = 512_000_000          # of navigation kept
_FASTEST = 25.0                    # [m/s], beyond any sonar's platform
_TICK = 1e-3                       # [s] that clocks may differ, since packets hold times to different digits
_SLACK = 2.0                       # [m] that positions may jump beside
_METRES_PER_DEGREE = 111_195.0
_LARGEST_HEADING = 720.0           # [degrees]
_VENDORS_PINGS = (65, 68)          # R2Sonic, a ping header before data that pyxtf does not know
_LONGEST = 2 * 86400.0             # [s] from the file's median time; beyond it a date is wrong
_FRACTIONS = {"Microsecond": 1e-6, "Millisecond": 1e-3, "HSeconds": 1e-2}


def recognised(path: FilePath) -> bool:
    """Return True if a file is XTF by its name, or by its first byte 123 followed by binary data."""
    with open(path, "rb") as file:
        start = file.read(1024)
    return str(path).lower().endswith(".xtf") or (start[:1] == b"\x7b" and b"\0" in start)


def read(path: FilePath) -> Navigation:
    """Read the navigation of an XTF file."""
    try:
        return navigation_of(path)
    except ValueError as error:
        raise ValueError(f"cannot read the track {path}: {error}") from None


def navigation_of(path: FilePath) -> Navigation:
    """Return the navigation of an XTF file; errors do not name the file."""
    with np.errstate(invalid="ignore", over="ignore"):      # damaged packets hold any bits as numbers
        return _navigation(path, *_packets(path))


def _packets(path):
    """Return the packets of navigation, a structured array of each kind, and of all pings."""
    import pyxtf
    from pyxtf.xtf_ctypes import XTFPacketClasses  # pyright: ignore[reportAttributeAccessIssue]  pyxtf has it

    pings = [int(kind) for kind, layout in XTFPacketClasses.items() if issubclass(layout, pyxtf.XTFPingHeader)]
    layouts = {107: pyxtf.XTFPosRawNavigation, 42: pyxtf.XTFHeaderNavigation, 3: pyxtf.XTFAttitudeData,
               23: pyxtf.XTFHeaderGyro, 84: pyxtf.XTFHeaderGyro,
               **dict.fromkeys((*pings, *_VENDORS_PINGS), pyxtf.XTFPingHeader)}
    layouts = {kind: structure(layout) for kind, layout in layouts.items()}
    kept, total = {}, 0
    with open(path, "rb") as file:
        header, head = file_header(file)
        for kind, at, length in walk(file, len(head)):
            if kind in layouts and length >= layouts[kind].itemsize:
                file.seek(at)
                kept.setdefault(kind, bytearray()).extend(file.read(layouts[kind].itemsize))
                total += layouts[kind].itemsize
                if total > _MOST_BYTES:
                    raise ValueError(f"it holds more than {_MOST_BYTES / 1e6:.0f} MB of navigation; split it.")
    found = {kind: np.frombuffer(raw, layouts[kind]) for kind, raw in kept.items()}
    headers = [found.pop(kind) for kind in (*pings, *_VENDORS_PINGS) if kind in found]
    return header.NavUnits, found, np.concatenate(headers) if headers else None


def _navigation(path, units, packets, pings):
    if units not in (0, 3):
        raise ValueError(f"its navigation is in units of type {units}; 0 (metres) and 3 (degrees) are known.")
    dropped = {}
    time, place, source = _positions(units == 3, packets, pings, dropped)
    clock, angles = _attitude(source, packets, time, dropped)
    heading = _heading(source, angles, packets, dropped)
    first, last = max(time[0], clock[0]), min(time[-1], clock[-1])
    if not first < last:
        raise ValueError(f"positions are recorded for {time[-1] - time[0]:.0f} s and attitude for "
                         f"{clock[-1] - clock[0]:.0f} s, but never together; the packets' clocks disagree.")
    finer = time if time.size >= clock.size else clock
    at = finer[(finer >= first - _TICK) & (finer <= last + _TICK)]
    if at.size < 2:
        raise ValueError("positions and attitude are recorded together at less than two times; the packets' clocks "
                         "disagree.")
    place = unrepeated(path, time, place, at)
    depth = _sensor_depth(pings, at, dropped)
    _log.info("%s: %d positions and %d attitudes over %.1f s; left out: %s", path, time.size, clock.size,
              at[-1] - at[0], _listed(dropped))
    roll, pitch, heave = (np.interp(at, clock, angles[name]) for name in ("roll", "pitch", "heave"))
    return Navigation(time=at, x=place[:, 0], y=place[:, 1], z=None if depth is None else -depth, heave=heave,
                      roll=np.deg2rad(roll), pitch=np.deg2rad(pitch),
                      heading=None if heading is None else _turned(at, *heading), geographic=units == 3)


def _positions(geographic, packets, pings, dropped):
    """Return times (P,), places (P, 2) and the records they come from."""
    pairs = [(packets.get(107), "Raw"), (packets.get(42), "Raw")]
    pairs += [(pings, "Sensor"), (pings, "Ship")]
    for records, prefix in pairs:
        if records is None:
            continue
        place = np.stack([records[f"{prefix}Xcoordinate"], records[f"{prefix}Ycoordinate"]], -1)
        if not np.any(place):
            continue
        time, order = _times(records, "positions", dropped)
        place = place[order]
        real = np.isfinite(place).all(1) & np.any(place != 0, 1)
        if geographic:
            real &= (np.abs(place[:, 0]) <= 180) & (np.abs(place[:, 1]) <= 90)
        else:
            real &= np.abs(np.where(np.isfinite(place), place, 0)).max(1, initial=0) < 1e9
        _count(dropped, "impossible places", ~real)
        time, place, records = time[real], place[real], records[order][real]
        if geographic and time.size:
            place[:, 0] = np.unwrap(place[:, 0], period=360)
        near = _without_jumps(time, place, geographic)
        _count(dropped, "jumps", ~near)
        if near.size > 2 and 2 * near.sum() <= near.size:
            raise ValueError(f"{near.size - near.sum()} of its {near.size} positions jump faster than {_FASTEST:g} m/s "
                             "away from the others; it is not a track.")
        if near.sum() < 2:
            raise ValueError(f"fewer than two of its positions are plausible (left out: {_listed(dropped)}); it is "
                             "not a track.")
        return time[near], place[near], records[near]
    raise ValueError("it holds no navigation: no packet has a position; give a track as CSV.")


def calendar(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return whole seconds (P,) [s since 1970] of calendar fields, and a mask of those whose date can be."""
    fields = {name: records[name].astype(np.int64) for name in ("Year", "Month", "Day", "Hour", "Minute", "Second")}
    month = (fields["Year"] - 1970) * 12 + fields["Month"] - 1
    day = month.astype("datetime64[M]").astype("datetime64[D]") + (fields["Day"] - 1)
    sound = (fields["Year"] >= 1970) & (fields["Month"] >= 1) & (fields["Month"] <= 12) & (fields["Day"] >= 1)
    sound &= (day.astype("datetime64[M]").astype(np.int64) == month) & (fields["Hour"] < 24)
    sound &= (fields["Minute"] < 60) & (fields["Second"] < 61)
    time = day.astype(np.int64) * 86400.0 + fields["Hour"] * 3600.0 + fields["Minute"] * 60.0 + fields["Second"]
    return time, sound


def dates(records: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (P,) [s since 1970] of packets, and a mask of those whose date can be."""
    time, sound = calendar(records)
    names = records.dtype.names or ()
    name, unit = next((name, unit) for name, unit in _FRACTIONS.items() if name in names)
    if name == "Microsecond" and records.dtype[name].itemsize == 2:
        unit = 1e-4                # two bytes hold tenths of milliseconds, whatever pyxtf calls them
    time += records[name] * unit
    if "EpochMicroseconds" in names:
        epoch = records["SourceEpoch"] > 0
        time = np.where(epoch, records["SourceEpoch"] + 1e-6 * records["EpochMicroseconds"], time)
        sound |= epoch
    return time, sound


def _times(records, what, dropped):
    """Return strictly increasing times [s since 1970] and the records' order, without records that have no time."""
    time, sound = dates(records)
    if sound.any():
        sound &= np.abs(time - np.median(time[sound])) <= _LONGEST
    _count(dropped, f"{what} without a sound date", ~sound)
    order = np.flatnonzero(sound)
    order = order[np.argsort(time[order], kind="stable")]
    new = np.diff(time[order], prepend=-np.inf) > 0
    _count(dropped, f"repeated {what}", ~new)
    return time[order][new], order[new]


def _without_jumps(time, place, geographic):
    """Return a mask (P,) of places that a platform can reach from the others, beginning from the middle one."""
    scale = np.ones(2)
    if geographic and time.size:
        scale = _METRES_PER_DEGREE * np.array([np.cos(np.deg2rad(np.median(place[:, 1]))), 1.0])
    metres = place * scale
    near = np.zeros(time.size, bool)
    if not time.size:
        return near
    middle = int(np.argmin(np.abs(metres - np.median(metres, axis=0)).sum(1)))
    near[middle] = True
    for numbers in (range(middle + 1, time.size), range(middle - 1, -1, -1)):
        last = middle
        for number in numbers:
            if np.hypot(*(metres[number] - metres[last])) <= _SLACK + _FASTEST * abs(time[number] - time[last]):
                near[number], last = True, number
    return near


def _attitude(source, packets, time, dropped):
    """Return times and roll, pitch [degrees] and heave [m], of the attitude packets or of the positions' own records.
    """
    records = packets.get(3)
    if records is not None:
        clock, order = _times(records, "attitudes", dropped)
        records = records[order]
    if records is None or clock.size < 2:
        clock, records = time, source
    names = records.dtype.names
    columns = {"roll": "Roll" if "Roll" in names else "SensorRoll",
               "pitch": "Pitch" if "Pitch" in names else "SensorPitch", "heave": "Heave"}
    angles = {name: records[column].astype(float) if column in names else np.zeros(clock.size)
              for name, column in columns.items()}
    angles["heading"] = records["Heading"].astype(float) if "Heading" in names else np.zeros(clock.size)
    real = (np.isfinite(list(angles.values())).all(0) & (np.abs(angles["roll"]) <= 180)
            & (np.abs(angles["pitch"]) <= 90) & (np.abs(angles["heave"]) < 100)
            & (np.abs(angles["heading"]) <= _LARGEST_HEADING))
    _count(dropped, "impossible attitudes", ~real)
    if real.sum() < 2:
        raise ValueError("fewer than two of its attitudes are plausible: roll, pitch and heave exceed those of any "
                         "platform.")
    return clock[real], {"clock": clock[real], **{name: column[real] for name, column in angles.items()}}


def _heading(source, angles, packets, dropped):
    """Return times and headings [degrees] of the first record that has any, or None."""
    if np.any(angles["heading"]):
        return angles["clock"], angles["heading"]
    for kind, column in ((23, "Gyro"), (84, "Gyro"), (None, "Heading"), (None, "SensorHeading"), (None, "ShipGyro")):
        records = source if kind is None else packets.get(kind)
        if records is None or column not in records.dtype.names or not np.any(records[column]):
            continue
        clock, order = _times(records, "headings", dropped)
        heading = records[column][order].astype(float)
        real = np.isfinite(heading) & (np.abs(heading) <= _LARGEST_HEADING)
        if real.sum() >= 2:
            return clock[real], heading[real]
    return None


def _turned(at, clock, heading_deg):
    """Interpolate headings [rad] the short way round."""
    return np.interp(at, clock, np.unwrap(np.deg2rad(heading_deg)))


def _sensor_depth(pings, at, dropped):
    """Return the depth [m] of the sensor in ping headers, at times; None if no header has it."""
    if pings is None or not np.any(pings["SensorDepth"]):
        return None
    clock, order = _times(pings, "pings", dropped)
    depth = pings["SensorDepth"][order].astype(float)
    real = np.isfinite(depth) & (depth >= 0) & (depth < 12000)
    _count(dropped, "impossible depths", ~real)
    return np.interp(at, clock[real], depth[real]) if real.any() else None


def _listed(dropped):
    return ", ".join(f"{count} {what}" for what, count in dropped.items() if count) or "none"


def _count(dropped, what, which):
    dropped[what] = dropped.get(what, 0) + int(np.count_nonzero(which))
