"""Far-field pressure of one element: the pattern of its face, times the factor of the baffle it is set in.

    b(û) = P(u, v) B(w),   u = û·a,   v = û·(n × a),   w = û·n = cos ψ

û -> ``direction``, n -> ``normal``, a -> ``along`` of the face. The patterns P are those of `PATTERNS`:

    omni           1
    rectangular    sinc(L u / λ) sqrt((1 - f) sinc²(H v / λ) + f),   sinc(x) = sin(πx)/(πx)
    circular       2 J1(X)/X,   X = π (L / λ) sqrt(u² + v²)

L -> ``length`` (the diameter of a circle), H -> ``height``, λ -> ``wavelength`` [m]. f -> ``floor``, the mean power of
diffuse side lobes across the length, relative to the axis: what errors of the face leave between its lobes, and in its
nulls (`faces.beam_shapes`). Without a floor, the second factor is sinc(H v / λ) with its sign; with one, it is positive
and smooth, and keeps the pressure of the side lobes. The baffles B are those of
`BAFFLES` (e.g. Urick 1983, ch. 3; Butler and Sherman, Transducers and Arrays for Underwater Sound, 2016, ch. 7):

    none           1            in free water, on both sides
    hard           1, 0         in a rigid plane: nothing behind it
    soft           cos ψ, 0     in a pressure-release plane: nothing behind it
    cardioid       (1 + cos ψ)/2

All functions take NumPy arrays and Dr.Jit arrays alike.
"""
import functools

import drjit as dr
import numpy as np
import scipy
from numpy.polynomial import chebyshev

from mitsonar.device.types import Numbers, Triple

from ..faces.directivity import sinc

FAR = 8.0                          # argument from which J1 is taken from its modulus and phase
DEGREES = 12, 5                    # of the polynomials below and above, errors below 1e-8


def piston(x: Numbers) -> Numbers:
    """Return 2 J1(x)/x of a NumPy or Dr.Jit array x >= 0; the latter to 1e-6.

    SciPy knows J1 for NumPy only. On the device two Chebyshev series in x² and in 1/x² fitted to SciPy's J1 take its
    place: one of J1(x)/x itself, one of the slowly varying P and Q of
    J1(x) = sqrt(2/(πx)) (P cos(x - 3π/4) - Q sin(x - 3π/4)) (Abramowitz and Stegun 1964, eq. 9.2.5).
    """
    if not dr.is_array_v(x):
        x = np.asarray(x, dtype=np.float64)
        return 2 * np.where(x > 1e-6, scipy.special.j1(x), 0.5) / np.where(x > 1e-6, x, 1.0)
    near, p, q = _bessel_series()
    small, large = dr.minimum(x, FAR), dr.maximum(x, FAR)
    shrunk = FAR / large
    shift = large - 0.75 * np.pi
    even, odd = _clenshaw(p, shrunk * shrunk), shrunk * _clenshaw(q, shrunk * shrunk)
    far = dr.sqrt(2 / (np.pi * large)) * (even * dr.cos(shift) - odd * dr.sin(shift)) / large
    return 2 * dr.select(x < FAR, _clenshaw(near, dr.square(small / FAR)), far)


@functools.cache
def _bessel_series() -> tuple[tuple[float, ...], ...]:
    """Return coefficients of J1(x)/x in (x/8)², and of P and Q x/8 in (8/x)², all on [0, 1]."""
    def near(s):
        x = FAR * np.sqrt((s + 1) / 2)
        return scipy.special.j1(x) / x

    def rotated(s, part):
        # P - iQ = sqrt(πx/2) (J1 - i Y1) exp(i (x - 3π/4))
        x = FAR / np.sqrt((s + 1) / 2)
        wave = scipy.special.j1(x) - 1j * scipy.special.y1(x)
        value = np.sqrt(np.pi * x / 2) * wave * np.exp(1j * (x - 0.75 * np.pi))
        return value.real if part == "even" else -value.imag * x / FAR

    low, high = DEGREES
    series = (chebyshev.chebinterpolate(near, low), chebyshev.chebinterpolate(rotated, high, ("even",)),
              chebyshev.chebinterpolate(rotated, high, ("odd",)))
    return tuple(tuple(float(c) for c in coefficients) for coefficients in series)


