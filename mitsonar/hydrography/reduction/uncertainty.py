"""A-priori uncertainty of soundings, from the accuracies of all sensors.

x, y, h -> distance of the sounding ahead, to starboard and below; r, ρ -> its distance along the ray and in the plane;
α -> steered angle; β -> tilt of the receive array (roll and mounting); tan θ = ρ / h. All are measured from the arrays,
except for roll, pitch and heading: from the reference point, because these angles also move the arrays about it.

    cause          vertical v                     horizontal w
    detection      (h / r) c σ_t / 2              (ρ / r) c σ_t / 2
    angle, roll    -y σ                           h σ
    pitch          x σ                            h σ
    heading        -                              ρ σ
    heave          max(σ, share |heave|)          -
    draught        σ                              -
    tide           σ                              -
    arms           σ                              √2 σ
    position       -                              σ
    latency        rates of roll, pitch and heave times σ, as above; speed over ground times σ
    profile        h (1 - tan²θ) σ_c / c          2 ρ σ_c / c
    head           -y σ_θ                         h σ_θ,     σ_θ = |sin β / (cos α cos(α - β))| σ_ch / c

A sounding's depth is compared with the bed at its place. Detection, angle, roll, profile and head move a sounding
within the plane of its beam, vertically and sideways at once. On a bed that falls to starboard by tan s, their effect
on the depth is v - w tan s, w to starboard; the slope is estimated from the beams around. Other causes count by v
alone. Squares are added. The first rows are those of Hare (1995), International Hydrographic Review 72(2), 37; the
profile's is of beams whose slowness is right (`smile`), and the head's what is left of its error where the angles are
read with the speed they were steered with: nothing of a level array (`reduction`). Rays are taken to be straight in all
that multiplies an accuracy. σ_t is the travel time over 10^quality where the record has the quality of detection.
"""
from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np
import xarray as xr

from ..detection.amplitude_detection import slopes
from ..record import check, variable

__all__ = ["Accuracies", "BeamGeometry", "Deviations", "budget", "causes", "uncertainties", "with_uncertainty"]

STEEPEST = 1.0                     # largest fall of the bed that is used


@dataclass(frozen=True, kw_only=True)
class Accuracies:
    """Standard deviations of the quantities of a sounding; the defaults are those of a good inertial system.

    Attributes
    ----------
    time : float [s]
        Detection, two-way, for records without a quality.
    angle, roll, pitch, heading : float [rad]
        Steering angle of the beam, and attitude.
    heave : float [m]
        Least deviation of heave.
    heave_share : float
        Share of the heave, if that is larger.
    draught : float [m]
        Depth of the arrays.
    tide : float [m]
        Water level used to reduce the soundings, above the datum.
    arms : float [m]
        Lever arms between sonar and motion sensor, along each axis.
    position : float [m]
        Horizontal distance.
    latency : float [s]
        Delay between motion sensors and sonar.
    profile, head : float [m/s]
        Sound speed over the column, and at the head.
    """

    time: float = 2e-5
    angle: float = 3e-4
    roll: float = 3.5e-4
    pitch: float = 3.5e-4
    heading: float = 9e-4
    heave: float = 0.05
    heave_share: float = 0.05
    draught: float = 0.05
    position: float = 0.3
    latency: float = 0.002
    profile: float = 0.5
    head: float = 0.25
    tide: float = 0.0
    arms: float = 0.0

    def __post_init__(self):
        for one in fields(self):
            value = getattr(self, one.name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"accuracies: {one.name} is {value!r}; give a finite number of 0 or more.")


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """Standard deviations of the measurement of each sounding of a record, from its detection.

    Attributes
    ----------
    time : array (ping, beam) [s]
        Deviation of the time, in place of the record's quality.
    angle : array (ping, beam) [rad]
        In place of that of the steering.
    """

    time: np.ndarray
    angle: np.ndarray


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamGeometry:
    """Geometry of soundings for `causes`; arrays broadcast against (ping, beam).

    Attributes
    ----------
    ahead, across, below : array [m]
        Distances from the reference point: ahead, to starboard, down.
    arms : array (3,) [m]
        Of the arrays from the reference point: forward, starboard, down.
    steered : array [rad]
        Steered angles.
    tilt : array [rad]
        Roll of the receive array: attitude and mounting.
    speed : array [m/s]
        Sound speed at the head.
    heave : array [m]
        Size of the heave.
    rates : sequence of arrays
        Rates of roll, pitch [rad/s] and heave [m/s], and the speed over ground [m/s].
    fall : array
        Fall of the bed to starboard, tan s.
    """

    ahead: np.ndarray
    across: np.ndarray
    below: np.ndarray
    arms: np.ndarray
    steered: np.ndarray
    tilt: np.ndarray
    speed: np.ndarray
    heave: np.ndarray
    rates: Sequence[np.ndarray]
    fall: np.ndarray


