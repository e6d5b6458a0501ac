"""Factors of an echo's pressure: patterns of the transmit array, the elements and the rows of the receive array.

    f = b_r(n') Σ_m v_m e^(i2π y_m p·n' / λ) · b_t(n) Σ_e w_e e^(i2π (r_e·n / λ - f_0 τ_e)) / Σ |w_e|

b_t, b_r -> patterns of the elements; n -> direction of transmission, n' -> direction of reception in the frame that
turns with the body; r_e about the centre of the transmit array; w_e, τ_e -> weights and delays of its elements. The
first sum is that of the rows. For an array that is steered by u at every ping, n - u replaces n in the second sum.

Both sums are far-field sums of an array's elements, computed on the device:

    F(d) = Σ_e w_e e^(i2π(x_e·d - t_e))

x_e -> places [wavelengths], t_e -> drive delays [cycles], w_e -> weights, d -> unit vectors in the frame of the places.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, opaque_vector, upload
from mitsonar.echoes.scatterers.element_beams import omni, pressure
from mitsonar.sonar.arrays.array_factor import array_factor

from ..pressure.array_survey import ArraySurvey
from .line import LineArray

FINER = 64                         # oversampling of a line's table; linear interpolation in it errs by up to 3e-4
STRAIGHT = 1e-3                    # [wavelengths] largest distance of elements from a straight line


class ArraySum:
    """Far-field sum of the elements that have a weight."""
    # place (E, 3) [wavelengths]; weight (E,) [-]; late (E,) [cycles]

    def __init__(self, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        working = np.flatnonzero(weight)
        self._table = np.concatenate([place[working], late[working, None]], 1)
        self._weight = upload(mi.Float, weight[working].astype(np.float32))
        self._count = dr.opaque(mi.UInt32, len(working))
        dr.eval(self._weight)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Return real and imaginary part of F towards directions (R,); `rotation` (3, 3) turns the places first."""
        table = self._table
        if rotation is not None:
            table = np.concatenate([table[:, :3] @ rotation.T, table[:, 3:]], 1)
        on_device = upload(mi.Float, table.astype(np.float32))
        dr.eval(on_device)
        return _summed(on_device, self._weight, self._count, direction)


class LineSum:
    """Far-field sum of the elements of a line, from a table: F is a function of the sine along the line."""
    # axis (3,) [-]; place (E, 3) [wavelengths]; weight (E,) [-]; late (E,) [cycles]

    def __init__(self, axis: np.ndarray, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        along = place @ axis
        # a direction minus the steering vector has sines up to 2
        count = int(np.ceil(4 * FINER * max(np.abs(along).max(), 1))) + 1
        values = array_factor(along, weight * np.exp(-2j * np.pi * late), first=-2, step=4 / (count - 1), count=count)
        self._axis, self._nodes = axis, count
        self._table = upload(mi.Float, values.astype(np.complex64).view(np.float32))
        dr.eval(self._table)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Return real and imaginary part of F; see `ArraySum.of`."""
        axis = self._axis if rotation is None else rotation @ self._axis
        sine = dr.dot(direction, opaque_vector(mi.Vector3f, axis))
        place = held((sine + 2) * dr.opaque(mi.Float, (self._nodes - 1) / 4), 0.0,
                     dr.opaque(mi.Float, self._nodes - 1.001))
        node = mi.UInt32(place)
        share = place - mi.Float(node)
        low, high = (dr.gather(arrays_of(mi.Float).Array2f, self._table, node + step) for step in (0, 1))
        value = low + (high - low) * share
        return value.x, value.y


@dr.syntax
def _summed(table, weight, count, direction):
    """Return F of `count` rows (x, t) of a table."""
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


class Patterns:
    """Pattern factors of one survey."""

    transmit_axis: np.ndarray | None = None  # (3,) [-]
    transmit_length: float = 0.0  # [m], as of `LineArray`

    def __init__(self, survey: ArraySurvey, line: LineArray):
        self._transmit, self._receive, self._wavelength = survey.transmit, survey.receive, survey.wavelength
        transmit = survey.transmit
        self.transmit_centre = transmit.position[transmit.working].mean(0)                        # (3,) [m]
        weight = transmit.weight / np.abs(transmit.weight).sum()
        self._sent, self._rows, self.drive_delay, self._sign = None, None, 0.0, 1.0
        if np.count_nonzero(weight) > 1:
            late = survey.frequency * transmit.delay
            place = (transmit.position - self.transmit_centre) / self._wavelength
            axis = _line_axis(place) if survey.steering is not None else None
            if axis is None:
                self._sent = ArraySum(place, weight, late)
            else:
                self._sent, self.transmit_axis = LineSum(axis, place, weight, late), axis
                self.transmit_length = self._wavelength * float(np.ptp(place @ axis)) * len(place) / (len(place) - 1)
        else:
            single = np.flatnonzero(weight)[0]
            self.drive_delay, self._sign = float(transmit.delay[single]), float(np.sign(weight[single]))
        if len(line.row_place) > 1:
            across = np.cross(line.axis, line.normal)
            weights = line.row_weight / np.abs(line.row_weight).sum()
            self._rows = ArraySum(line.row_place[:, None] * across / self._wavelength, weights, np.zeros(len(weights)))

    def factor(self, sent: mi.Vector3f, towards: mi.Vector3f, rotation: np.ndarray,
               steering: np.ndarray | None = None) -> tuple[mi.Float, mi.Float | None]:
        """Return real and imaginary part of f; the imaginary part is None where it is 0."""
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
                if imaginary is None:
                    real, imaginary = real * a, real * b
                else:
                    real, imaginary = real * a - imaginary * b, real * b + imaginary * a
        return real, imaginary


def _line_axis(place: np.ndarray) -> np.ndarray | None:
    """Return the unit vector of the line through 0 that holds places (E, 3) [wavelengths]; None if there is none."""
    axis = np.linalg.svd(place, full_matrices=False)[2][0]
    return axis if np.abs(place - np.outer(place @ axis, axis)).max() <= STRAIGHT else None
