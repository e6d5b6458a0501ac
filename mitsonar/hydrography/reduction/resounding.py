"""Reduction of a recorded line of soundings with another profile, another sound speed at the head, or unchanged.

The inputs of `reduction` in a record: angles, times, motion, lever arms and mountings, the cast and the head's speed.
"""
from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mitsonar.water.profile import SoundSpeedProfile

from ..record import VARIABLES, check, variable
from .attitude import PlatformMotion
from .reduction import Installation, Located, Measured, located

__all__ = ["heads_of", "installation_of", "measured_of", "parts_of", "placed", "profile_of", "resounded"]

PLACES = ("depth", "x", "y", "across_track", "along_track", "grazing")
# Truth at the old places.
STALE = {name for name, one in VARIABLES.items() if name == "true_depth" or name.startswith("error")}


def resounded(soundings: xr.Dataset, profile: SoundSpeedProfile | None = None, head_speed: ArrayLike | None = None,
              node: bool = True, under_way: bool = True, motion: PlatformMotion | None = None) -> xr.Dataset:
    """Reduce a line of soundings again.

    Parameters
    ----------
    soundings : xarray.Dataset
        Line, simulated or read from a file, as described in `mitsonar.hydrography.record`.
    profile : SoundSpeedProfile or None
        Profile in place of the record's cast.
    head_speed : array (ping,) or float [m/s], or None
        Sound speed at the head in place of the record's, for the angles and for the node at the arrays.
    node : bool
        True if the head's speed is the profile's node at the arrays.
    under_way : bool
        True to include the motion of the platform during reception; some instruments leave it out.
    motion : PlatformMotion or None
        Motion of the line, made once for all its blocks. The default is made of the record's samples.

    Returns
    -------
    xarray.Dataset
        Line with the new places, cast and head's speed. Depths of the bed and errors at the old places are left out.
        Soundings whose rays turn back before they arrive are no longer valid.

    Raises
    ------
    ValueError
        If the dataset is no line of soundings, or a speed is impossible for water.
    """
    check(soundings)
    # a record's own cast lies below the datum of its tide already
    lifted = float(soundings["tide"].mean()) if "tide" in soundings else 0.0
    profile = profile_of(soundings) if profile is None else profile.lifted(lifted)
    head = soundings["head_sound_speed"].values if head_speed is None else _speeds(head_speed, soundings)
    motion, measured = motion or PlatformMotion.of(soundings), measured_of(soundings)
    rows = {one.name: np.full(soundings["valid"].shape, np.nan) for one in fields(Located)}
    for number, pings in heads_of(soundings):
        for part, some in parts_of(soundings, pings):
            installed = installation_of(soundings, number)
            one = replace(measured[pings], travel_time=np.where(some, measured.travel_time[pings], np.nan))
            places = located(one, motion, replace(installed, transmit_offset=installed.transmit_offset + part), profile,
                             head_speed=head[pings, None], node=node, under_way=under_way)
            for name, values in rows.items():
                values[pings] = np.where(some, getattr(places, name), values[pings])
    places = Located(**rows)
    left_out = [name for name in soundings.variables if name in STALE or "node" in soundings[name].dims]
    changed = {**placed(places), "head_sound_speed": head, "cast_depth": profile.depth,
               "cast_sound_speed": profile.sound_speed, "valid": soundings["valid"].values & places.found}
    return soundings.drop_vars(left_out).assign({name: variable(name, values) for name, values in changed.items()})


def placed(places: Located) -> dict[str, np.ndarray]:
    """Return the variables of places (ping, beam) of a record, by name."""
    return {name: getattr(places, name) for name in PLACES}


def measured_of(soundings: xr.Dataset) -> Measured:
    """Return the measurement in a record: (ping, beam), NaN for soundings that are not valid."""
    valid = soundings["valid"].values
    sector = np.clip(soundings["sector"].values, 0, soundings.sizes["transmission"] - 1)
    sent = soundings["ping_time"].values[:, None]
    delay = np.take_along_axis(soundings["sector_delay"].values, sector, axis=1)
    return Measured(ping_time=sent, transmit_time=sent + delay,
                    travel_time=np.where(valid, soundings["travel_time"].values, np.nan),
                    angle=soundings["angle"].values, transmit_angle=soundings["transmit_angle"].values,
                    head_sound_speed=soundings["head_sound_speed"].values[:, None])


def installation_of(soundings: xr.Dataset, head: int | None = None) -> Installation:
    """Return lever arms and mountings of a record; `head` is the number of one of several receiving heads."""
    names = ("transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting")
    values = {name: soundings[name].values for name in names}
    if head is not None:
        values |= {name: soundings[f"head_{name}"].values[head] for name in names[1::2]}
    return Installation(**values)


def heads_of(soundings: xr.Dataset) -> list[tuple[int | None, np.ndarray]]:
    """Return receiving heads and their pings; None if there is a single head."""
    if "head" not in soundings or "head_receive_offset" not in soundings:
        return [(None, np.arange(soundings.sizes["ping"]))]
    heads = soundings["head"].values
    return [(int(number), np.flatnonzero(heads == number)) for number in np.unique(heads)]


def parts_of(soundings: xr.Dataset, pings: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return offsets (3,) of the parts of the transmit array, and True for the soundings (ping, beam) of each part."""
    valid = soundings["valid"].values[pings]
    if "sector_offset" not in soundings:
        return [(np.zeros(3), np.ones_like(valid))]
    sector = np.clip(soundings["sector"].values[pings], 0, soundings.sizes["transmission"] - 1)
    own = np.take_along_axis(np.nan_to_num(soundings["sector_offset"].values[pings]), sector[..., None], axis=1)
    parts, which = np.unique(own.reshape(-1, 3), axis=0, return_inverse=True)
    return [(part, which.reshape(valid.shape) == number) for number, part in enumerate(parts)]


def profile_of(soundings: xr.Dataset) -> SoundSpeedProfile:
    """Return the cast of a record."""
    return SoundSpeedProfile(soundings["cast_depth"].values, soundings["cast_sound_speed"].values)


def _speeds(given: ArrayLike, soundings: xr.Dataset) -> np.ndarray:
    """Return the head's speed (ping,) of every ping."""
    pings, speeds = soundings.sizes["ping"], np.asarray(given, float)
    if speeds.shape not in ((), (1,), (pings,)):
        raise ValueError(f"head_speed has the shape {speeds.shape}; give one speed, or one for each of {pings} pings.")
    for speed in speeds.ravel():
        SoundSpeedProfile.constant(float(speed))           # raises ValueError for impossible speeds
    return np.broadcast_to(speeds, (pings,)).copy()
