"""The far field of a line of elements at evenly spaced sines."""
from __future__ import annotations

import numpy as np


def array_factor(place: np.ndarray, weight: np.ndarray, *, first: float, step: float, count: int) -> np.ndarray:
    """Return F(u) = Σ_n w_n e^{2πi x_n u} of elements at `place` x (E,) [wavelengths] at u = first + i step, i < count.

    With i = j L + l, the exponential is a factor of j times one of l, so that only 2 √count of them are computed.
    """
    # weight (E,) -> complex (count,)
    length = max(int(np.ceil(np.sqrt(count))), 1)
    turn = 2j * np.pi * place
    long = np.exp(np.multiply.outer(first + step * length * np.arange(-(-count // length)), turn)) * weight
    short = np.exp(np.multiply.outer(step * np.arange(length), turn))
    # not a product of BLAS, whose threads wait for each other
    return np.einsum("jn,ln->jl", long, short).ravel()[:count]
