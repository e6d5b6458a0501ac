"""What an XTF file takes: sidescan records that are whole, and several only of one track."""
from collections.abc import Sequence

import numpy as np
import xarray as xr

__all__ = ["ANGLES", "MOST_RECORDS", "SIDES", "check", "check_same_track"]

MOST_RECORDS = 3                   # two channels each; the header has room for six
SIDES = ("port", "starboard")
NEEDED = ("ping_time", "x", "y", "z", "roll", "pitch", "heading", "altitude")
FARTHEST, LOUDEST_DB = 1e8, 300.0           # [m], [dB re 1 µPa]
ANGLES = ("beam_width", "vertical_beam_width", "depression_angle")      # attributes that need not be there
SAME_TIME, SAME_PLACE = 1e-6, 1e-3          # [s], [m]


def check(record: xr.Dataset) -> None:
    """Check one record.

    Raises
    ------
    ValueError
        If it is no sidescan's, lacks what a file must say, or has pings and ranges that no file can hold.
    """
    level = record.get("level")
    if level is None or set(level.dims) != {"ping", "side", "range"} or list(record["side"].values) != list(SIDES):
        dims = "no levels" if level is None else f"levels over {', '.join(map(str, level.dims))}"
        raise ValueError(f"the record has {dims}; XTF takes a sidescan's, over ping, side (port, starboard) and range.")
    lacking = [name for name in NEEDED if name not in record.coords]
    lacking += [name for name in ("sound_speed", "frequency") if record.attrs.get(name) is None]
    if lacking:
        raise ValueError(f"the record does not say its {lacking[0]}; give one as mitsonar rendered it.")
    for name in ("sound_speed", "frequency"):
        value = record.attrs[name]
        if not isinstance(value, (int, float)) or not 0 < value < np.inf:
            raise ValueError(f"the record's {name} is {value!r}; it takes a number above 0.")
    for name in ANGLES:
        value = record.attrs.get(name, 0.0)
        if not isinstance(value, (int, float)) or not np.isfinite(value):
            raise ValueError(f"the record's {name} is {value!r}; it takes an angle [rad].")
    if (level.values > LOUDEST_DB).any():
        raise ValueError(f"the record has levels of {level.values.max():.4g} dB, beyond any sound; render it anew.")
    if not all(np.isfinite(record[name].values).all() for name in NEEDED if name != "altitude"):
        raise ValueError("the record's track has times, places or angles that are no numbers; render it anew.")
    if any((np.abs(record[axis].values) > FARTHEST).any() for axis in "xyz"):
        raise ValueError(f"the record's track goes beyond {FARTHEST:g} m, farther than any place on Earth.")
    if (np.diff(record["ping_time"].values) <= 0).any():
        raise ValueError("the record's pings are not one after the other in time; sort them.")
    if not record.sizes["ping"]:
        raise ValueError("the record has no pings; give one or more.")
    if not np.isfinite(record["range"].values).all() or not _even(np.diff(record["range"].values)):
        raise ValueError("the record's ranges are not two or more in even steps; XTF has no others.")


def _even(steps):
    return steps.size > 0 and steps.min() > 0 and np.ptp(steps) <= 1e-3 * steps.mean()


def check_same_track(lines: Sequence[xr.Dataset]) -> None:
    """Check that records, in the order of their frequencies, can share ping headers.

    Raises
    ------
    ValueError
        If there are none or too many, or their pings, times and places differ.
    """
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
