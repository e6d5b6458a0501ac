"""Recorded sidescan line as a twin needs it: counts, altitude at every ping, and a smooth track.

    h' = h / cos(pitch)                                                                  first return of a level bed

h -> height above the bed, h' -> slant range of the first return: a sidescan's fan is a plane across the body, so that a
pitched one meets the bed later, and h tan(pitch) ahead.

The altitude is the recorded one where the first return in the picture agrees with it; else it is found from the first
return. An object in the water column may hide the return of one side, so both sides are compared.
"""
from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.ndimage import median_filter

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath
from mitsonar.imaging.picture_statistics import first_return
from mitsonar.io import sidescan_lines
from mitsonar.io.survey_lines.motion import smoothed
from mitsonar.io.tracks.navigation import Navigation, course, middle, unrepeated
from mitsonar.units import deg_from_radians

FEWEST = 2                         # pings of a track
MOST_SAMPLES = 60_000_000          # half a gigabyte each of counts, outputs and levels
AGREE = 0.1                        # share by which the sides' first returns may differ
NEAR, NEAR_SAMPLES = 0.01, 2.0     # share of the altitude, and samples, by which a recorded one may be off
STEP, WAY_STEP = 0.5, 2.0          # [s] between spline knots: of the altitude, of the track
BEYOND = 2.0                       # [s] by which pings may lie outside the navigation
DEPTH = 1.0                        # [m] of a sonar whose record has none
QUANTUM = 0.011                    # [s]: step of the times of pings
DAY = 86400.0                      # [s] from the median time, beyond which a date is wrong
JUMP = 20.0                        # [m] from the median of nine positions, beyond which one is wrong
METRES_PER_DEGREE = 111_195.0
DEFAULT_SPEED = 1500.0             # [m/s]
TURNED = np.deg2rad(5.0)           # a heading this far off the course is worth a word


@dataclass(frozen=True, kw_only=True, eq=False)
class SidescanLine:
    """Recorded line; a row per ping."""

    counts: np.ndarray  # (P, 2, S): port, starboard; near range first
    slant_range: np.ndarray  # (S,) [m]: middles of samples
    sound_speed: float  # [m/s]
    frequency: float  # [Hz]: 0 if the record has none
    chirp_length: float  # [s]: of the transmission, 0 if the record has none
    pulse_length: float  # [s]: compressed, 0 if the record has none
    ping_rate: float  # [Hz]
    start: float  # [s since 1970]: of the first ping
    place: np.ndarray  # (P, 3) [m]: x, y of the scene, z up
    roll: np.ndarray  # [rad]
    pitch: np.ndarray  # [rad]
    heading: np.ndarray  # [rad]
    altitude: np.ndarray  # [m]: above the bed
    frame: Frame  # place on Earth of x = y = 0; without a coordinate system for a record in metres
    words: tuple[str, ...]  # clauses: what was found and what was assumed

    @property
    def spacing(self) -> float:
        """Length of a sample [m]."""
        return float(self.slant_range[1] - self.slant_range[0])

    @property
    def first(self) -> np.ndarray:
        """Return the slant ranges (P,) [m] of the first return of a level bed."""
        return self.altitude / np.cos(self.pitch)

    @property
    def step(self) -> float:
        """Return the mean distance between pings [m]."""
        return float(np.hypot(*np.diff(self.place[:, :2], axis=0).T).mean())


