"""Ground truth of bins, from the rays of an energy record: see `imaging.truth` and `echoes.origin_sums`."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.echoes.sums.energy_sums import SummedEnergy
from mitsonar.echoes.sums.origin_sums import OriginSums, sector
from mitsonar.imaging import truth
from mitsonar.imaging.energy_record import CoherentSums
from mitsonar.imaging.truth import BinTruth
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import OBJECT, SEABED
from mitsonar.scene.tracing.hits import Hits

from ..motion.places import Place
from .rows import Rays, RowResponse, Rows

__all__ = ["TruthSums"]


class TruthSums:
    """Collect where the echoes of a block come from, and say it bin by bin.

    Parameters
    ----------
    geometry : Geometry
    rows : Rows

    Attributes
    ----------
    hides : bool
        Whether there are objects that may hide a seabed.
    """

    def __init__(self, geometry: Geometry, rows: Rows):
        self.hides, self._rows, self._lib = geometry.named.hides, rows, arrays_of(mi.Float)
        (x0, y0), (x1, y1) = geometry.horizontal_bounds
        top, bottom = geometry.depth_range
        self._lower, self._upper = np.array([x0, y0, top]), np.array([x1, y1, max(bottom, top + 1e-6)])
        self._corner = [dr.opaque(mi.Float64, v) for v in self._lower]
        self._per_metre = [dr.opaque(mi.Float64, v) for v in 1 / (self._upper - self._lower)]
        kinds = geometry.named.label_kinds()
        self._objects, self._kinds = np.flatnonzero(kinds == OBJECT) - 1, upload(mi.UInt32, kinds)
        self._farthest = dr.opaque(mi.Float, rows.bins.farthest)
        dr.eval(self._kinds)

    def sums(self, rows: int) -> OriginSums:
        """Give empty sums of so many rows."""
        return OriginSums(self._lib, rows, self._rows.labels, self._rows.bins.count, self.hides)

    def add(self, sums: OriginSums, place: Place, rays: Rays, hits: Hits, *, response: RowResponse, bin: mi.UInt32,
            units: mi.Float64, active: mi.Bool) -> None:
        """Add rays that arrive from where they hit."""
        kind = dr.gather(mi.UInt32, self._kinds, hits.label, active)
        point = [dr.clip(mi.Float((v - corner) * per_metre), 0, 1) for v, corner, per_metre in
                 zip((hits.point.x, hits.point.y, -hits.point.z), self._corner, self._per_metre)]
        sums.add(row=response.row, bin=bin, units=units, place=point, seabed=kind == SEABED, active=active,
                 in_beam=response.in_beam,
                 sector=sector(-rays.direction.z, place.depth_below(rays.ping), self._farthest))

    def read(self, sums: OriginSums, unit: np.ndarray, energy: SummedEnergy,
             coherent: CoherentSums | None) -> BinTruth:
        """Give the block's truth.

        Parameters
        ----------
        sums : OriginSums
        unit : (bins,) [µPa²]
            Worth of one unit in each bin.
        energy : SummedEnergy
        coherent : CoherentSums or None
            None where nothing has a phase of its own.

        Returns
        -------
        BinTruth
            Arrays (rows, ..., bins).
        """
        known, shown = sums.read(unit, self._lower, self._upper), self._rows.shown
        with_phase = () if coherent is None else (coherent.label_power, coherent.record.intensity)
        arriving = truth.shares(energy.label_intensity, np.asarray, *with_phase)
        hidden, object_shadow = (np.zeros(energy.intensity.shape, kind) for kind in (np.float32, np.uint32))
        if known.hidden_intensity is not None:
            hidden, object_shadow = truth.shadows(
                known.hidden_intensity, known.seabed_intensity, energy.intensity, shown,
                0.0 if coherent is None else coherent.record.intensity)
        meets = energy.meets
        if coherent is not None:
            meets = meets | ((coherent.record.in_beam > 0)[:, None] & (coherent.label_power > 0))
        # side lobes bring an object's echo to bins that are not its own: in a shadow they may be the most of all
        own = arriving.copy()
        own[:, self._objects] *= meets[:, self._objects]
        return BinTruth(label=np.where(own.any(1), own.argmax(1) + 1, 0).astype(np.uint32),
                        share=truth.shares(energy.label_intensity, shown, *with_phase), hidden=hidden,
                        object_shadow=object_shadow, layover=known.layover, seabed_place=known.seabed_place)
