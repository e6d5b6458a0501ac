"""Beam of an unfocused face, at any range.

At a range r a face receives from the direction u, against a point in its middle,

    b(u, r) = ∫ w(x) exp(ik (x²/2r - u x)) dx,        w(x) = ∫ p(u) exp(ik u x) du

in Fresnel's approximation (e.g. Goodman, Introduction to Fourier Optics, ch. 4): near the sonar its beam is as wide as
the face, far from it the pattern p -> `Aperture` without what errors of the face add; along an even face w is constant.
"""
import numpy as np

from .directivity import Aperture

POINTS = 64                        # of half a face, at least
LOBES = 8                          # of a beam that its face is found from
BLOCK = 1 << 22                    # phases summed at a time


def near_pressure(face: Aperture, u: np.ndarray, ranges: np.ndarray, wavelength: float) -> np.ndarray:
    """Compute the pressure b of a face, symmetric in u, by the midpoint rule."""
    # u (U,) [-]; ranges (K,) [m]; wavelength [m] -> (K, U) [-]
    length = face.length
    if not length:
        return np.ones((len(ranges), len(u)), complex)
    points = POINTS + int(4 * length / wavelength * (np.abs(u).max() + length / (4 * np.min(ranges))))
    even = face.along_shape.table is None
    # a beam that was measured may be that of a face longer than the even one of its width
    x = (np.arange(points) + 0.5) / points * length * (0.5 if even else 1.0)
    weight = np.ones(points) if even else _weights(face, x, wavelength)
    bent = np.exp(1j * np.pi / wavelength * x * x / np.asarray(ranges)[:, None]) * weight
    step = max(1, BLOCK // points)
    sums = [bent @ np.cos(2 * np.pi / wavelength * x[:, None] * u[start:start + step])
            for start in range(0, len(u), step)]
    return np.concatenate(sums, -1) / weight.sum()


def _weights(face: Aperture, x: np.ndarray, wavelength: float) -> np.ndarray:
    """Return weights w (X,) along a face, from the lobes of its beam next to the axis."""
    u = np.linspace(0, min(LOBES * wavelength / face.length, 1.0), 64 * LOBES)
    pattern = face.along_shape.lobes(u, face.length / wavelength)
    pattern[0] *= 0.5
    return np.cos(2 * np.pi / wavelength * x[:, None] * u) @ pattern
