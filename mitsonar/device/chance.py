"""Chance: numbers hashed from what they belong to, so that neither blocks nor threads change them."""
import zlib

import drjit as dr
import numpy as np

__all__ = ["gaussian", "hashed", "shape_key", "uniform"]

SMALLEST_UNIFORM = 2.0 ** -24


def shape_key(name):
    """Give the number that stands for a shape's id in hashes: its CRC-32."""
    return zlib.crc32(str(name).encode())


def hashed(lib, *parts):
    """Mix UInt32 arrays into one UInt32, by rounds of multiplying and shifting: each bit in stirs every bit out."""
    U = lib.UInt32
    state = U(0x9E3779B9)
    for part in parts:
        state = state ^ U(part)
        for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
            state = (state ^ (state >> shift)) * U(factor)
        state = (state ^ (state >> 16)) + U(0x9E3779B9)
    return state


def uniform(lib, bits):
    """[0, 1) from 32 random bits, Float."""
    return lib.Float(bits >> 8) * SMALLEST_UNIFORM


def gaussian(lib, first, second):
    """Complex Gaussian of unit mean square from two hashes; real and imaginary part, Float (Box and Muller 1958)."""
    radius = dr.sqrt(-dr.log((lib.Float(first >> 8) + 0.5) * SMALLEST_UNIFORM))
    sine, cosine = dr.sincos((2 * np.pi) * uniform(lib, second))
    return radius * cosine, radius * sine
