"""Smooth facets: coherent Kirchhoff integral over flat triangles with exact phase.

With a source at range r_s, a receiver at r_r receives from a facet of reflection coefficient R

    p = f e^(-ik(r_s + r_r)) / (r_s r_r),    f = (ik/4π) R (n·u_s + n·u_r) ∫ e^(ik(u_s + u_r)·x) dS

k -> ``wavenumber`` [rad/m], u_s and u_r unit vectors towards source and receiver, x from the point that the ranges are
taken to; f -> scattering length [m], whose square is the backscattering cross-section. Time goes as e^(+iωt). Over a
triangle the phase is linear, and the integral is the area times a mean that depends on the phases φ at the three
corners alone: Gordon's sum over edges (W. B. Gordon, 1975, IEEE Trans. Antennas Propag. 23, 590) taken in the triangle
of the barycentric coordinates, (0, 0), (1, 0), (0, 1),

    <e^iφ> = 2 / (i |w|²) Σ_edges (w·(Δ × n)) sinc(w·Δ/2) e^(iφ_middle),    w = (φ_b - φ_a, φ_c - φ_a)

and for small phases the series 2 Σ i^n h_n / (n + 2)!, h_n the complete symmetric polynomials of the corners' phases.
"""
from __future__ import annotations

import drjit as dr
import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Numbers

SMALL = 0.5                        # |w|² of the phases [rad²] below which the series is used, accurate to 1e-7


def phase_mean(a: Numbers, b: Numbers, c: Numbers) -> tuple[Numbers, Numbers]:
    """Return the mean of e^iφ over triangles with a linear φ, from the phases [rad] at the corners."""
    middle = (a + b + c) * (1 / 3)
    a, b, c = a - middle, b - middle, c - middle
    p, q = b - a, c - a
    square = p * p + q * q
    small = square < SMALL
    e2, e3 = a * b + b * c + c * a, a * b * c
    near = (1 + e2 * (1 / 12) + e2 * e2 * (1 / 360) + (e2 * e2 * e2 - e3 * e3) * (1 / 20160),
            -e3 * (1 / 60) - e2 * e3 * (1 / 1260))
    real, imaginary = 0, 0
    for weight, turned, phase in ((-q, p, a + b), (p + q, q - p, b + c), (-p, q, c + a)):
        sine, cosine = _sincos(0.5 * phase)
        weight = weight * _sinc(0.5 * turned)
        real, imaginary = real + weight * cosine, imaginary + weight * sine
    scale = 2 / _where(small, 1, square)
    real, imaginary = _where(small, near[0], imaginary * scale), _where(small, near[1], -real * scale)
    sine, cosine = _sincos(middle)
    return real * cosine - imaginary * sine, real * sine + imaginary * cosine


def triangle_integral(corners: ArrayLike, w: ArrayLike) -> np.ndarray:
    """Integrate e^(iw·x) dS over triangles."""
    # corners (..., 3, 3) [m]; w (..., 3) [rad/m] -> (...) [m²]
    corners = np.asarray(corners, float)
    phase = np.einsum("...ij,...j->...i", corners, np.asarray(w, float))
    real, imaginary = phase_mean(*np.moveaxis(phase, -1, 0))
    return _area(corners) * (real + 1j * imaginary)


def scattering_length(corners: ArrayLike, wavenumber: float, towards_source: ArrayLike,
                      towards_receiver: ArrayLike | None = None, *, reflection: complex | np.ndarray = 1.0) -> complex:
    """Return the sum of the far-field scattering lengths of the ensonified facets."""
    # corners (F, 3, 3) [m]; wavenumber [rad/m]; towards_source, towards_receiver (3,); reflection (F,) [-] -> [m]
    corners, source = np.asarray(corners, float), np.asarray(towards_source, float)
    receiver = source if towards_receiver is None else np.asarray(towards_receiver, float)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-300)
    towards = normal @ source
    cosines = np.sign(towards) * (towards + normal @ receiver)
    integral = triangle_integral(corners, wavenumber * (source + receiver))
    return complex(np.sum(1j * wavenumber / (4 * np.pi) * reflection * cosines * integral))


def _area(corners: np.ndarray) -> np.ndarray:
    return 0.5 * np.linalg.norm(np.cross(corners[..., 1, :] - corners[..., 0, :],
                                         corners[..., 2, :] - corners[..., 0, :]), axis=-1)


def _sincos(x: Numbers) -> tuple[Numbers, Numbers]:
    return dr.sincos(x) if dr.is_array_v(x) else (np.sin(x), np.cos(x))


def _where(condition: Numbers, a: Numbers, b: Numbers) -> Numbers:
    return dr.select(condition, a, b) if dr.is_array_v(condition) else np.where(condition, a, b)


def _sinc(x: Numbers) -> Numbers:
    """Return sin(x) / x."""
    if not dr.is_array_v(x):
        return np.sinc(np.asarray(x) / np.pi)
    flat = abs(x) < 1e-3
    return dr.select(flat, 1 - x * x * (1 / 6), dr.sin(x) / dr.select(flat, 1, x))
