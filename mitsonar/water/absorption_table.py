"""Two-way absorption along bent rays, from a table on the device; see `column` for the equation."""
from __future__ import annotations

import copy

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.device.types import DrJitArray, Float

from .column import AbsorptionColumn, column_integrals
from .profile import SoundSpeedProfile

ABSORPTION_STEPS = 1024


class Absorption:
    """Table of integrals (S, 4) at depths (S,) [m] from ``top`` to ``deepest`` [m], on the device."""

    def __init__(self, column: AbsorptionColumn, profile: SoundSpeedProfile, deepest: float, like: DrJitArray | type,
                 top: float = 0.0):
        self.lib = lib = arrays_of(like)
        deepest = max(float(deepest), 1.0)
        integrals, c_r = column_integrals(column, profile, deepest, ABSORPTION_STEPS, top)
        self.depth = np.linspace(top, deepest, ABSORPTION_STEPS + 1)
        self.table = upload(lib.Float, integrals.astype(np.float32))
        self.top = dr.opaque(lib.Float, top)
        self.steps_per_metre = dr.opaque(lib.Float, ABSORPTION_STEPS / (deepest - top))
        self.c2 = dr.opaque(lib.Float, c_r ** 2)
        dr.eval(self.table)

    def with_table(self, table: Float) -> Absorption:
        """Return the same absorption with other values in its table."""
        other = copy.copy(self)
        other.table = table
        return other

    def two_way_db(self, z0: Float, z1: Float, arc_length: Float, ray_parameter: Float) -> Float:
        """Return the loss 2 ᾱ L [dB] between depths z0 and z1 [m]; float32 arrays."""
        a, b = self._at(z0), self._at(z1)
        apart = z1 - z0
        far = abs(apart) > 0.5                              # over less, float32 differences are worse than α itself
        per_metre = dr.select(far, 1 / dr.select(far, apart, 1), 0)
        mean, mean_product, e = ((b[i] - a[i]) * per_metre for i in range(3))
        square = ray_parameter * ray_parameter * self.c2
        flat = dr.maximum(1 - square * (1 + e), 0.01)       # near turning, the expansion fails
        mean += 0.5 * square / flat * (mean_product - mean * e)
        mean = dr.select(far, mean, 0.5 * (a[3] + b[3]))
        return 2 * mean * arc_length

    def _at(self, z):
        place = held((z - self.top) * self.steps_per_metre, 0, ABSORPTION_STEPS - 0.001)
        index = self.lib.UInt32(place)
        low, high = (dr.gather(self.lib.Array4f, self.table, index + i) for i in (0, 1))
        return low + (high - low) * (place - self.lib.Float(index))
