"""What transmit array, elements and rows make of directions: real and complex factors of an echo's pressure.

    f = b_r(n') Σ_m v_m e^(i2π y_m p·n' / λ) · b_t(n) Σ_e w_e e^(i2π (r_e·n / λ - f_0 τ_e)) / Σ |w_e|

b_t, b_r patterns of the elements, n direction sent, n' direction received in the frame that turns with the body; r_e
about the transmit array's centre, w_e and τ_e weights and delays of its elements; the second sum is that of the rows.
"""
from __future__ import annotations


import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import upload
from ...echoes.element_beams import omni, pressure
from ...sonar.array import Array
from ..array_survey import ArraySurvey
from .line import LineArray

__all__ = ["Patterns"]



class _Sum:
    """Σ w e^(i2π(x·d - t)) of elements, complex, for unit vectors in a frame that is the scene's at a transmission."""

    def __init__(self, position: np.ndarray, weight: np.ndarray, late: np.ndarray):
        working = np.flatnonzero(weight)
        self._position, self._late, self._count = position[working], late[working], len(working)
        self._weight = upload(mi.Float, weight[working].astype(np.float32))
        dr.eval(self._weight)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray) -> tuple[mi.Float, mi.Float]:
        """Give real and imaginary part."""
        table = upload(mi.Float, np.concatenate([self._position @ rotation.T, self._late[:, None]],
                                                1).astype(np.float32))
        dr.eval(table)
        return _summed(table, self._weight, dr.opaque(mi.UInt32, self._count), direction)


class Patterns:
    """The factors of one survey.

    Parameters
    ----------
    survey : ArraySurvey
    line : LineArray
        Of the receive array.
    """

    def __init__(self, survey: ArraySurvey, line: LineArray):
        self._transmit, self._receive, self._wavelength = survey.transmit, survey.receive, survey.wavelength
        transmit = survey.transmit
        self.transmit_centre = _centre(transmit)
        weight = transmit.weight / np.abs(transmit.weight).sum()
        steered = np.count_nonzero(weight) > 1
        self._sent = None
        if steered:
            late = survey.frequency * transmit.delay
            self._sent = _Sum((transmit.position - self.transmit_centre) / self._wavelength, weight, late)
        self.drive_delay = 0.0 if steered else float(transmit.delay[np.flatnonzero(weight)[0]])
        self._sign = 1.0 if steered else float(np.sign(weight[np.flatnonzero(weight)[0]]))
        self._rows = None
        if len(line.row_place) > 1:
            across = np.cross(line.axis, line.normal)
            weights = line.row_weight / np.abs(line.row_weight).sum()
            self._rows = _Sum(line.row_place[:, None] * across / self._wavelength, weights,
                              np.zeros(len(weights)))

    def factor(self, sent: mi.Vector3f, towards: mi.Vector3f,
               rotation: np.ndarray) -> tuple[mi.Float, mi.Float | None]:
        """Give real and imaginary part of f, the latter None where it is 0.

        Parameters
        ----------
        sent, towards : Vector3f (R,)
            Scene, and the scene at the transmission turned with the body.
        rotation : (3, 3)
            Body to scene, at the transmission.
        """
        real, imaginary = dr.opaque(mi.Float, self._sign), None
        for array, direction in ((self._transmit, sent), (self._receive, towards)):
            if not omni(array):
                face = array.faces()[0]
                real = real * pressure(array, direction, self._wavelength, rotation @ face.normal,
                                       rotation @ face.along)
        for part, direction in ((self._sent, sent), (self._rows, towards)):
            if part is not None:
                a, b = part.of(direction, rotation)
                real, imaginary = _product(real, imaginary, a, b)
        return real, imaginary


def _centre(array: Array) -> np.ndarray:
    """Of the elements that work."""
    return array.position[array.working].mean(0)


def _product(real, imaginary, a, b):
    """(real + i imaginary) (a + i b)."""
    if imaginary is None:
        return real * a, real * b
    return real * a - imaginary * b, real * b + imaginary * a


@dr.syntax
def _summed(table, weight, count, direction):
    """Σ w e^(i2π(x·d - t)) of `count` rows (x, t), in wavelengths and cycles."""
    real, imaginary = mi.Float(0), mi.Float(0)
    i = mi.UInt32(0)
    while i < count:
        x, y = dr.gather(mi.Float, table, 4 * i), dr.gather(mi.Float, table, 4 * i + 1)
        z, t = dr.gather(mi.Float, table, 4 * i + 2), dr.gather(mi.Float, table, 4 * i + 3)
        w = dr.gather(mi.Float, weight, i)
        turns = x * direction.x + y * direction.y + z * direction.z - t
        sine, cosine = dr.sincos((turns - dr.round(turns)) * float(2 * np.pi))
        real, imaginary = real + w * cosine, imaginary + w * sine
        i += 1
    return real, imaginary
