"""Sum echoes into time bins without steps: each echo is shared between the two bins whose centres it lies between.

    a = (t - t_0) / Δt - 1/2,    k = ⌊a⌋,    E_k += (1 - (a - k)) E,    E_{k+1} += (a - k) E

t -> ``delay``, t_0 and Δt those of the bins; k is detached. For evenly spaced echoes a bin holds the same energy as a
bin with steps, because the tent has the same area.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import held, upload
from mitsonar.survey.energy.energy_bins import EnergyBins
from mitsonar.survey.energy.first_hits import HitEchoes


class TentBins:
    """Sum echoes into bins whose sums move smoothly with them."""

    def __init__(self, bins: EnergyBins):
        self._bins, self._count = bins, float(bins.count)
        self._unit = upload(mi.Float64, bins.unit)

    def of(self, delay: mi.Float64, valid: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
        """Return the bins of two-way times [s], and True for times that lie up to half a bin beyond the ends."""
        place = dr.detach(self._bins.place(delay))
        inside = valid & (place > -0.5) & (place < self._count + 0.5)
        return mi.UInt32(held(place, 0.0, self._count - 1)), inside

    def add(self, sums: mi.Float64, echoes: HitEchoes) -> None:
        """Add echoes to sums (rows x bins,) [1/m²], relative to 10^(SL/10)."""
        energy = echoes.units * dr.gather(mi.Float64, self._unit, echoes.bin, echoes.active)
        place = self._bins.place(echoes.delay) - 0.5
        low = dr.floor(dr.detach(place))
        share = place - low
        row, count = echoes.response.row * self._bins.opaque_count, self._count
        for first, part in ((low, 1 - share), (low + 1, share)):
            here = echoes.active & (first >= 0) & (first <= count - 1)
            dr.scatter_add(sums, dr.select(here, energy * part, 0), row + mi.UInt32(held(first, 0.0, count - 1)), here)
