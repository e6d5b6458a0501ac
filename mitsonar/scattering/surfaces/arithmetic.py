"""One text of a law for two kinds of arrays: float64 in NumPy, float32 on the device, differentiable there.

Laws take an `Arithmetic` first and use what both array modules call the same: sqrt, exp, log, minimum, maximum, and of
complex numbers ``real`` and ``imag``. Only how complex numbers are made differs.
"""
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from mitsonar.device.types import Numbers


@dataclass(frozen=True)
class Arithmetic:
    """Hold what a law computes with."""

    module: ModuleType  # ``numpy`` or ``drjit``
    complex: Callable[[Numbers, Numbers], Numbers]  # makes complex arrays


NUMPY = Arithmetic(np, lambda real, imaginary: real + 1j * imaginary)


def power(number: Numbers) -> Numbers:
    """Return |z|² of complex numbers of either kind."""
    return number.real * number.real + number.imag * number.imag
