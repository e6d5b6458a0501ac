"""Data of a sidescan's run over a scene."""
from dataclasses import dataclass

import numpy as np

from mitsonar.sonar.faces.sidescan import Sidescan

from ..survey import Survey


@dataclass(frozen=True, kw_only=True)
class SidescanSurvey(Survey):
    """Run of a sidescan."""

    sonar: Sidescan
    window: tuple[float, float]  # [s]: two-way time recorded
    bins: int
    per_cell: float  # scatterers in a resolution cell
    pass_number: int = 0  # number of the pass over the ground
    first_pass: float  # share of the rays that only find the directions in which more rays are needed

    @property
    def bin_length(self) -> float:
        """Return the duration of a time bin [s]."""
        return (self.window[1] - self.window[0]) / self.bins

    @property
    def slant_range(self) -> np.ndarray:
        """Return the slant range of the bins' centres [m], (bins,), at the sonar's sound speed."""
        return 0.5 * self.sonar.sound_speed * (self.window[0] + (np.arange(self.bins) + 0.5) * self.bin_length)

    @property
    def labels(self) -> dict[int, str]:
        """Return the names of labels by number: the scene's shapes and, where it scatters, the water."""
        labels = self.world.labels
        return {**labels, 1 + max(labels): "water"} if self.waters.scatter else labels