def read_line(path: FilePath, pings: slice | None = None, frequency: float | None = None) -> SidescanLine:
    """Read the line of a recorded sidescan, or of its sonar of a frequency [Hz]; `ValueError` if it makes no twin."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        record = sidescan_lines.read(path, pings=pings, frequency=frequency)
    line = line_of(path, record)
    # what is read of several pairs of channels; repeated positions are said by the line
    others = [_named(one, path) for one in said if "channels" in str(one.message)]
    return replace(line, words=(*others, *line.words))


def _named(warning, path):
    """Return the text of a warning without the path."""
    return str(warning.message).replace(os.fspath(path), "the record", 1).rstrip(".")


def line_of(path: FilePath, record: xr.Dataset) -> SidescanLine:
    """Return the line of a record that `mitsonar.io.sidescan_lines` read; `ValueError` if it makes no twin."""
    _check(path, record)
    words: list[str] = []
    time, rate = _times(path, record["ping_time"].values, words)
    navigation = _navigation(path, record, words)
    frame = middle(navigation) if navigation.geographic else Frame(
        crs="", origin=(round(float(np.mean(navigation.x))), round(float(np.mean(navigation.y)))))
    track = _smoothed(navigation, frame, time, words)
    weight = record["weight"].values
    scale = np.exp2(weight.max() - weight)[..., None].astype(np.float32)
    counts = record["amplitude"].values.astype(np.float32) * scale
    end = float(np.nanmedian(record["slant_range"].values))
    slant_range = record["range"].values.astype(float)
    altitude = _altitude(path, record, counts, slant_range, track[:, 4], words)
    altitude = smoothed(time, altitude[:, None], max(STEP, 3 / rate))(time)[:, 0]
    altitude = np.clip(altitude, 0.01 * end, 0.9 * end)
    sound_speed = _median(record["sound_speed"].values)
    if not sound_speed:
        sound_speed = DEFAULT_SPEED
        words.append(f"the record has no sound speed: {sound_speed:g} m/s is assumed")
    if missing := int(record.attrs.get("lost_pings") or 0):
        words.append(f"{missing} pings are missing by the recorder's own numbers; the twin has those that are there")
    pulse, first, last = (_median(record[name].values) if name in record else 0.0 for name in (
        "pulse_length", "pulse_start_frequency", "pulse_end_frequency"))
    return SidescanLine(
        counts=counts, slant_range=slant_range, sound_speed=sound_speed, frequency=record.attrs.get("frequency") or 0.0,
        chirp_length=pulse, pulse_length=1 / abs(last - first) if last != first else pulse, ping_rate=rate,
        start=float(time[0]), place=track[:, :3], roll=track[:, 3], pitch=track[:, 4], heading=track[:, 5],
        altitude=altitude, frame=frame, words=tuple(words))


def _check(path, record):
    """Raise `ValueError` if the record cannot make a scene."""
    if record.sizes["ping"] < FEWEST:
        raise ValueError(f"{path} has {record.sizes['ping']} ping; a track takes two or more.")
    if record.sizes["side"] != 2:
        raise ValueError(f"{path} has only a side to {record['side'].values[0]}; a twin takes a line of both sides.")
    if record["amplitude"].size > MOST_SAMPLES:
        raise ValueError(f"{path} has {record['amplitude'].size / 1e6:.0f} million samples; a twin takes at most "
                         f"{MOST_SAMPLES / 1e6:.0f} million: choose some pings, such as --pings 5000.")
    counts = np.unique(record["samples"].values)
    if counts.size > 1:
        raise ValueError(f"{path} has pings of {counts[0]} to {counts[-1]} samples a side; a twin takes pings of one "
                         "range: choose them by --pings, or split the file where the range changes.")
    if record["amplitude"].dtype.kind not in "iu":
        raise ValueError(f"{path} has samples of {record['amplitude'].dtype}; a twin takes the counts of a recorder, "
                         "which are whole numbers.")
    if record["amplitude"].values.min() < 0 or not record["amplitude"].values.any():
        raise ValueError(f"{path} holds nothing but zeros, or samples below 0; a twin takes the counts of a detector.")


def _median(values):
    """Return the median of the known values; 0 if there is none."""
    return float(np.nanmedian(values)) if np.isfinite(values).any() else 0.0


def _navigation(path, record, words):
    """Return the navigation of the record's pings, each fix once."""
    geographic = "longitude" in record
    place = np.stack([record[name].values for name in (("longitude", "latitude") if geographic else ("x", "y"))], -1)
    time = record["ping_time"].values
    known = np.isfinite(place).all(1) & np.isfinite(time) & (np.abs(time - np.nanmedian(time)) < DAY)
    order = np.flatnonzero(known)[np.unique(time[known], return_index=True)[1]]
    scale = METRES_PER_DEGREE if geographic else 1.0
    if order.size:
        usual = median_filter(place[order], (9, 1), mode="nearest")
        order = order[(np.abs(place[order] - usual) * scale < JUMP).all(1)]
    if order.size < FEWEST:
        raise ValueError(f"{path} has {order.size} pings with a time and a position; a twin needs the navigation of "
                         "its line: write it into the file, or choose another.")
    if left := record.sizes["ping"] - order.size:
        words.append(f"{left} positions without a time, repeated in time, or that jump were left out")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        at = time[order]
        x, y = unrepeated(path, at, place[order], at).T
    words += [_named(one, path) for one in said]
    angles = {}
    for name in ("heading", "pitch", "roll", "heave", "sensor_depth"):
        values = record[name].values
        there = np.isfinite(values) & np.isfinite(time)
        if name == "heading" and there.any():
            values = np.where(there, np.unwrap(np.where(there, values, np.interp(time, time[there], values[there]))), 0)
        angles[name] = np.interp(at, time[there], values[there]) if there.sum() > 1 else None
    depth, nothing = angles["sensor_depth"], np.zeros(at.size)
    heave, roll, pitch = (nothing if angles[name] is None else angles[name] for name in ("heave", "roll", "pitch"))
    return Navigation(time=at, x=x, y=y, z=None if depth is None else -depth, heave=heave, roll=roll, pitch=pitch,
                      heading=angles["heading"], geographic=geographic)


