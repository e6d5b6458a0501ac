"""Array arithmetic of laws that are written once for NumPy (float64) and Dr.Jit (float32, differentiable).

Laws take an `Arithmetic` first and use functions with one name in both modules: sqrt, exp, log, minimum, maximum, and
``real`` and ``imag`` of complex numbers. Only the construction of complex numbers differs.
"""
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType

import numpy as np

from mitsonar.device.types import Numbers


@dataclass(frozen=True)
class Arithmetic:
    """Array module and complex constructor that a law computes with."""

    module: ModuleType  # ``numpy`` or ``drjit``
    complex: Callable[[Numbers, Numbers], Numbers]  # makes complex arrays


NUMPY = Arithmetic(np, lambda real, imaginary: real + 1j * imaginary)


def power(number: Numbers) -> Numbers:
    """Return |z|² of complex numbers of either kind."""
    return number.real * number.real + number.imag * number.imag
