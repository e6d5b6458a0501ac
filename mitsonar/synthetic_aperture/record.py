"""A strip of raw echoes as one `xarray.Dataset`, and the image that is focused of it as another.

Raw echoes have the dimensions ``ping``, ``rx`` (receivers), ``sample``, ``tx`` (transmitters), ``axis`` (forward,
starboard, down), ``motion`` (samples of the true trajectory), ``node`` (of the cast) and ``target``. The received
signal is complex baseband about the carrier; its time begins at the ping's transmission:

    p(t) = Re[s(t) e^(i2πf₀t)],     s(t) ~ Σ a b(t - τ) e^(-i2πf₀τ),     τ: two-way travel time

b -> the pulse's envelope, which begins at τ. The platform moves during reception: the transmitter has its place at
``ping_time``, the receiver its place at ``ping_time`` + τ. Frames: x east, y north of the scene's origin, depth
positive down from the surface; body x forward, y starboard, z down.

A focused image has the dimensions ``bank`` (groups of receivers that are focused separately), ``along_track`` and
``across_track``: metres in the plane of the grid from its origin, along its heading and to starboard. ``image`` is the
complex strength at a point: a point target of target strength TS in the elements' plane of look has |image|² =
10^(TS/10) at its peak; its phase is that of the target's own echo. Beams across the track are not compensated: off that
plane |image|² is lower by the two-way beam of the elements.
"""
from __future__ import annotations

import numbers

import numpy as np
import xarray as xr

from mitsonar.device.record_table import RecordTable, rows

__all__ = ["IMAGE_VARIABLES", "RAW_VARIABLES", "check_image", "check_raw"]

RAW_VARIABLES = RecordTable([
    *rows("signal", ("ping", "rx", "sample"), True, ("signal", "c8", "µPa", "what the receivers hear")),
    *rows("signal", ("sample",), True, ("time", "f8", "s", "of the samples, after the ping's transmission")),
    *rows("ping", ("ping",), True,
          ("ping_time", "f8", "s", "of the transmission, after the strip's start"),
          ("transmitter", "i4", "1", "number of the transmitter that sends, from 0")),
    *rows("array", ("tx", "axis"), True, ("tx_position", "f8", "m", "of the transmitters, body frame")),
    *rows("array", ("rx", "axis"), True, ("rx_position", "f8", "m", "of the receivers, body frame")),
    *rows("array", ("rx",), True, ("rx_bank", "i4", "1", "number of the row a receiver is in, from 0, topmost first")),
    *rows("motion", ("motion",), True,
          ("motion_time", "f8", "s", "after the strip's start; even steps"),
          ("motion_x", "f8", "m", "the body's origin, east"),
          ("motion_y", "f8", "m", "north"),
          ("motion_depth", "f8", "m", "below the still surface"),
          ("motion_roll", "f8", "rad", "starboard down"),
          ("motion_pitch", "f8", "rad", "bow up"),
          ("motion_heading", "f8", "rad", "clockwise from north, without jumps of a turn")),
    *rows("water", ("node",), True,
          ("cast_depth", "f8", "m", "of the profile's nodes, increasing"),
          ("cast_sound_speed", "f8", "m/s", "there, linear between")),
    *rows("target", ("target",), False,
          ("target_x", "f8", "m", "of point targets, east"),
          ("target_y", "f8", "m", "north"),
          ("target_depth", "f8", "m", "below the still surface"),
          ("target_strength_db", "f8", "dB re 1 m²", "of the point targets"),
          ("target_name", "str", "1", "id in the scene")),
])

# attributes of raw echoes: name, unit, meaning
RAW_ATTRIBUTES = (
    ("sonar", "", "\"synthetic_aperture\""),
    ("frequency", "Hz", "carrier"),
    ("sampling_rate", "Hz", "of the samples"),
    ("pulse", "", "numbers of the pulse, as of element signals"),
    ("source_level_db", "dB re 1 µPa @ 1 m", "on the axis of a transmitter"),
    ("absorption_db", "dB/m", "mean over the water between sonar and bed, at the carrier"),
    ("look", "-", "unit vector that the elements look along, body frame"),
    ("tx_length", "m", "of a transmitter along the track"),
    ("rx_length", "m", "of a receiver along the track"),
    ("bed_depth", "m", "mean depth of the bed"),
)
# what the attributes that are numbers lie between
BETWEEN = {"frequency": (1.0, 1e9), "sampling_rate": (1.0, 1e9), "source_level_db": (-1000.0, 1000.0),
           "absorption_db": (0.0, 1000.0), "tx_length": (0.0, 1000.0), "rx_length": (0.0, 1000.0),
           "bed_depth": (-1e5, 1e5)}