def with_uncertainty(soundings: xr.Dataset, accuracies: Accuracies | None = None,
                     deviations: Deviations | None = None) -> xr.Dataset:
    """Add ``uncertainty`` and ``horizontal_uncertainty`` of all causes together to a record.

    Parameters
    ----------
    soundings : xarray.Dataset
    accuracies : Accuracies or None
        Accuracies of the sensors. None takes the defaults.
    deviations : Deviations or None

    Returns
    -------
    xarray.Dataset
    """
    check(soundings)
    return soundings.assign(uncertainties(soundings.variables, accuracies or Accuracies(), deviations))


def uncertainties(soundings: Mapping[Hashable, xr.Variable], accuracies: Accuracies,
                  deviations: Deviations | None) -> dict[str, xr.Variable]:
    """Return ``uncertainty`` and ``horizontal_uncertainty`` of a record's variables."""
    found = _budget(soundings, accuracies, deviations).values()
    return {name: variable(name, np.sqrt(sum(np.square(one[side]) for one in found)))
            for side, name in enumerate(("uncertainty", "horizontal_uncertainty"))}


def budget(soundings: xr.Dataset, accuracies: Accuracies,
           deviations: Deviations | None = None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return vertical and horizontal standard deviations [m] by cause.

    Parameters
    ----------
    soundings : xarray.Dataset
    accuracies : Accuracies
    deviations : Deviations or None

    Returns
    -------
    dict of (array (ping, beam), array (ping, beam))
        Deviations for each cause of the module's table. The vertical one is that of the depth less the bed's depth.

    Raises
    ------
    ValueError
        If the dataset is not a line of soundings.
    """
    check(soundings)
    return _budget(soundings.variables, accuracies, deviations)


def _budget(soundings: Mapping[Hashable, xr.Variable], accuracies: Accuracies,
            deviations: Deviations | None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    valid = soundings["valid"].values
    x, y, h = (np.where(valid, soundings[name].values, np.nan) for name in ("along_track", "across_track", "depth"))
    geometry = BeamGeometry(
        ahead=x, across=y, below=h - soundings["ping_depth"].values[:, None],
        arms=0.5 * (soundings["transmit_offset"].values + soundings["receive_offset"].values),
        steered=soundings["angle"].values, speed=soundings["head_sound_speed"].values[:, None],
        tilt=(soundings["ping_roll"].values + soundings["receive_mounting"].values[0])[:, None],
        heave=np.abs(soundings["ping_depth"].values - soundings["motion_depth"].values.mean())[:, None],
        rates=[rate[:, None] for rate in _rates(soundings)], fall=_fall(soundings))
    time = _time(soundings, accuracies) if deviations is None else deviations.time
    found = causes(geometry, accuracies, time, accuracies.angle if deviations is None else deviations.angle)
    return {name: (np.where(valid, np.abs(vertical), np.nan), np.where(valid, np.abs(horizontal), np.nan))
            for name, (vertical, horizontal) in found.items()}


def causes(geometry: BeamGeometry, accuracies: Accuracies, time: np.ndarray | float,
           steering: np.ndarray | float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return vertical and horizontal standard deviations [m] by cause, with signs of their own.

    Parameters
    ----------
    geometry : BeamGeometry
    accuracies : Accuracies
    time : array or float [s]
        Deviation of the two-way travel time.
    steering : array or float [rad]
        Deviation of the beam's angle.

    Returns
    -------
    dict of (array, array)
        Deviations for each cause of the module's table.
    """
    x, y, h, head, fall = geometry.ahead, geometry.across, geometry.below, geometry.speed, geometry.fall
    roll, pitch = (accuracies.roll * y, accuracies.roll * h), (accuracies.pitch * x, accuracies.pitch * h)
    heading = accuracies.heading * np.hypot(x, y)
    x, y, h = x - geometry.arms[0], y - geometry.arms[1], h - geometry.arms[2]
    level = np.hypot(x, y)
    distance, still = np.hypot(level, h), np.zeros(h.shape)
    rolling, pitching, heaving, speed = (accuracies.latency * rate for rate in geometry.rates)
    turn = np.abs(np.sin(geometry.tilt) / (np.cos(geometry.steered) * np.cos(geometry.steered - geometry.tilt))
                  ) * accuracies.head / head
    span, off = 0.5 * head * time, accuracies.profile / head
    return {
        "detection": ((h - fall * y) / distance * span, level / distance * span),
        "angle": (steering * (y + fall * h), steering * h), "roll": (roll[0] + fall * roll[1], roll[1]), "pitch": pitch,
        "heading": (still, heading),
        "heave": (still + np.maximum(accuracies.heave, accuracies.heave_share * geometry.heave), still),
        "draught": (still + accuracies.draught, still), "position": (still, still + accuracies.position),
        "latency": (np.sqrt((rolling * (y + fall * h))**2 + (pitching * x)**2 + heaving**2),
                    np.sqrt((rolling * h)**2 + (pitching * h)**2 + speed**2)),
        "profile": ((h * (1 - (level / h)**2) - 2 * fall * y) * off, 2 * level * off),
        "head": (turn * (y + fall * h), turn * h), "tide": (still + accuracies.tide, still),
        "arms": (still + accuracies.arms, still + np.sqrt(2) * accuracies.arms)}


def _fall(soundings: Mapping[Hashable, xr.Variable]) -> np.ndarray:
    """Return the fall of the bed to starboard, tan s, (ping, beam), from neighbouring beams; 0 if too few are valid."""
    found = np.zeros(soundings["depth"].shape)
    angles, across, depths = (soundings[name].values.astype(float) for name in ("angle", "across_track", "depth"))
    for ping, some in enumerate(soundings["valid"].values):
        beams = np.flatnonzero(some)[np.argsort(angles[ping, some])]
        deeper, farther = (slopes(one[ping, beams], angles[ping, beams], np.ones(len(beams), bool))
                           for one in (depths, across))
        found[ping, beams] = np.nan_to_num(deeper / np.where(farther > 0, farther, np.nan))
    return np.clip(found, -STEEPEST, STEEPEST)


def _time(soundings: Mapping[Hashable, xr.Variable], accuracies: Accuracies) -> np.ndarray:
    """Return the standard deviation of detection [s]: (ping, beam)."""
    given = np.full(soundings["depth"].shape, accuracies.time)
    if "quality" not in soundings:
        return given
    quality = soundings["quality"].values.astype(float)
    return np.where(np.isfinite(quality), soundings["travel_time"].values * 10.0**-quality, given)


def _rates(soundings: Mapping[Hashable, xr.Variable]) -> list[np.ndarray]:
    """Return the rates of roll, pitch and heave, and the speed over ground, at every ping (ping,)."""
    time, when = soundings["motion_time"].values, soundings["ping_time"].values
    if time.size < 2:
        return [np.zeros(when.size)] * 4
    roll, pitch, depth, x, y = (np.interp(when, time, np.gradient(soundings[f"motion_{name}"].values, time))
                                for name in ("roll", "pitch", "depth", "x", "y"))
    return [roll, pitch, depth, np.hypot(x, y)]
