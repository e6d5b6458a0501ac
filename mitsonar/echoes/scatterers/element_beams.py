"""What the elements of a pair of arrays hear of a direction: where rays are sent to, and which cells are left out.

    intensity    max over the faces of |b_t|² times that of |b_r|², seen from the arrays' centre
    bound        a number that |b_t b_r|² does not exceed at any element: each lies up to r off the centre, so that its
                 direction differs by up to r/d at the distance d, and by what the array turns while echoes come in

b -> `sonar.element_patterns`. For the bound a side lobe counts with its envelope, 1 / (π x) of a sinc, and x, the
cosine to the face's side in wavelengths, is made smaller by the angle; a baffle's plane is passed by as much.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.types import Numbers, Triple
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.element_patterns import element_pressure

FACES_AIMED_BY = 4                 # beams of arrays with more faces are not looked at when scatterers are chosen


class ElementBeams:
    """The beams of all elements together."""
    # wavelength [m]; turn [rad]

    def __init__(self, transmit: Array, receive: Array, wavelength: float, turn: float = 0.0):
        self.arrays, self.wavelength = (transmit, receive), wavelength
        self.faces = [array.faces() for array in self.arrays]
        self.turns = 0.0, float(turn)

    def __bool__(self) -> bool:
        """Return whether they tell directions apart, by faces few enough to be looked at one by one."""
        return not all(omni(array) for array in self.arrays) and max(map(len, self.faces)) <= FACES_AIMED_BY

    def intensity(self, direction: Triple, rotation: np.ndarray) -> Numbers:
        """Return the two-way intensity towards scene directions, NumPy (..., 3) or Dr.Jit, at an attitude (3, 3)."""
        def of(array, normal, along):
            if dr.is_array_v(direction):
                return dr.square(pressure(array, direction, self.wavelength, normal, along))
            return array.element_pressure(direction, self.wavelength, normal, along) ** 2

        return self._strongest(of, rotation)

    def bound(self, direction: Triple, distance: Numbers, rotation: np.ndarray,
              wider: mi.Float | float = 0.0) -> Numbers:
        """Return what no element exceeds [-] towards Dr.Jit scene directions and at distances [m] from the centre.

        Nor in any direction up to `wider` [rad] off, Float (R,). Where that is negative, what the bound of no direction
        up to as much off falls below.
        """
        def of(array, normal, along):
            # from the source, which may be any transmit element, to the farthest element
            slack = dr.opaque(mi.Float, reach) / distance + dr.opaque(mi.Float, self.turns[array is receive]) + wider
            return dr.square(_envelope(array, direction, slack, self.wavelength, _opaque(normal), _opaque(along)))

        receive, reach = self.arrays[1], sum(array.radius for array in self.arrays)
        return self._strongest(of, rotation)

    def _strongest(self, of, rotation):
        total = 1.0
        for array, group in zip(self.arrays, self.faces):
            best = 0.0
            for face in group:
                one = of(array, rotation @ face.normal, rotation @ face.along)
                best = dr.maximum(best, one) if dr.is_array_v(one) else np.maximum(best, one)
            total = best * total
        return total


def _envelope(array, direction, slack, wavelength, normal, along):
    """Largest pressure of a face towards directions that lie up to `slack` [rad] from given ones."""
    def cosine(axis):
        return direction[0] * axis[0] + direction[1] * axis[1] + direction[2] * axis[2]

    def lobe(side, axis):
        side = dr.opaque(mi.Float, side / wavelength)
        return dr.minimum(dr.rcp(dr.maximum(np.pi * side * (abs(cosine(axis)) - slack), 1e-6)), 1)

    (nx, ny, nz), (ax, ay, az) = normal, along
    across = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    envelope = mi.Float(1)
    if array.pattern == "rectangular":
        envelope = lobe(array.length, along) * lobe(array.height, across)
    elif array.pattern == "circular":
        # |2 J1(x) / x| stays below 1.6 / x, x the distance from the axis: at least either cosine
        envelope = dr.minimum(1.6 * dr.minimum(lobe(array.length, along), lobe(array.length, across)), 1)
    w = cosine(normal) + slack
    return envelope * {"none": 1.0, "hard": dr.select(w >= 0, mi.Float(1), 0), "soft": dr.maximum(w, 0),
                       "cardioid": 0.5 + 0.5 * w}[array.baffle]


def _opaque(vector):
    """The components of a vector, opaque: they change without a new kernel."""
    return [dr.opaque(mi.Float, float(component)) for component in vector]


def omni(array: Array) -> bool:
    """Tell whether the elements of an array look everywhere alike."""
    return array.pattern == "omni" and array.baffle == "none"


def pressure(array: Array, direction: Triple, wavelength: float, normal: np.ndarray, along: np.ndarray) -> Numbers:
    """`element_pressure` of one face on the device, its numbers opaque so that one kernel serves all faces."""
    sizes = array.length, array.height, wavelength
    length, height, opaque_wavelength = (dr.opaque(mi.Float, float(size)) for size in sizes)
    return element_pressure(direction, opaque_wavelength, _opaque(normal), _opaque(along), length=length, height=height,
                            pattern=array.pattern, baffle=array.baffle)
