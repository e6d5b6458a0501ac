"""A survey whose water changes from one ping to the next."""
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.water.waters import WaterColumn, Waters


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoWaters(Waters):
    """One column before the ping `change`, another from it on."""

    other: WaterColumn
    change: int

    @property
    def columns(self) -> list[WaterColumn]:
        """Return both columns."""
        return [self.column, self.other]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return 0 before the change, 1 from it on."""
        return np.asarray(np.asarray(ping) >= self.change, int)
