"""Far-field beam patterns of arrays and their gain against isotropic noise.

    b(û) = Σ_e w_e ε_e b_e(û) exp(2πi (r_e·û - c τ_e)/λ) / Σ_e |w_e|          DI = 10 log10 4π |b(û0)|² / ∫ |b|² dΩ

û -> ``direction``, λ -> ``wavelength``, c -> ``sound_speed``, û0 -> where the signal comes from; w_e, τ_e, r_e, the
channel ε_e and the element's pattern b_e from the `Array` (e.g. Van Trees, Optimum Array Processing, 2002, ch. 2).
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.units import db_from_power

from .array import Array

MARGIN = 24                        # nodes of the quadrature beyond those that the widest array needs
LONGEST_FACE = 64                  # wavelengths: beyond, the directivity index follows from that of a smaller face
LARGEST = 3_000_000                # directions of the quadrature that fit a reasonable time
BLOCK = 2_000_000                  # directions times elements at a time


def beam_pattern(array: Array, direction: ArrayLike, wavelength: float, sound_speed: float | None = None) -> np.ndarray:
    """Compute the pressure pattern of an array with its weights, delays and channels.

    Parameters
    ----------
    array : Array
    direction : array (..., 3) [-]
        Unit vectors, body frame.
    wavelength : float [m]
    sound_speed : float [m/s]
        Needed where the array has delays.

    Returns
    -------
    complex array (...) [-]
        1 where all elements add up on the axes of their faces.

    Raises
    ------
    ValueError
        If the array has delays and no sound speed is given.

    Examples
    --------
    >>> from mitsonar.sonar import line_array
    >>> float(abs(beam_pattern(line_array(2, 0.5), [0.0, 0.5, 0.75 ** 0.5], 1.0)).round(6))
    0.707107
    """
    if sound_speed is None and array.delay.any():
        raise ValueError("beam pattern: the array has delays, so its phases depend on the sound speed; give "
                         "sound_speed [m/s].")
    direction = np.asarray(direction, dtype=np.float64)
    waves = np.zeros(array.elements) if sound_speed is None else array.delay * (sound_speed / wavelength)
    total = np.zeros(direction.shape[:-1], dtype=complex)
    for indices, normal, along in array.faces():
        # einsum, as BLAS spends longer on waking its threads than on products this small
        cycles = np.einsum("...k,ek->...e", direction, array.position[indices]) / wavelength - waves[indices]
        weight = array.weight[indices] if array.flawless else array.weight[indices] * array.channel[indices]
        factor = np.einsum("...e,e->...", np.exp(2j * np.pi * cycles), weight)
        total += factor * array.element_pressure(direction, wavelength, normal, along)
    return total / np.sum(np.abs(array.weight))


def directivity_index_db(array: Array, direction: ArrayLike, wavelength: float,
                         sound_speed: float | None = None) -> float:
    """Compute the gain of an array over one omnidirectional element, against isotropic noise.

    Parameters
    ----------
    array : Array
    direction : array (3,) [-]
        Unit vector towards the signal, body frame.
    wavelength : float [m]
    sound_speed : float [m/s]
        Needed where the array has delays.

    Returns
    -------
    float [dB]

    Raises
    ------
    ValueError
        If the array is too large for a quadrature over all directions, or has delays and no sound speed is given.

    Notes
    -----
    Gauss-Legendre quadrature over each half space of the first element's face, equal steps around: exact for what the
    array's size resolves. Where faces look different ways and have hard baffles, the edges of their half spaces cost
    about 0.01 dB.
    """
    radius = array.centred().radius + np.hypot(array.length, array.height) / 2
    rings = int(2 * np.pi * radius / wavelength) + MARGIN
    if 4 * rings ** 2 > LARGEST:
        raise ValueError(f"directivity index: an array of radius {radius:.3g} m at a wavelength of "
                         f"{wavelength:.3g} m needs {4 * rings ** 2} directions, more than {LARGEST}; take 10 log10 of "
                         "4 pi area / wavelength^2 for one so large.")
    node, share = np.polynomial.legendre.leggauss(rings)
    angle = 2 * np.pi * np.arange(2 * rings) / (2 * rings)
    normal, along = array.normal[0], array.along[0]
    ring = np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * np.cross(normal, along)
    cosine, share = np.r_[node - 1, node + 1] / 2, np.r_[share, share] / 2
    blocks = int(np.ceil(4 * rings ** 2 * array.elements / BLOCK))
    power = 0.0
    for one, part in zip(np.array_split(cosine[:, None, None], blocks), np.array_split(share, blocks), strict=True):
        towards = one * normal + np.sqrt(1 - one ** 2) * ring
        power += part @ np.mean(np.abs(beam_pattern(array, towards, wavelength, sound_speed)) ** 2, axis=-1)
    signal = np.abs(beam_pattern(array, direction, wavelength, sound_speed)) ** 2
    return float(db_from_power(2 * signal / power))        # over all cosines, -1 to 1, an even |b|² = 1 makes 2


def element_directivity_index_db(array: Array, wavelength: float) -> float:
    """Compute the gain of one element of an array, by its face alone, against isotropic noise.

    Parameters
    ----------
    array : Array
        Array whose first element represents all.
    wavelength : float [m]

    Returns
    -------
    float [dB]
        0 for an omnidirectional element.
    """
    longest = LONGEST_FACE * wavelength
    length, height = min(array.length, longest), min(array.height, longest)
    one = type(array)(position=np.zeros((1, 3)), normal=array.normal[:1], along=array.along[:1], length=length,
                      height=height, floor=array.floor, pattern=array.pattern, baffle=array.baffle)
    gain_db = directivity_index_db(one, array.normal[0], wavelength)
    # from there on the gain grows as the sides do
    longer, higher = array.length / length if length else 1.0, array.height / height if height else 1.0
    return gain_db + float(db_from_power(longer ** 2 if array.pattern == "circular" else longer * higher))