def _times(path, stamps, words):
    """Return the times (P,) [s since 1970] of pings, smooth where recorders wrote steps, and their mean rate [Hz]."""
    number = np.arange(stamps.size)
    known = np.isfinite(stamps)
    if known.any():
        known &= np.abs(stamps - np.median(stamps[known])) < DAY
    if known.sum() < FEWEST or not stamps[known][-1] > stamps[known][0]:
        raise ValueError(f"the pings of {path} have no dates, or all the same; a track takes times.")
    slope, first = np.polyfit(number[known], stamps[known] - stamps[known][0], 1)
    even = stamps[known][0] + first + slope * number
    off = float(np.abs(stamps[known] - even[known]).max())
    if off > QUANTUM:
        spline = smoothed(number[known].astype(float), stamps[known][:, None] - stamps[known][0],
                          max(2.0, WAY_STEP / slope))
        even = stamps[known][0] + spline(number.astype(float))[:, 0]
        words.append(f"pings were up to {off:.2g} s off an even rate: those of the twin are even in time, and each is "
                     "where that of the record was")
    if not np.all(np.diff(even) > 0):
        raise ValueError(f"the times of the pings of {path} do not increase; a track takes times.")
    return even, float((number[-1]) / (even[-1] - even[0]))


def _smoothed(navigation: Navigation, frame: Frame, time: np.ndarray, words: list[str]) -> np.ndarray:
    """Return x, y, z [m], roll, pitch and heading [rad] (P, 6) at times; what smoothing removes goes to the words."""
    track = navigation.placed(frame if frame.crs else None, DEPTH)
    if navigation.z is None:
        words.append(f"the record has no depth of the sonar: {DEPTH:g} m is assumed, and the bed lies the altitude "
                     "below")
    values = np.column_stack([track.position, *(np.broadcast_to(angle, track.time.size) for angle in (
        track.roll, track.pitch, np.unwrap(track.heading)))])
    if not frame.crs:
        values[:, :2] -= frame.origin
    interval = float(np.median(np.diff(track.time)))
    at = np.clip(time, track.time[0] - BEYOND, track.time[-1] + BEYOND)
    # attitudes of sidescans come in steps: followed faster, the beam would turn away before its echoes return
    spline = smoothed(track.time - time[0], values, max(WAY_STEP, 3 * interval))
    found = spline(at - time[0])
    residual = np.sqrt(np.mean((spline(track.time - time[0]) - values) ** 2, axis=0))
    found[:, 2] = np.minimum(found[:, 2], -0.05)
    angles = ", ".join(f"{value:.2g}" for value in deg_from_radians(residual[3:]))
    words.append(f"the track is the recorded one, {track.time.size} records {interval:.2g} s apart, smoothed by "
                 f"splines with a knot every {WAY_STEP:g} s; this removes "
                 f"{np.hypot(*residual[:2]):.2g} m of position, {residual[2]:.2g} m of depth and {angles} degrees of "
                 "roll, pitch and heading (rms)")
    if navigation.heading is not None and time.size > 2:
        off = found[:, 5] - course(time, found[:, :2])
        turned = float(np.median(np.angle(np.exp(1j * off))))
        if abs(turned) > TURNED:
            words.append(f"headings are {deg_from_radians(turned):.0f} degrees off the course in the median, by "
                         "current or by a compass that is off; they are kept")
    return found


