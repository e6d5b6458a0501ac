"""Compute the factors of an echo's pressure by the patterns of transmit array, elements and rows.

    f = b_r(n') Σ_m v_m e^(i2π y_m p·n' / λ) · b_t(n) Σ_e w_e e^(i2π (r_e·n / λ - f_0 τ_e)) / Σ |w_e|

b_t, b_r patterns of the elements, n direction sent, n' direction received in the frame that turns with the body; r_e
about the transmit array's centre, w_e and τ_e weights and delays of its elements; the first sum is that of the rows.
For an array that is steered by u at every ping, n - u replaces n in the second sum.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import opaque_vector
from mitsonar.echoes.scatterers.element_beams import omni, pressure
from mitsonar.sonar.arrays.array import Array

from ..fan.array_beams import ArraySum, LineSum, along_a_line
from ..pressure.array_survey import ArraySurvey
from .line import LineArray


class Patterns:
    """Hold the factors of one survey."""
    # transmit_centre (3,) [m]

    transmit_axis: np.ndarray | None = None  # (3,) [-]
    transmit_length: float = 0.0  # [m]: and its length, as of `LineArray`

    def __init__(self, survey: ArraySurvey, line: LineArray):
        self._transmit, self._receive, self._wavelength = survey.transmit, survey.receive, survey.wavelength
        transmit = survey.transmit
        self.transmit_centre = _centre(transmit)
        weight = transmit.weight / np.abs(transmit.weight).sum()
        steered = np.count_nonzero(weight) > 1
        self._sent = None
        if steered:
            late = survey.frequency * transmit.delay
            place = (transmit.position - self.transmit_centre) / self._wavelength
            axis = along_a_line(place) if survey.steering is not None else None
            if axis is None:
                self._sent = ArraySum(place, weight, late)
            else:
                self._sent, self.transmit_axis = LineSum(axis, place, weight, late), axis
                self.transmit_length = self._wavelength * float(np.ptp(place @ axis)) * len(place) / (len(place) - 1)
        self.drive_delay = 0.0 if steered else float(transmit.delay[np.flatnonzero(weight)[0]])
        self._sign = 1.0 if steered else float(np.sign(weight[np.flatnonzero(weight)[0]]))
        self._rows = None
        if len(line.row_place) > 1:
            across = np.cross(line.axis, line.normal)
            weights = line.row_weight / np.abs(line.row_weight).sum()
            self._rows = ArraySum(line.row_place[:, None] * across / self._wavelength, weights,
                              np.zeros(len(weights)))

    def factor(self, sent: mi.Vector3f, towards: mi.Vector3f, rotation: np.ndarray,
               steering: np.ndarray | None = None) -> tuple[mi.Float, mi.Float | None]:
        """Return real and imaginary part of f, the latter None where it is 0."""
        # sent, towards (R,); rotation (3, 3); steering (3,)
        real, imaginary = dr.opaque(mi.Float, self._sign), None
        for array, direction in ((self._transmit, sent), (self._receive, towards)):
            if not omni(array):
                face = array.faces()[0]
                real = real * pressure(array, direction, self._wavelength, rotation @ face.normal,
                                       rotation @ face.along)
        aimed = sent if steering is None else sent - opaque_vector(mi.Vector3f, rotation @ steering)
        for part, direction in ((self._sent, aimed), (self._rows, towards)):
            if part is not None:
                a, b = part.of(direction, rotation)
                real, imaginary = _product(real, imaginary, a, b)
        return real, imaginary


def _centre(array: Array) -> np.ndarray:
    """Return the mean position of the elements that work."""
    return array.position[array.working].mean(0)


def _product(real, imaginary, a, b):
    """(real + i imaginary) (a + i b)."""
    if imaginary is None:
        return real * a, real * b
    return real * a - imaginary * b, real * b + imaginary * a
