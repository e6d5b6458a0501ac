"""Ping headers of XTF files: layouts, times, track and sound speed.

A header's position is in degrees (WGS 84) or in metres, as the file's header states. Headings refer to true north with
degrees, to the y axis with metres. Times of ping headers are hundredths of a second; those of the packets of navigation
and attitude before each are tenths of a millisecond. The layouts of packets are NumPy types with the fields of pyxtf.
"""
from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.earth import Frame, origin, system
from mitsonar.units import deg_from_radians, knots_from_metres_per_second

if TYPE_CHECKING:
    import xarray as xr

MAGIC = 0xFACE                     # first two bytes of a packet


def structure(layout: type[ctypes.Structure]) -> np.dtype:
    """Return a packet's layout as a NumPy type, inherited fields and all but arrays."""
    fields = {name: (np.dtype(kind), getattr(layout, name).offset) for cls in reversed(layout.__mro__)
              for name, kind in getattr(cls, "_fields_", ()) if not issubclass(kind, ctypes.Array)}
    return np.dtype({"names": list(fields), "formats": [kind for kind, _ in fields.values()],
                     "offsets": [at for _, at in fields.values()], "itemsize": ctypes.sizeof(layout)})


EARLIEST, LATEST = "1970-01-01", "10000-01-01"


def clock(time: np.ndarray, ticks: int) -> dict[str, np.ndarray]:
    """Split times (P,) [s since 1970] into calendar fields, with ``ticks`` per second."""
    first, last = (np.datetime64(day, "s").astype(np.int64) for day in (EARLIEST, LATEST))
    outside = np.flatnonzero(~((time >= first) & (time < last)))
    if outside.size:
        raise ValueError(f"ping {outside[0]} is at {time[outside[0]]:.6g} s from 1970; XTF holds the years 1970 to "
                         "9999: give another start.")
    whole = np.rint(np.asarray(time, float) * ticks).astype(np.int64)
    second, tick = np.divmod(whole, ticks)
    day, rest = np.divmod(second, 86400)
    date = day.astype("datetime64[D]")
    month, year = date.astype("datetime64[M]"), date.astype("datetime64[Y]")
    return {"Year": year.astype(np.int64) + 1970, "Month": month.astype(np.int64) % 12 + 1,
            "Day": (date - month).astype(np.int64) + 1, "Hour": rest // 3600, "Minute": rest // 60 % 60,
            "Second": rest % 60, "Tick": tick, "JulianDay": (date - year).astype(np.int64) + 1}


SONAR, ATTITUDE, NAVIGATION = 0, 3, 107                  # types of packets
LATEST_EPOCH = 1 << 32             # [s] since 1970
HUNDREDTHS, TENTHS_OF_MILLISECONDS = 100, 10_000       # of a second


@dataclass(frozen=True, kw_only=True)
class XtfPassage:
    """Columns that all headers of a file's pings share, each an array (P,)."""

    time: np.ndarray  # [s]: since 1970
    number: np.ndarray  # of the ping
    x: np.ndarray  # longitude [degrees] or easting [m]
    y: np.ndarray  # latitude [degrees] or northing [m]
    heading: np.ndarray  # [degrees]
    pitch: np.ndarray  # [degrees]
    roll: np.ndarray  # [degrees]
    scene: np.ndarray  # (P, 3) [m]: x, y, z of the scene
    altitude: np.ndarray  # [m]: 0 where there is no bed below
    speed_knots: np.ndarray  # [knots]
    sound_speed: float  # [m/s]
    geographic: bool


