"""Lobe of a rough interface on the device: ln F(q, α) of `rough_interface` from a table of cubics.

Rows of cubics in ln q stand at equal steps of y = ln(α / (1 - α)), in which F is smooth up to both ends; between rows
Lagrange's cubic runs through four of them. A single α for all rays is interpolated to one row beforehand. Both ways
have derivatives with respect to q and α, and are within 2e-4 of F (4e-5 from γ = 2.8 on).
"""
from functools import lru_cache
from typing import Any

import drjit as dr
import numpy as np

from mitsonar.device.arrays import held
from mitsonar.device.types import ArrayTypes, Float, Upload

from .resolved import HIGH_M, HIGH_T, LOW_M, LOW_T, STEP as RATIO_STEP, ratio_table
from .rough_interface import ALPHA_RANGE, log_lobe

LOW, HIGH, STEP = -16.0, 18.5, 0.1     # ln q; the limits of small and large q are used beyond
COLUMNS = round((HIGH - LOW) / STEP)
STEP_Y = 0.1
MIDDLE = float(np.log(0.625 / 0.375))       # y of the sediments' γ = 3.25: a row of its own
FIRST, LAST = (int(np.floor((np.log(a / (1 - a)) - MIDDLE) / STEP_Y)) - (a < 0.5) for a in ALPHA_RANGE)
ROWS = LAST - FIRST + 3


@lru_cache(maxsize=ROWS)
def _row(index: int) -> np.ndarray:
    """Return the cubics of ln F over a step of ln q, float32 (COLUMNS, 4), lowest power first."""
    from scipy.interpolate import CubicSpline

    alpha = 1 / (1 + np.exp(-(MIDDLE + (FIRST + index) * STEP_Y)))
    log_q = LOW + STEP * np.arange(COLUMNS + 1)
    slopes: Any = (1, 1 + 1 / alpha), (1, 0.0)
    spline = CubicSpline(log_q, log_lobe(log_q, alpha), bc_type=slopes)
    return (spline.c[::-1] * STEP ** np.arange(4)[:, None]).T.astype(np.float32)


class LobeTable:
    """Table of ln F over ln q and α."""
    # alpha (1,)

    def __init__(self, lib: ArrayTypes, upload: Upload, alpha: Float | None = None):
        self.lib, self.single = lib, alpha is not None
        if alpha is not None:
            first = int(np.clip(_stencil(float(alpha.numpy()[0])), 0, ROWS - 4))
            rows = [upload(lib.Float, _row(first + k)) for k in range(4)]
            self.table = sum(weight * row for weight, row in zip(_weights(alpha, first), rows))
        else:
            self.table = upload(lib.Float, np.stack([_row(index) for index in range(ROWS)]))
        dr.eval(self.table)

    def look_up(self, log_q: Float, alpha: Float) -> Float:
        """Return ln F for Float arrays; ``alpha`` is ignored by a table of a single α."""
        place = (held(log_q, LOW, HIGH) - LOW) / STEP
        column = dr.minimum(self.lib.UInt32(place), COLUMNS - 1)
        u = place - self.lib.Float(column)
        if self.single:
            value = _cubic(dr.gather(self.lib.Array4f, self.table, column), u)
        else:
            first = self.lib.UInt32(held(_stencil(alpha), 0, ROWS - 4))
            value = 0
            for k, weight in enumerate(_weights(alpha, self.lib.Float(first))):
                row = dr.gather(self.lib.Array4f, self.table, (first + k) * COLUMNS + column)
                value += weight * _cubic(row, u)
        return value + (1 + 1 / alpha) * dr.minimum(log_q - LOW, 0)


class RatioTable:
    """Table of the logarithmic ratio that `resolved.resolved_factor` needs, for one γ."""

    def __init__(self, lib: ArrayTypes, upload: Upload, gamma: float):
        self.lib, values = lib, ratio_table(gamma)
        self.columns = values.shape[1]
        # a cell's four corners side by side
        corners = np.stack([values[:-1, :-1], values[:-1, 1:], values[1:, :-1], values[1:, 1:]], -1)
        self.table = upload(lib.Float, corners)
        dr.eval(self.table)

    def look_up(self, log_m: Float, log_width: Float) -> Float:
        """Return the logarithm of the ratio, Float; linear between the nodes."""
        y, x = ((held(value, low, high - 1e-4) - low) / RATIO_STEP
                for value, low, high in ((log_m, LOW_M, HIGH_M), (log_width, LOW_T, HIGH_T)))
        row, column = self.lib.UInt32(y), self.lib.UInt32(x)
        a, b, c, d = dr.gather(self.lib.Array4f, self.table, row * (self.columns - 1) + column)
        y, x = y - self.lib.Float(row), x - self.lib.Float(column)
        return (a * (1 - x) + b * x) * (1 - y) + (c * (1 - x) + d * x) * y + dr.minimum(log_m - LOW_M, 0)


def _stencil(alpha):
    """Return the first of the four rows about α, not yet clipped to the table."""
    return dr.floor((dr.log(alpha / (1 - alpha)) - MIDDLE) / STEP_Y) - FIRST - 1


def _weights(alpha, first):
    """Return Lagrange's weights of four rows at α."""
    x = (dr.log(alpha / (1 - alpha)) - MIDDLE) / STEP_Y - FIRST - first
    a, b, c = x - 1, x - 2, x - 3
    return -a * b * c / 6, x * b * c / 2, -x * a * c / 2, x * a * b / 6


def _cubic(c, u):
    return c[0] + u * (c[1] + u * (c[2] + u * c[3]))
