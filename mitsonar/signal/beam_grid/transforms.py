"""Between a grid (row, time), its spectra (frequency, row) and beams (beam, time), on the device.

FFTs are SciPy's, over rows of memory, in as many threads as Dr.Jit has; every transform is one thread's, so their
number changes no bit. On the CPU they work in place, in Dr.Jit's own memory.

Steps that turn rows into columns let sixteen lanes work on sixteen frequencies of one row, and the next sixteen on the
next row, so that either side is read and written in whole lines of the cache.
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import numpy as np
from scipy import fft

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.turns import workers_ended
from mitsonar.device.types import ArrayTypes, Float, UInt32

TILE = 16                          # frequencies


def transformed(values: Float, length: int, *, inverse: bool = False) -> Float:
    """Transform rows of `length` complex numbers, real and imaginary parts by turns; `values` is used up."""
    lib = arrays_of(values)
    dr.eval(values)
    there = values.numpy()
    whole = there.view(np.complex64).reshape(-1, length)
    transform = fft.ifft if inverse else fft.fft
    with workers_ended() as threads:
        result = transform(whole, axis=1, overwrite_x=True, workers=threads)
    if np.shares_memory(result, whole) and dr.backend_v(lib.Float) == dr.JitBackend.LLVM:
        return values
    return upload(lib.Float, result.view(np.float32))


def divided(lib: ArrayTypes, number: UInt32, by: int) -> tuple[UInt32, UInt32]:
    """Divide numbers below 2^32: whole part and rest.

    ⌊n ⌊2^32/d⌋ / 2^32⌋ is ⌊n/d⌋ or one less: vectors multiply, but do not divide. A new size makes no new kernel.
    """
    divisor, inverse = dr.opaque(lib.UInt32, by), dr.opaque(lib.UInt32, min((1 << 32) // by, (1 << 32) - 1))
    whole = cast(UInt32, dr.mul_hi(number, inverse))
    rest = number - whole * divisor
    more = rest >= divisor
    return dr.select(more, whole + 1, whole), dr.select(more, rest - divisor, rest)


def tiles(lib: ArrayTypes, frequencies: int, rows: int) -> tuple[UInt32, UInt32]:
    """Return every lane a frequency, of a multiple of TILE, and a row, tile by tile."""
    lane = dr.arange(lib.UInt32, frequencies * rows)
    block, row = divided(lib, lane // TILE, rows)
    return block * TILE + (lane & (TILE - 1)), row
