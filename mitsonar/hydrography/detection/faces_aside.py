"""From the face of a side that measures time and angle to the angle and the time that the sonar's centre would see.

The transmitter is at T, the rows' phase centre at R, in the body. The rows' axis a and their normal b lie across the
body. An echo of the sine s comes along n = s a + √(1 - s²) b, t after the transmission, from P = R + D n with

    |P - T| + D = c t,      so      D = (c² t² - |e|²) / (2 (c t + e·n)),     e = R - T

Seen from the body's origin it is at the angle of P, and takes 2 |P| / c. Rays are straight over the size of the sonar.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class AsideSeen:
    """Echoes as the body's origin would see them, (B,) each."""

    travel_time: np.ndarray  # [s]: both ways
    angle: np.ndarray  # [rad]: arcsines along the body's starboard and forward axes
    transmit_angle: np.ndarray  # [rad]: arcsines along the body's starboard and forward axes
    depression: np.ndarray  # [rad]: below the body's horizontal, on the face's side


@dataclass(frozen=True, kw_only=True, eq=False)
class AsideFace:
    """A side's face, body frame (forward, starboard, down)."""

    transmit_centre: np.ndarray  # (3,) [m]: T and R
    receive_centre: np.ndarray  # (3,) [m]: T and R
    axis: np.ndarray  # (3,): a, up along the face, and b
    normal: np.ndarray  # (3,): a, up along the face, and b

    def seen(self, sine: np.ndarray, time: np.ndarray, sound_speed: float) -> AsideSeen:
        """Return echoes of sines (B,) and times (B,) [s] from the centre, at a sound speed [m/s]."""
        sine = np.clip(sine, -1, 1)
        towards = sine[:, None] * self.axis + np.sqrt(1 - sine ** 2)[:, None] * self.normal
        e, way = self.receive_centre - self.transmit_centre, sound_speed * np.asarray(time, float)
        with np.errstate(invalid="ignore", divide="ignore"):
            back = np.maximum((way ** 2 - e @ e) / (2 * (way + towards @ e)), 0)
            place = self.receive_centre + back[:, None] * towards
            distance = np.linalg.norm(place, axis=1)
            forward, starboard, down = place.T / distance
        side = np.sign(self.normal[1]) or 1.0
        return AsideSeen(travel_time=2 * distance / sound_speed, angle=np.arcsin(np.clip(starboard, -1, 1)),
                    transmit_angle=np.arcsin(np.clip(forward, -1, 1)), depression=np.arctan2(down, side * starboard))
