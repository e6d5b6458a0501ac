"""Convert angle and time at a sonar's face to those at the centre of the body.

The transmitter is at T, the rows' phase centre at R, in the body. The rows' axis a and their normal b lie across the
body. An echo of sine s, t after the transmission, comes along n = s a + √(1 - s²) b from P = R + D n with

    |P - T| + D = c t,      so      D = (c² t² - |e|²) / (2 (c t + e·n)),     e = R - T

At the body's origin it has the angle of P and the time 2 |P| / c. Rays are straight over the size of the sonar.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, kw_only=True, eq=False)
class AsideSeen:
    """Echoes at the body's origin, (B,) each."""

    travel_time: np.ndarray  # [s], both ways
    angle: np.ndarray  # [rad], arcsine along the body's starboard axis
    transmit_angle: np.ndarray  # [rad], arcsine along the body's forward axis
    depression: np.ndarray  # [rad], below the body's horizontal, on the face's side


@dataclass(frozen=True, kw_only=True, eq=False)
class AsideFace:
    """Array face on one side, in the body frame (forward, starboard, down)."""

    transmit_centre: np.ndarray  # (3,) [m], T
    receive_centre: np.ndarray  # (3,) [m], R
    axis: np.ndarray  # (3,), a, up along the face
    normal: np.ndarray  # (3,), b

    def seen(self, sine: np.ndarray, time: np.ndarray, sound_speed: float) -> AsideSeen:
        """Return echoes of sines (B,) and times (B,) [s] at the body's origin, for a sound speed [m/s]."""
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
