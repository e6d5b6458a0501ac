"""Time bins of an energy record, the unit of their sums, and the directions in which a bin needs more rays.

One unit of a bin is 2^-50 of 10^(SL/10) 10^(-2 α R / 10) Φ / R² (`echoes.energy_sums`), R the bin's slant range.
Absorption stays in decibels until an echo meets its bin: in single precision powers end at -380 dB.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.types import DrJitArray
from mitsonar.echoes.sonar_equation import absorbed
from mitsonar.echoes.sums.energy_sums import UNIT_BITS, sum_size
from mitsonar.scene.tracing.launch import CELLS


class EnergyBins:
    """Time bins on the device, with `slant_range` [m], `end` [s] and `unit` [1/m²]."""

    def __init__(self, *, start: float, length: float, count: int, sound_speed: float, beam: float,
                 absorption_db: float):
        # start, length [s]; sound_speed [m/s]; beam [sr]; absorption_db [dB/m]
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
        """Return the slant range at which the record ends [m]."""
        return 0.5 * self.sound_speed * self.end

    def place(self, delay: mi.Float64) -> mi.Float64:
        """Return two-way times [s] as numbers of bins since the beginning of the first."""
        return (delay - self._start) * self._per_second

    def of(self, delay: mi.Float64, valid: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
        """Return the bins of two-way times [s], and which of the times lie in the record."""
        place = self.place(delay)
        inside = valid & (place >= 0) & (place < mi.Float64(self.opaque_count))
        return mi.UInt32(dr.select(inside, place, 0)), inside

    def worth(self, bin: mi.UInt32, inside: mi.Bool, loss_db: mi.Float) -> tuple[DrJitArray, DrJitArray]:
        """Return the number of a bin's units in 1/m², and the two-way transmission relative to that of the unit."""
        units, unit_loss_db = dr.gather(self._row, self._per_bin, bin, inside)
        return units, absorbed(loss_db - unit_loss_db)

    def units(self, energy: mi.Float, loss_db: mi.Float, bin: mi.UInt32, inside: mi.Bool) -> mi.Float64:
        """Return echo energies [1/m²], less an absorption of `loss_db`, in units of their bins; 0 where not finite."""
        units, loss = self.worth(bin, inside, loss_db)
        energy = energy * loss
        return dr.select(dr.isfinite(energy), mi.Float64(energy) * mi.Float64(units), 0)


WINDOW_RAYS = 8                    # mean number of rays aside of the core in a window of bins


def ray_need(row: mi.UInt32, cell: mi.UInt32, bin: mi.UInt32, inside: mi.Bool, *, rows: int,
             bins: EnergyBins) -> np.ndarray:
    """Return the need for rays of each cell, (rows, CELLS): the sum over its rays of 1 / (rays in the same bin)."""
    # row, cell, bin, inside (R,)
    index = row * bins.opaque_count + bin
    count = _added(mi.UInt32(1), index, inside, rows * bins.count)
    dr.eval(count, index, inside, cell)
    share = mi.UInt64(2.0 ** 32 / mi.Float64(dr.maximum(dr.gather(mi.UInt32, count, index, inside), 1)))
    return _added(share, cell, inside, rows * CELLS).numpy()[:rows * CELLS].reshape(rows, CELLS) / 2.0 ** 32


def aside_need(row: mi.UInt32, cell: mi.UInt32, bin: mi.UInt32, inside: mi.Bool, aside: mi.Bool, *, rows: int,
               bins: EnergyBins, drawn: float, wanted: float) -> np.ndarray:
    """Return the need for rays of each cell, within the core and aside of it, (2, rows, CELLS).

    Few rays of a first pass, if any, reach a bin that only side lobes see. Echoes of side lobes change slowly along the
    record, so rays aside count for a window of bins around theirs:

        v = K n_a w/d,   c = n_c (1 - w) / (1 - d),   need_c = Σ c/n_c 1/(c + v),   need_a = Σ v/(K n_a) K [1/(c + v)]

    n -> rays of the first pass in a bin, d -> ``drawn``, w -> ``wanted``, K -> mean over a window of bins.
    """
    # row, cell, bin, inside, aside (R,)
    kind = dr.select(aside, dr.opaque(mi.UInt32, rows), mi.UInt32(0)) + row
    index = kind * bins.opaque_count + bin
    count = _added(mi.UInt32(1), index, inside, 2 * rows * bins.count)
    dr.eval(count, index, inside, aside, cell)
    core, beside = count.numpy()[:2 * rows * bins.count].reshape(2, rows, bins.count).astype(float)
    # a row's own: rows that are traced together change nothing
    reach = np.minimum(np.ceil(0.5 * WINDOW_RAYS * bins.count / np.maximum(beside.sum(1), 1)), bins.count // 8)
    near, far = _averaged(beside, reach), _averaged(beside, 4 * reach)
    core, beside = core * ((1 - wanted) / (1 - drawn)), np.where(near > 0, near, far) * (wanted / drawn)
    total = core + beside
    lack = np.where(total > 0, 1 / np.maximum(total, 1e-30), 0)
    worth = np.stack([lack * ((1 - wanted) / (1 - drawn)), _averaged(lack, reach) * (wanted / drawn)])
    padded = np.zeros(sum_size(worth.size))
    padded[:worth.size] = worth.ravel()
    share = mi.UInt64(2.0 ** 32 * dr.gather(mi.Float64, upload(mi.Float64, padded), index, inside))
    cell = dr.select(aside, dr.opaque(mi.UInt32, rows * CELLS), mi.UInt32(0)) + cell
    need = _added(share, cell, inside, 2 * rows * CELLS)
    return need.numpy()[:2 * rows * CELLS].reshape(2, rows, CELLS) / 2.0 ** 32


def _averaged(values: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return means of values (rows, bins) over the bins up to `reach` (rows,) away."""
    bins = values.shape[1]
    summed = np.concatenate([np.zeros((len(values), 1)), np.cumsum(values, 1)], 1)
    low, high = (np.clip(np.arange(bins) + end.astype(int)[:, None], 0, bins) for end in (-reach, reach + 1))
    return (np.take_along_axis(summed, high, 1) - np.take_along_axis(summed, low, 1)) / (high - low)


def _added(values: mi.UInt32 | mi.UInt64, index: mi.UInt32, active: mi.Bool, size: int) -> mi.UInt32 | mi.UInt64:
    """Return values summed by index on the device, in at least `size` entries."""
    sums = dr.zeros(type(values), sum_size(size))
    dr.scatter_add(sums, values, index, active)
    return sums