def _altitude(path, record, counts, slant_range, pitch, words):
    """Return the altitude (P,) [m] of every ping."""
    spacing = float(np.diff(slant_range).mean())
    recorded = record["altitude"].values.astype(float)
    known = (recorded > 0) & (recorded < slant_range[-1])
    seen = _first_returns(counts, spacing)
    if seen is None and known.mean() < 0.5:
        raise ValueError(f"{path} has no altitude for most of its pings, and no first return of the bed is found in "
                         "its picture; choose another line, or write altitudes into it.")
    if seen is None:
        words.append("the altitude is the recorded one; no first return was found to check it by")
    else:
        seen = (slant_range[0] + (seen - 0.5) * spacing) * np.cos(pitch)
        usual = float(np.median(seen))
        if known.mean() < 0.5:
            words.append(f"the record has no altitude: it is that of the first return, {usual:.3g} m in the median")
            return seen
        off = seen[known] - recorded[known]
        near = max(NEAR * usual, NEAR_SAMPLES * spacing)
        bias, spread = float(np.median(off)), float(np.median(np.abs(off - np.median(off))))
        if max(abs(bias), spread) > near:
            words.append(f"the first return is {bias:+.2g} m off the recorded altitude in the median, with "
                         f"{spread:.2g} m about it: the altitude is that of the first return, {usual:.3g} m in the "
                         "median")
            return seen
        words.append(f"the altitude is the recorded one, {np.median(recorded[known]):.3g} m in the median; the first "
                     f"return is {bias:+.2g} m off it")
    number = np.arange(recorded.size)
    return np.interp(number, number[known], recorded[known])


def _first_returns(counts, spacing):
    """Return the samples (P,) of the bed's first return, or None; a side that something hides takes the other's."""
    sides = []
    for side in (0, 1):
        try:
            sides.append(first_return(counts[:, side], spacing).astype(float))
        except ValueError:
            continue
    if not sides:
        return None
    port, starboard = sides[0], sides[-1]
    alike = np.abs(port - starboard) <= AGREE * np.maximum(port, starboard) + 2
    if not alike.any():
        return np.minimum(port, starboard)
    number = np.arange(port.size)
    usual = np.interp(number, number[alike], 0.5 * (port + starboard)[alike])
    nearest = np.where(np.abs(port - usual) < np.abs(starboard - usual), port, starboard)
    seen = np.where(alike, 0.5 * (port + starboard), nearest)
    return np.where(np.abs(seen - usual) <= 2 * AGREE * usual + 2, seen, usual)
