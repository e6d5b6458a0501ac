"""From the energies of an energy record to the intensities that a picture shows: linear, and its transpose.

    I = P L E,    Eᵀ = Lᵀ Pᵀ Iᵀ

P -> what the pulse makes of neighbouring bins, and beams of neighbouring beams; L -> what sides hear of each other.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

__all__ = ["PictureOperator"]

Linear = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class PictureOperator:
    """A linear map of (ping, row, bin) arrays [µPa²] and its transpose."""

    shown: Linear
    transposed: Linear
