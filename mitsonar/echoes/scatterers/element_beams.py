"""Two-way beams of all elements of a pair of arrays: used to aim rays and to leave out cells.

    intensity    max |b_t|² over the faces times max |b_r|², seen from the arrays' centre
    bound        upper limit of |b_t b_r|² over all elements: an element lies up to r from the centre, so its direction
                 differs by up to r/d at the distance d, and by the array's rotation until the echoes arrive

b -> `sonar.element_patterns`. The bound takes side lobes by their envelope, 1 / (π x) for a sinc, raised to their
floor, where x, the cosine times the face's side in wavelengths, is reduced by that angle. The plane of a baffle is
widened by the same angle.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import opaque_vector
from mitsonar.device.types import Numbers, Triple
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.element_patterns import element_pressure, filled

FACES_AIMED_BY = 4                 # with more faces, beams are not used to choose scatterers


class ElementBeams:
    """The two-way beams of all elements, at a wavelength [m] and with a rotation during reception of `turn` [rad]."""

    def __init__(self, transmit: Array, receive: Array, wavelength: float, turn: float = 0.0):
        self.arrays, self.wavelength = (transmit, receive), wavelength
        self.faces = [array.faces() for array in self.arrays]
        self.turns = 0.0, float(turn)

    def turning(self, turn: float) -> ElementBeams:
        """Return the same beams with another rotation during reception [rad]."""
        return self if turn == self.turns[1] else ElementBeams(*self.arrays, self.wavelength, turn)

    def __bool__(self) -> bool:
        """Return True if the beams distinguish directions and have few enough faces to be evaluated one by one."""
        return not all(omni(array) for array in self.arrays) and max(map(len, self.faces)) <= FACES_AIMED_BY

    def intensity(self, direction: Triple, rotation: np.ndarray) -> Numbers:
        """Return the two-way intensity towards scene directions, NumPy (..., 3) or Dr.Jit, at an attitude (3, 3)."""
        def beam(array: Array, normal: np.ndarray, along: np.ndarray) -> Numbers:
            if dr.is_array_v(direction):
                return dr.square(pressure(array, direction, self.wavelength, normal, along))
            return array.element_pressure(direction, self.wavelength, normal, along) ** 2

        return self._strongest(beam, rotation)

    def bound(self, direction: Triple, distance: Numbers, rotation: np.ndarray,
              wider: mi.Float | float = 0.0) -> Numbers:
        """Return an upper limit of the intensity [-] at any element, towards Dr.Jit scene directions.

        `distance` [m] is from the centre. The limit also holds for all directions up to `wider` [rad] (R,) off. With a
        negative `wider`, the bound of every direction up to that angle off is at least the returned value.
        """
        def beam(array: Array, normal: np.ndarray, along: np.ndarray) -> Numbers:
            # from the source, which may be any transmit element, to the farthest element
            slack = dr.opaque(mi.Float, reach) / distance + dr.opaque(mi.Float, self.turns[array is receive]) + wider
            return dr.square(_envelope(array, direction, slack, self.wavelength, opaque_vector(mi.Vector3f, normal),
                                       opaque_vector(mi.Vector3f, along)))

        receive, reach = self.arrays[1], sum(array.radius for array in self.arrays)
        return self._strongest(beam, rotation)

    def _strongest(self, beam, rotation):
        """Return the product over both arrays of a face's largest value of `beam`."""
        def largest(array: Array, faces):
            best = 0.0
            for face in faces:
                value = beam(array, rotation @ face.normal, rotation @ face.along)
                best = dr.maximum(best, value) if dr.is_array_v(value) else np.maximum(best, value)
            return best

        (transmit, receive), (senders, receivers) = self.arrays, self.faces
        sent = largest(transmit, senders)
        # one face that sends and receives is evaluated once
        return (sent if receive is transmit else largest(receive, receivers)) * sent


def _envelope(array, direction, slack, wavelength, normal, along):
    """Return the largest pressure of a face towards directions up to `slack` [rad] from the given ones."""
    def cosine(axis: Triple) -> Numbers:
        return direction[0] * axis[0] + direction[1] * axis[1] + direction[2] * axis[2]

    def lobe(side: float, axis: Triple) -> mi.Float:
        wavelengths = dr.opaque(mi.Float, side / wavelength)
        return dr.minimum(dr.rcp(dr.maximum(np.pi * wavelengths * (abs(cosine(axis)) - slack), 1e-6)), 1)

    (nx, ny, nz), (ax, ay, az) = normal, along
    across = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    envelope = mi.Float(1)
    if array.pattern == "rectangular":
        envelope = lobe(array.length, along) * filled(lobe(array.height, across), _floor(array))
    elif array.pattern == "circular":
        # |2 J1(x) / x| < 1.6 / x, and the distance x from the axis is at least either cosine
        envelope = dr.minimum(1.6 * dr.minimum(lobe(array.length, along), lobe(array.length, across)), 1)
    w = cosine(normal) + slack
    return envelope * {"none": 1.0, "hard": dr.select(w >= 0, mi.Float(1), 0), "soft": dr.maximum(w, 0),
                       "cardioid": 0.5 + 0.5 * w}[array.baffle]


def omni(array: Array) -> bool:
    """Return True if all elements of an array are omnidirectional."""
    return array.pattern == "omni" and array.baffle == "none"


def pressure(array: Array, direction: Triple, wavelength: float, normal: np.ndarray, along: np.ndarray) -> Numbers:
    """Return `element_pressure` of one face; its arguments are opaque so that one kernel serves all faces."""
    sizes = array.length, array.height, wavelength
    length, height, opaque_wavelength = (dr.opaque(mi.Float, float(size)) for size in sizes)
    return element_pressure(direction, opaque_wavelength, opaque_vector(mi.Vector3f, normal),
                            opaque_vector(mi.Vector3f, along), length=length, height=height, floor=_floor(array),
                            pattern=array.pattern, baffle=array.baffle)


def _floor(array: Array) -> Numbers:
    """Return the floor of an array's side lobes; the number 0 where there is none."""
    return dr.opaque(mi.Float, array.floor) if array.floor else 0.0
