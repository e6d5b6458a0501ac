"""Ground truth of bins, from rays: see `imaging.truth` and `echoes.origin_sums`."""
import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import arrays_of, upload
from ..echoes.energy_sums import SummedEnergy
from ..echoes.origin_sums import OriginSums, sector
from ..imaging import truth
from ..imaging.energy_record import CoherentSums
from ..imaging.truth import BinTruth
from ..scene.labels import SEABED

__all__ = ["TruthSums"]


class TruthSums:
    """Collect where the echoes of a block come from, and say it bin by bin.

    Parameters
    ----------
    geometry : trace.Geometry
    labels, bins : int
        Numbers of instances and bins.
    depth_below : (P,) [m]
        Seabed below the sonar at every ping.
    farthest : float [m]
        Slant range where the record ends.
    shown : callable
        What the picture makes of intensities (rows, ..., bins).
    """

    def __init__(self, geometry, *, labels, bins, depth_below, farthest, shown):
        self.lib, self.hides = arrays_of(mi.Float), geometry.named.hides
        self.labels, self.bins, self.shown = labels, bins, shown
        (x0, y0), (x1, y1) = geometry.horizontal_bounds
        top, bottom = geometry.depth_range
        self.lower, self.upper = np.array([x0, y0, top]), np.array([x1, y1, max(bottom, top + 1e-6)])
        self.corner = [dr.opaque(mi.Float64, v) for v in self.lower]
        self.per_metre = [dr.opaque(mi.Float64, v) for v in 1 / (self.upper - self.lower)]
        self.kinds = upload(mi.UInt32, geometry.named.label_kinds())
        self.depth_below = np.asarray(depth_below, np.float32)
        self.farthest = dr.opaque(mi.Float, farthest)
        dr.eval(self.kinds)

    def sums(self, ping, rows):
        """Empty sums of so many rows for pings of these numbers."""
        self._below = upload(mi.Float, self.depth_below[ping])
        return OriginSums(self.lib, rows, self.labels, self.bins, self.hides)

    def add(self, sums, ray, hits, *, bin, units, in_beam, active):
        """Add rays that arrive from where they hit."""
        kind = dr.gather(mi.UInt32, self.kinds, hits.label, active)
        place = [dr.clip(mi.Float((v - corner) * per_metre), 0, 1) for v, corner, per_metre in
                 zip((hits.point.x, hits.point.y, -hits.point.z), self.corner, self.per_metre)]
        below = dr.gather(mi.Float, self._below, ray.ping)
        sums.add(row=ray.row, bin=bin, units=units, place=place, seabed=kind == SEABED, in_beam=in_beam, active=active,
                 sector=sector(-ray.direction.z, below, self.farthest))

    def read(self, sums: OriginSums, unit: np.ndarray, energy: SummedEnergy,
             coherent: CoherentSums | None = None) -> BinTruth:
        """Give the block's truth.

        Parameters
        ----------
        sums : OriginSums
        unit : (bins,) [µPa²]
        energy : SummedEnergy
        coherent : CoherentSums or None
            None where nothing has a phase of its own.

        Returns
        -------
        BinTruth
            Arrays (rows, ..., bins).
        """
        known = sums.read(unit, self.lower, self.upper)
        with_phase = () if coherent is None else (coherent.label_power, coherent.record.intensity)
        arriving = truth.shares(energy.label_intensity, np.asarray, *with_phase)
        hidden, object_shadow = (np.zeros(energy.intensity.shape, kind) for kind in (np.float32, np.uint32))
        if known.hidden_intensity is not None:
            hidden, object_shadow = truth.shadows(known.hidden_intensity, known.seabed_intensity, energy.intensity,
                                                  self.shown, coherent.record.intensity if coherent else 0.0)
        return BinTruth(
            label=np.where(arriving.any(1), arriving.argmax(1) + 1, 0).astype(np.uint32),
            share=truth.shares(energy.label_intensity, self.shown, *with_phase), hidden=hidden,
            object_shadow=object_shadow, layover=known.layover, seabed_place=known.seabed_place)