def _clenshaw(coefficients: tuple[float, ...], t: Numbers) -> Numbers:
    """Sum a Chebyshev series on [0, 1] at a Dr.Jit array (NumPy's own takes only NumPy)."""
    twice = 4 * t - 2
    last, before = 0.0, 0.0
    for c in coefficients[:0:-1]:
        last, before = c + twice * last - before, last
    return coefficients[0] + 0.5 * twice * last - before


# name -> pressure, of the cosines along and across the face, of its sides in wavelengths, and of the floor
PATTERNS = {
    "omni": lambda u, v, length, height, floor: 1.0,
    "rectangular": lambda u, v, length, height, floor: sinc(u * length) * filled(sinc(v * height), floor),
    "circular": lambda u, v, length, height, floor: piston(np.pi * length * _root(u * u + v * v)),
}

# name -> pressure, of the cosine to the normal and of the pressure without a baffle
BAFFLES = {
    "none": lambda w, pressure: pressure + 0.0 * w,
    "hard": lambda w, pressure: _where(w >= 0, pressure, 0.0),
    "soft": lambda w, pressure: pressure * _where(w >= 0, w, 0.0),
    "cardioid": lambda w, pressure: pressure * (0.5 + 0.5 * w),
}


def element_pressure(direction: Triple, wavelength: Numbers, normal: Triple, along: Triple, *, length: Numbers = 0.0,
                     height: Numbers = 0.0, floor: Numbers = 0.0, pattern: str = "omni",
                     baffle: str = "none") -> Numbers:
    """Return the pressure pattern of an element, 1 on the axis of its face.

    Plain numbers become part of a Dr.Jit kernel. Where they change from run to run, give sizes, wavelength, normal and
    along as opaque Dr.Jit numbers, and one kernel serves all.

    Examples
    --------
    >>> face = dict(normal=[0, 0, 1], along=[0, 1, 0], length=0.1, pattern="rectangular")
    >>> element_pressure(np.array([[0, 0, 1], [0, 0.28, 0.96]]), 0.015, **face).round(3)
    array([ 1.   , -0.069])
    """
    # direction (..., 3) [-]; wavelength [m]; normal, along (..., 3) [-]; length, height [m]; floor [-] -> (...) [-]
    direction, normal, along = _parts(direction), _parts(normal), _parts(along)
    u, v, w = _dot(direction, along), _dot(direction, _cross(normal, along)), _dot(direction, normal)
    pressure = PATTERNS[pattern](u, v, length / wavelength, height / wavelength, floor)
    return BAFFLES[baffle](w, pressure)


def filled(pressure: Numbers, floor: Numbers) -> Numbers:
    """Return pressures with a floor of diffuse side lobes; the pressures themselves where the floor is the number 0."""
    if isinstance(floor, float) and not floor:
        return pressure
    return _root((1 - floor) * pressure * pressure + floor)


def _parts(vector: Triple) -> Triple:
    """Return the three components of NumPy vectors (..., 3), of a sequence, or of a Dr.Jit vector."""
    return np.moveaxis(vector, -1, 0) if isinstance(vector, np.ndarray) else vector


def _dot(a: Triple, b: Triple) -> Numbers:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Triple, b: Triple) -> tuple[Numbers, Numbers, Numbers]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _root(x: Numbers) -> Numbers:
    return dr.sqrt(x) if dr.is_array_v(x) else np.sqrt(x)


def _where(mask: Numbers, a: Numbers, b: Numbers) -> Numbers:
    return dr.select(mask, a, b) if dr.is_array_v(mask) else np.where(mask, a, b)
