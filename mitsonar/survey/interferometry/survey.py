"""What a run of an interferometric sidescan is: a run of arrays for either side, and how rows are compared."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...hydrography.row_angles import Rows
from ...signal.matched_filter import compression, rms_bandwidth
from ..array_survey import ArraySurvey
from ..swath.survey import SoundedSurvey, Transmission

__all__ = ["SIDES", "InterferometricSurvey"]

SIDES = ("port", "starboard")


@dataclass(frozen=True, kw_only=True, eq=False)
class InterferometricSurvey(SoundedSurvey):
    """A run of an interferometric sidescan.

    Attributes
    ----------
    sides : (ArraySurvey, ArraySurvey)
        Port and starboard. The receive elements are the rows, from the lowest up.
    bins : int
        Of each side's record, which are as many soundings.
    rows : Rows
        Those of either side.
    looks : float
        Range cells that phases are averaged over, at least.
    least_coherence : float
        Of a valid sounding.
    """

    sides: tuple[ArraySurvey, ArraySurvey]
    bins: int
    rows: Rows
    looks: float
    least_coherence: float

    @property
    def per_bin(self) -> int:
        """Samples of a bin."""
        return (self.sides[0].samples - self.sides[0].lead) // self.bins

    @cached_property
    def relative_bandwidth(self) -> float:
        """Of an even band that strays as the compressed pulse's, over the carrier."""
        side = self.sides[0]
        return float(np.sqrt(12) * rms_bandwidth(side.pulse, side.sampling_rate) / side.frequency)

    @cached_property
    def pulse_length(self) -> float:
        """∫|χ|² dt of the compressed pulse [s]."""
        return float(compression(self.sides[0].pulse, self.sides[0].sampling_rate)[0])

    @property
    def window(self) -> int:
        """Samples that phases are averaged over."""
        per_bin, wanted = self.per_bin, int(np.ceil(self.looks * self.pulse_length * self.sides[0].sampling_rate))
        return per_bin + 2 * max(0, -(-(wanted - per_bin) // 2))

    @property
    def time(self) -> np.ndarray:
        """Of the bins' middles (bins,) [s]."""
        side = self.sides[0]
        return side.time[side.lead:].reshape(self.bins, -1).mean(1)

    @property
    def transmissions(self) -> Sequence[Transmission]:
        """One a side, at once; soundings run from port's last bin to starboard's."""
        pings = self.track.pings
        return [Transmission(survey=side, delay=0.0, sines=np.zeros(pings),
                             beams=slice(k * self.bins, (k + 1) * self.bins)) for k, side in enumerate(self.sides)]
