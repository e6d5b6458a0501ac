"""Image of a fan of beams from element signals.

The fan lies in the plane of the receive array's normal n and its longest axis a, centred on n:

    û(ψ) = n cos ψ + a sin ψ

It is level and ahead for a line across the bow, athwart and downwards for a line under the hull. Either ψ or sin ψ
grows by equal steps; with sin ψ, the beams of a line array overlap evenly from the middle to the rim. Signals pass the
matched filter, then delay-and-sum focused at every range; level = 20 log10 |beam| [dB re 1 µPa], R = c t / 2 at the
array's sound speed. A single element makes a single beam, its own signal.
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

from . import picture
from .energy_record import EnergyRecord

DIMS = ("ping", "beam", "range")


def fan_directions(array: Array, beams: int, width: float, steps: str = "angle") -> tuple[np.ndarray, np.ndarray]:
    """Return the angles (B,) [rad] and directions (B, 3) of a fan of a ``width`` [rad]."""
    if steps not in STEPS or (steps == "sine" and width > np.pi):
        raise ValueError(f"a fan of {np.degrees(width):g} degrees has no equal steps of {steps!r}; steps are one of "
                         f"{', '.join(STEPS)}, and of the sine over at most 180 degrees.")
    normal = array.normal.mean(0)
    if np.linalg.norm(normal) < 1e-6:                        # elements all around: use the first normal
        normal = array.normal[0]
    normal = normal / np.linalg.norm(normal)
    spread = array.position - array.position.mean(0)
    spread = spread - np.outer(spread @ normal, normal)
    if array.elements == 1 or np.abs(spread).max() < 1e-9:
        return np.zeros(1), normal[None]
    axis = np.linalg.svd(spread, full_matrices=False)[2][0]
    # the axis points to starboard, else forward, else down
    leading = next(axis[k] for k in (1, 0, 2) if abs(axis[k]) > 1e-6)
    axis = axis * np.sign(leading)
    angle = np.zeros(1)
    if beams > 1 and steps == "sine":
        angle = np.arcsin(np.linspace(-1, 1, beams) * np.sin(0.5 * width))
    elif beams > 1:
        angle = np.linspace(-0.5 * width, 0.5 * width, beams)
    return angle, np.cos(angle)[:, None] * normal + np.sin(angle)[:, None] * axis


def formed(signals: xarray.DataArray, pulse: Pulse, direction: np.ndarray) -> np.ndarray:
    """Return the beams [µPa] of pings in directions (B, 3) from the signals of elements [µPa]."""
    rate = signals.attrs["sampling_rate"]
    values = signals.values
    if signals["rx_delay"].values.any():                     # undo the delays of receivers that steer
        values = delayed(values, -signals["rx_delay"].values, rate, signals.attrs["frequency"])
    return delay_and_sum(signals.copy(data=matched_filter(values, pulse, rate)), direction).values


def image(pings: xarray.Dataset, level: np.ndarray, angle: np.ndarray, direction: np.ndarray, *,
          depth_below: np.ndarray, record: EnergyRecord, labels: Mapping[int, str],
          class_of: Mapping[int, int]) -> xarray.Dataset:
    """Return the image of pings from levels (P, B, S), angles (B,), directions (B, 3) and heights (P,)."""
    columns = {name: pings[name].values for name in picture.PINGS if name in pings.coords}
    return picture.picture(
        "array_sonar", DIMS, {"level": picture.entry(DIMS, level.astype(np.float32), "dB re 1 µPa", "echo level")},
        record, bins=picture.bins_of(pings["time"].values, pings.attrs["sound_speed"], pings.attrs.get("pulse")),
        pings={**columns, "altitude": np.asarray(depth_below, float)},
        rows={"beam": picture.entry("beam", angle, "rad", "angle from the middle of the fan"),
              **{f"beam_{axis}": picture.entry("beam", column, "1", f"direction of the beam, {words}")
                 for axis, words, column in zip("xyz", ("forward", "starboard", "down"), direction.T)}},
        labels=labels, class_of=class_of,
        attrs={name: pings.attrs[name] for name in ("seed", "frequency", "sampling_rate", "source_level_db")})


def levels(beams: np.ndarray) -> np.ndarray:
    """Return the levels of beams [dB re 1 µPa], at least `units.NOTHING_DB`."""
    return 20 * np.log10(np.maximum(np.abs(beams), 10 ** (NOTHING_DB / 20)))
