"""From element signals to the picture of a fan of beams.

The fan lies in the plane of the receive array's normal n and of the axis a along which the array is longest, about n:

    û(ψ) = n cos ψ + a sin ψ

ahead and level for a line across the bow, athwart and downwards for one under the hull. From beam to beam ψ grows by
equal steps, or sin ψ does, so that a line's beams overlap alike from the middle to the rim. Signals go through the
matched filter, then delay-and-sum focused at every range; level = 20 log10 |beam| [dB re 1 µPa], R = c t / 2 at the
array's sound speed. A single element makes a single beam, which is the element itself.
"""
from collections.abc import Mapping

import numpy as np
import xarray

from mitsonar.signal.beamforming import delay_and_sum
from mitsonar.signal.matched_filtering import matched_filter
from mitsonar.signal.reception import delayed
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.sectors import STEPS
from mitsonar.sonar.pulses.pulses import Pulse
from mitsonar.units import NOTHING_DB

from . import coordinates, truth
from .energy_record import EnergyRecord


def fan_directions(array: Array, beams: int, width: float, steps: str = "angle") -> tuple[np.ndarray, np.ndarray]:
    """Look directions of a fan."""
    # width [rad] -> angle (B,) [rad], direction (B, 3)
    if steps not in STEPS or (steps == "sine" and width > np.pi):
        raise ValueError(f"a fan of {np.degrees(width):g} degrees has no equal steps of {steps!r}; steps are one of "
                         f"{', '.join(STEPS)}, and of the sine over at most 180 degrees.")
    normal = array.normal.mean(0)
    if np.linalg.norm(normal) < 1e-6:                        # elements all around: look as the first does
        normal = array.normal[0]
    normal = normal / np.linalg.norm(normal)
    spread = array.position - array.position.mean(0)
    spread = spread - np.outer(spread @ normal, normal)
    if array.elements == 1 or np.abs(spread).max() < 1e-9:
        return np.zeros(1), normal[None]
    axis = np.linalg.svd(spread, full_matrices=False)[2][0]
    # to starboard first of all, else forward, else down
    leading = next(axis[k] for k in (1, 0, 2) if abs(axis[k]) > 1e-6)
    axis = axis * np.sign(leading)
    angle = np.zeros(1)
    if beams > 1 and steps == "sine":
        angle = np.arcsin(np.linspace(-1, 1, beams) * np.sin(0.5 * width))
    elif beams > 1:
        angle = np.linspace(-0.5 * width, 0.5 * width, beams)
    return angle, np.cos(angle)[:, None] * normal + np.sin(angle)[:, None] * axis


def formed(signals: xarray.DataArray, pulse: Pulse, direction: np.ndarray) -> np.ndarray:
    """Form the beams of pings from the signals of elements."""
    # signals [µPa]; direction (B, 3) -> [µPa]
    rate = signals.attrs["sampling_rate"]
    values = signals.values
    if signals["rx_delay"].values.any():                     # receivers that steer: their beams are formed here
        values = delayed(values, -signals["rx_delay"].values, rate, signals.attrs["frequency"])
    return delay_and_sum(signals.copy(data=matched_filter(values, pulse, rate)), direction).values


def image(pings: xarray.Dataset, level: np.ndarray, angle: np.ndarray, direction: np.ndarray, *,
          depth_below: np.ndarray, record: EnergyRecord, labels: Mapping[int, str],
          class_of: Mapping[int, int]) -> xarray.Dataset:
    """Make the picture of pings."""
    # level (P, B, S) [dB re 1 µPa]; angle, direction (B,) [rad]; depth_below (P,) [m]; labels [int, str]; class_of
    # [int, int]
    speed, time = pings.attrs["sound_speed"], pings["time"].values
    coords = {name: (value.dims, value.values, value.attrs) for name, value in pings.coords.items()
              if value.dims == ("ping",)}
    coords.update({
        "beam": ("beam", angle, {"units": "rad", "long_name": "angle from the middle of the fan"}),
        "range": ("range", 0.5 * speed * time, {"units": "m", "long_name": "slant range"}),
        "time": ("range", time, {"units": "s", "long_name": "two-way travel time"}),
        "shape": ("shape", list(labels.values()), {"long_name": "shapes in the order of their labels"}),
        "altitude": ("ping", np.asarray(depth_below, float), {"units": "m", "long_name": "height above the seabed"}),
        **{f"beam_{axis}": ("beam", column, {"units": "1"}) for axis, column in zip("xyz", direction.T)}})
    label, shadow = coordinates.shadow_by_runs(record)
    kept = ("seed", "frequency", "sound_speed", "sampling_rate", "source_level_db")
    dims = ("ping", "beam", "range")
    return xarray.Dataset(
        {"level": (dims, level.astype(np.float32), {"units": "dB re 1 µPa", "long_name": "echo level"}),
         **truth.variables(record.truth, label, class_of, dims),
         "shadow": (dims, shadow, {"units": "1", "long_name": "nothing arrives, after the first return"}),
         "rays": (dims, record.echoes_in_beam,
                  {"units": "1", "long_name": "rays, or scatterers around, of the ground truth"})},
        coords, {"sonar": "array_sonar", **{name: pings.attrs[name] for name in kept},
                 "bin_width": float(0.5 * speed / pings.attrs["sampling_rate"]),
                 "labels": {str(number): name for number, name in labels.items()}})


def levels(beams: np.ndarray) -> np.ndarray:
    """Return the levels of beams [dB re 1 µPa]; `units.NOTHING_DB` at least."""
    return 20 * np.log10(np.maximum(np.abs(beams), 10 ** (NOTHING_DB / 20)))