def passage_of(record: xr.Dataset, start: float, geographic: bool) -> XtfPassage:
    """Return the passage of a record whose time 0 is ``start`` [s since 1970]."""
    time = np.asarray(record["ping_time"].values, float)
    scene = np.stack([np.asarray(record[axis].values, float) for axis in "xyz"], -1)
    east, north = origin(record.attrs)
    heading = np.asarray(record["heading"].values, float)
    if geographic:
        frame = Frame(crs=system(record.attrs) or "", origin=(east, north))
        latitude, longitude, convergence = frame.on_globe(scene[:, :2])
        x, y, heading = longitude, latitude, heading + convergence
    else:
        x, y = scene[:, 0] + east, scene[:, 1] + north
    speed = np.zeros(time.size)
    if time.size > 1:
        speed = np.linalg.norm([np.gradient(scene[:, axis], time) for axis in (0, 1)], axis=0)
    altitude = np.asarray(record["altitude"].values, float)
    return XtfPassage(time=start + time, number=np.asarray(record["ping"].values), x=x, y=y,
                   heading=np.mod(deg_from_radians(heading), 360.0), scene=scene,
                   pitch=deg_from_radians(np.asarray(record["pitch"].values, float)),
                   roll=deg_from_radians(np.asarray(record["roll"].values, float)),
                   altitude=np.where(np.isfinite(altitude), altitude, 0.0),
                   speed_knots=knots_from_metres_per_second(speed),
                   sound_speed=float(record.attrs["sound_speed"]), geographic=geographic)


def navigation(passage: XtfPassage) -> Mapping[str, np.ndarray | float]:
    """Return the fields of the navigation packets, one a ping."""
    times = clock(passage.time, TENTHS_OF_MILLISECONDS)
    return {"MagicNumber": MAGIC, "HeaderType": NAVIGATION, "NumBytesThisRecord": 64, **_dated(times),
            "Microsecond": times["Tick"],                    # as pyxtf calls it
            "RawXcoordinate": passage.x, "RawYcoordinate": passage.y, "Pitch": passage.pitch, "Roll": passage.roll,
            "Heading": passage.heading}


def attitude(passage: XtfPassage) -> Mapping[str, np.ndarray | float]:
    """Return the fields of the attitude packets, one a ping, at the times of the navigation packets."""
    times = clock(passage.time, TENTHS_OF_MILLISECONDS)
    second, tick = np.divmod(np.rint(passage.time * TENTHS_OF_MILLISECONDS).astype(np.int64), TENTHS_OF_MILLISECONDS)
    # the epoch has 32 bits; readers then take the date
    epoch = np.where(second < LATEST_EPOCH, second, 0)
    return {"MagicNumber": MAGIC, "HeaderType": ATTITUDE, "NumBytesThisRecord": 64, **_dated(times),
            "Millisecond": times["Tick"] // 10, "SourceEpoch": epoch,
            "EpochMicroseconds": np.where(epoch > 0, 100 * tick, 0), "Pitch": passage.pitch, "Roll": passage.roll,
            "Heading": passage.heading, "TimeTag": np.rint(1e3 * (passage.time - passage.time[0])) % (1 << 32)}


def ping_headers(passage: XtfPassage, channels: int, length: int) -> Mapping[str, np.ndarray | float]:
    """Return the fields of the ping headers, of `channels` channels in packets of `length` bytes."""
    times = clock(passage.time, HUNDREDTHS)
    since = np.rint(1e3 * (passage.time - passage.time[0]))
    return {"MagicNumber": MAGIC, "HeaderType": SONAR, "NumChansToFollow": channels, "NumBytesThisRecord": length,
            **_dated(times), "HSeconds": times["Tick"], "JulianDay": times["JulianDay"], "PingNumber": passage.number,
            # half the speed, as the format's own program writes it: ranges are this times a two-way time
            "SoundVelocity": 0.5 * passage.sound_speed, "ComputedSoundVelocity": passage.sound_speed,
            "AuxVal1": passage.scene[:, 0], "AuxVal2": passage.scene[:, 1], "AuxVal3": passage.scene[:, 2],
            "ShipSpeed": passage.speed_knots, "SensorSpeed": passage.speed_knots,
            "ShipGyro": passage.heading, "SensorHeading": passage.heading,
            "ShipXcoordinate": passage.x, "SensorXcoordinate": passage.x,
            "ShipYcoordinate": passage.y, "SensorYcoordinate": passage.y,
            "FixTimeHour": times["Hour"], "FixTimeMinute": times["Minute"], "FixTimeSecond": times["Second"],
            "FixTimeHsecond": times["Tick"], "NavFixMilliseconds": since, "AttitudeTimeTag": since,
            "SensorDepth": -passage.scene[:, 2], "SensorPrimaryAltitude": passage.altitude,
            "SensorPitch": passage.pitch, "SensorRoll": passage.roll}


def _dated(times):
    return {name: times[name] for name in ("Year", "Month", "Day", "Hour", "Minute", "Second")}
