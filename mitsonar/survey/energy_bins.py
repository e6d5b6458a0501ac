"""The time bins of an energy record, and the unit that energies are summed in.

One unit of a bin is 2^-50 of 10^(SL/10) 10^(-2 α R / 10) Φ / R² (`echoes.energy_sums`), R the bin's slant range.
Absorption stays in decibels until an echo meets its bin: in single precision powers end at -380 dB.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..device.types import DrJitArray
from ..echoes.energy_sums import UNIT_BITS
from ..echoes.sonar_equation import absorbed

__all__ = ["EnergyBins"]


class EnergyBins:
    """Time bins on the device.

    Parameters
    ----------
    start, length : float [s]
        Two-way time at which the first bin begins; duration of a bin.
    count : int
    sound_speed : float [m/s]
        That turns time into slant range.
    beam : float [sr]
        Φ, a sonar's equivalent beam.
    absorption_db : float [dB/m]
        α, the least of the water.

    Attributes
    ----------
    count : int
    end : float [s]
        When the last bin ends.
    sound_speed : float [m/s]
    slant_range : (bins,) [m]
        Of the bins' centres.
    unit : (bins,) [1/m²]
        Worth of one unit, relative to 10^(SL/10).
    """

    def __init__(self, *, start: float, length: float, count: int, sound_speed: float, beam: float,
                 absorption_db: float):
        self.count, self.end, self.sound_speed = count, start + length * count, sound_speed
        self.slant_range = 0.5 * sound_speed * (start + (np.arange(count) + 0.5) * length)
        nearest = 0.25 * sound_speed * length
        unit = beam / (np.maximum(self.slant_range, nearest) ** 2 * 2.0 ** UNIT_BITS)
        loss_db = 2 * absorption_db * self.slant_range
        self.unit = unit * 10 ** (-loss_db / 10)
        self._row = arrays_of(mi.Float).Array2f
        self._per_bin = upload(mi.Float, np.stack([1 / unit, loss_db], 1).astype(np.float32))
        dr.eval(self._per_bin)
        self.opaque_count = dr.opaque(mi.UInt32, count)
        self._start, self._per_second = dr.opaque(mi.Float64, start), dr.opaque(mi.Float64, 1 / length)

    @property
    def farthest(self) -> float:
        """Slant range at which the record ends [m]."""
        return 0.5 * self.sound_speed * self.end

    def place(self, delay: mi.Float64) -> mi.Float64:
        """Give two-way times [s] in bins from the beginning of the first."""
        return (delay - self._start) * self._per_second

    def of(self, delay: mi.Float64, valid: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
        """Give the bins of two-way times [s], and whether they lie in the record."""
        place = self.place(delay)
        inside = valid & (place >= 0) & (place < mi.Float64(self.opaque_count))
        return mi.UInt32(dr.select(inside, place, 0)), inside

    def worth(self, bin: mi.UInt32, inside: mi.Bool, loss_db: mi.Float) -> tuple[DrJitArray, DrJitArray]:
        """Give how many units make 1/m² in bins, and what a two-way absorption leaves relative to that of the unit."""
        units, unit_loss_db = dr.gather(self._row, self._per_bin, bin, inside)
        return units, absorbed(loss_db - unit_loss_db)

    def units(self, energy: mi.Float, loss_db: mi.Float, bin: mi.UInt32, inside: mi.Bool) -> mi.Float64:
        """Give echo energies [1/m²] that lose `loss_db` to absorption in units of their bins, 0 where not finite."""
        units, loss = self.worth(bin, inside, loss_db)
        energy = energy * loss
        return dr.select(dr.isfinite(energy), mi.Float64(energy) * mi.Float64(units), 0)
