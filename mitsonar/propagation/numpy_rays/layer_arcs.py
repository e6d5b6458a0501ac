"""Arc of a ray through one layer of constant gradient, in forms that stay exact as the gradient goes to zero (NumPy).

A ray keeps p = cos(theta) / c. A layer of thickness h runs from c1 to c2 = c1 + d; the sines of the grazing angle at
its ends are s1 and s2:

    a = h (c1 + c2) / (s1 + s2)
    range    x = p a                                     dx/dp = a / (s1 s2)
    time     t = (2 h / e) atanh(d / e) / (d / e)        e = c2 s1 + c1 s2
    length   l = (2 h / (s1 + s2)) atan(w) / w           w = p d / (s1 + s2)

The depth that a ray gains within a time t, from the sine s1 and the speed c1, is, with the gradient g and u = g t,

    h = c1 t (s1 - tanh(u/2)) sinhc u / (cosh u - s1 sinh u)

and from the sine s down to its turning point and up to the same depth again, in a layer of gradient g > 0,

    x = 2 s / (p g)      dx/dp = -2 / (p^2 g s)      t = 2 atanh(s) / g      l = 2 asin(s) / (p g)

On the device the arc is that of `device_rays.device_arcs`; derivatives by the sound speed are in `arc_derivatives`.
"""
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

SERIES_LIMIT = 0.003  # of y^2: the first term left out of the series is 1e-19 there
SMALL_BEND = 1e-6     # of u: the second term left out of sinhc is 1e-26 there


@dataclass(frozen=True, eq=False)
class LayerArc:
    """Arcs that cross a layer without turning in it; all fields broadcast, and NaN stays NaN."""

    thickness: np.ndarray  # [m]
    upper_speed: np.ndarray  # [m/s]
    lower_speed: np.ndarray
    upper_sine: np.ndarray
    lower_sine: np.ndarray

    @classmethod
    def of(cls, parameter: np.ndarray, thickness: np.ndarray, upper_speed: np.ndarray,
           lower_speed: np.ndarray) -> "LayerArc":
        """Return the arcs of rays of given parameter [s/m]; NaN where they turn before."""
        with np.errstate(invalid="ignore"):
            sines = [np.sqrt(1 - (parameter * speed) ** 2) for speed in (upper_speed, lower_speed)]
        return cls(thickness, upper_speed, lower_speed, *sines)

    @cached_property
    def stretch(self) -> np.ndarray:
        """Return x / p [m^2/s]."""
        return self.thickness * (self.upper_speed + self.lower_speed) / (self.upper_sine + self.lower_sine)

    @property
    def slope(self) -> np.ndarray:
        """Return dx/dp [m^2/s]."""
        return self.stretch / (self.upper_sine * self.lower_sine)

    @property
    def time(self) -> np.ndarray:
        """Return the travel time [s]."""
        across = self.lower_speed * self.upper_sine + self.upper_speed * self.lower_sine
        return 2 * self.thickness / across * _atanh_ratio((self.lower_speed - self.upper_speed) / across)

    def length(self, parameter: np.ndarray) -> np.ndarray:
        """Return the length [m] of arcs of given parameter [s/m]."""
        both = self.upper_sine + self.lower_sine
        bend = parameter * (self.lower_speed - self.upper_speed) / both
        return 2 * self.thickness / both * _atan_ratio(bend)


@dataclass(frozen=True, eq=False)
class TurningArc:
    """Arcs from one depth down to their turning points and up to the same depth, in a layer of gradient above 0."""

    parameter: np.ndarray  # [s/m]
    gradient: np.ndarray  # [1/s]
    sine: np.ndarray  # at both ends

    @property
    def range(self) -> np.ndarray:
        """Return the horizontal range [m]."""
        return 2 * self.sine / (self.parameter * self.gradient)

    @property
    def slope(self) -> np.ndarray:
        """Return dx/dp [m^2/s]; negative, because a flatter ray turns earlier."""
        return -2 / (self.parameter**2 * self.gradient * self.sine)

    @property
    def time(self) -> np.ndarray:
        """Return the travel time [s]."""
        return 2 * np.arctanh(self.sine) / self.gradient

    @property
    def length(self) -> np.ndarray:
        """Return the length [m]."""
        return 2 * np.arcsin(self.sine) / (self.parameter * self.gradient)

    def depth(self, speed: np.ndarray) -> np.ndarray:
        """Return how far the turning points lie below the ends [m], where the speed is ``speed`` [m/s]."""
        cosine = np.sqrt((1 - self.sine) * (1 + self.sine))
        return speed * self.sine**2 / (cosine * (1 + cosine)) / self.gradient


def descent_after(time: np.ndarray, gradient: np.ndarray, speed: np.ndarray, sine: np.ndarray) -> np.ndarray:
    """Return the depth [m] that downward rays gain within a time in one layer; NaN where they turn before."""
    # time [s]; gradient [1/s]; speed [m/s], sine: where the time begins
    bend = gradient * time
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        sinhc = np.where(np.abs(bend) > SMALL_BEND, np.sinh(bend) / np.where(bend == 0, 1, bend), 1 + bend * bend / 6)
        further = time * (sine - np.tanh(bend / 2)) * sinhc / (np.cosh(bend) - sine * np.sinh(bend))
        return np.where(sine <= np.tanh(bend), np.nan, speed * further)


def _atanh_ratio(y: np.ndarray) -> np.ndarray:
    """Return atanh(y) / y for |y| < 1, exact at zero."""
    return _ratio(y, np.arctanh, 1.0)


def _atan_ratio(y: np.ndarray) -> np.ndarray:
    """Return atan(y) / y, exact at zero."""
    return _ratio(y, np.arctan, -1.0)


def _ratio(y: np.ndarray, function: Callable[[np.ndarray], np.ndarray], sign: float) -> np.ndarray:
    square = sign * y * y
    total = np.full_like(square, 1 / 13)
    for n in (11, 9, 7, 5, 3, 1):
        total *= square
        total += 1 / n
    large = np.abs(square) > SERIES_LIMIT
    total[large] = function(y[large]) / y[large]
    return total