SOURCE = "mitsonar.raw_echoes"
UNIT = 1e-3                        # that the length of look may be off
CHECKED = "signal", "array"        # groups whose numbers must be finite; others are checked where they are used

IMAGE_VARIABLES = RecordTable([
    *rows("image", ("bank", "along_track", "across_track"), True,
          ("image", "c8", "m", "complex strength"),
          ("level", "f4", "dB re 1 m²", "20 log10 of its magnitude")),
    *rows("place", ("along_track",), True, ("along_track", "f8", "m", "from the grid's origin, along its heading")),
    *rows("place", ("across_track",), True, ("across_track", "f8", "m", "to starboard; of a slant grid the range")),
    *rows("place", ("along_track", "across_track"), True,
          ("x", "f8", "m", "of the grid's points, east"),
          ("y", "f8", "m", "north"),
          ("grid_depth", "f4", "m", "below the still surface")),
    *rows("place", ("along_track",), False,
          ("sender_across", "f8", "m", "of the transmitters when they passed the row, from the first points' line"),
          ("sender_depth", "f8", "m", "below the still surface")),
    *rows("place", ("bank", "along_track"), False,
          ("bank_across", "f8", "m", "of a bank's receivers when the row's echoes came, from the first points' line"),
          ("bank_depth", "f8", "m", "below the still surface")),
    *rows("image", ("along_track", "across_track"), False,
          ("phase", "f4", "rad", "of a bank less that of another"),
          ("coherence", "f4", "1", "of two banks or of two passes"),
          ("height", "f4", "m", "of what is heard there above the grid's points"),
          ("height_deviation", "f4", "m", "standard deviation that theory expects")),
    *rows("truth", ("shape", "along_track", "across_track"), False,
          ("share", "f4", "1", "of every shape in the echo")),
    *rows("truth", ("along_track", "across_track"), False,
          ("label", "u4", "1", "number of the shape that sends most back there"),
          ("class", "u4", "1", "class of that shape"),
          ("hidden", "f4", "1", "share of the bed's echo that objects hide"),
          ("object_shadow", "u4", "1", "object in whose shadow the point lies; 0: none"),
          ("layover", "u1", "1", "separate places that share the point"),
          ("depth", "f4", "m", "mean depth of what sends the echo"),
          ("shadow", "f4", "1", "1 where nothing is seen; round a circle the share of the pings that see nothing"),
          ("seabed_x", "f4", "m", "mean place of the bed that is seen there, east"),
          ("seabed_y", "f4", "m", "north"),
          ("seabed_depth", "f4", "m", "its depth")),
])


def check_raw(record: xr.Dataset) -> None:
    """Refuse a dataset that holds no raw echoes; numbers of signal and trajectory are checked where they are used.

    Raises
    ------
    ValueError
        If a variable or an attribute is missing, has other dimensions, or holds what cannot be.
    """
    what = "raw echoes of a synthetic aperture"
    RAW_VARIABLES.check(record, what, SOURCE)
    for name, *_ in RAW_ATTRIBUTES:
        if name not in record.attrs:
            raise ValueError(f"the attribute {name} of {what} is missing; give a dataset as {SOURCE} makes it")
    for name, (least, most) in BETWEEN.items():
        value = record.attrs[name]
        if not isinstance(value, numbers.Real) or not least <= float(value) <= most:
            raise ValueError(f"the attribute {name} of {what} is {value!r}; give a number from {least:g} to {most:g}")
    look = np.asarray(record.attrs["look"])
    if look.shape != (3,) or look.dtype.kind not in "iuf" or not abs(np.linalg.norm(look) - 1) < UNIT:
        raise ValueError(f"the attribute look of {what} is {record.attrs['look']!r}; give a unit vector: forward, "
                         "starboard, down")
    for one in RAW_VARIABLES.values():
        if not one.needed or one.group not in CHECKED or one.name == "signal":
            continue
        if not np.all(np.isfinite(record[one.name].values)):
            raise ValueError(f"{one.name} of {what} holds numbers that are not finite; repair it")
    _check_even(np.asarray(record["time"].values, float), float(record.attrs["sampling_rate"]))


def _check_even(time: np.ndarray, rate: float) -> None:
    """Refuse times [s] that are not those of samples at a rate [Hz]."""
    if not len(time) or np.abs(time - time[0] - np.arange(len(time)) / rate).max() > 0.5 / rate:
        raise ValueError(f"the times of {len(time)} samples do not go on evenly by 1 / sampling_rate, which is "
                         f"{rate:g} Hz; mend one of them")


def check_image(record: xr.Dataset) -> None:
    """Refuse a dataset that holds no focused image; raises as `check_raw`."""
    IMAGE_VARIABLES.check(record, "a focused image", "mitsonar.focus")
