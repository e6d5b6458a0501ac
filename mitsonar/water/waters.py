"""Water of a survey: its column at every ping, and what holds for all pings.

Nothing but this module knows which pings share a water. Rays, echoes and reductions ask for the water of their ping;
windows, ranges and units, which all pings share, ask for the extremes of all columns.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .column import AbsorptionColumn
from .profile import SoundSpeedProfile
from .volume import VolumeScattering


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterColumn:
    """Water between surface and bed, at the frequency of a sonar."""

    profile: SoundSpeedProfile
    absorption: AbsorptionColumn
    volume: VolumeScattering | None = None  # None: the water itself scatters nothing back
    #: absorption [dB/m] against frequency [Hz], mean from the sonar to the lowest bed; None where it is constant
    mean_absorption_db: Callable[[np.ndarray], np.ndarray] | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Waters:
    """Water of a survey's pings: one column for all of them."""

    column: WaterColumn

    @classmethod
    def constant(cls, column: WaterColumn) -> Waters:
        """Return one column for all pings."""
        return Waters(column=column)

    @property
    def columns(self) -> list[WaterColumn]:
        """Return the different columns."""
        return [self.column]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return the numbers of the columns of pings, of any shape."""
        return np.zeros(np.shape(ping), int)

    def at(self, ping: int) -> WaterColumn:
        """Return the water of a ping."""
        return self.columns[int(self.number(ping))]

    def sound_speed(self, ping: int, depth: float) -> float:
        """Return the sound speed [m/s] of a ping at a depth [m]."""
        return float(self.at(ping).profile.at(depth))

    def within(self, ping: int) -> Waters:
        """Return the water of a ping as that of all pings."""
        return self if len(self.columns) == 1 else Waters.constant(self.at(ping))

    @property
    def only(self) -> WaterColumn:
        """Return the column that all pings share; raise `ValueError` if they differ."""
        if len(self.columns) > 1:
            raise ValueError(f"one water was asked for, but the survey's pings have {len(self.columns)}; ask for that "
                             "of a ping, or go through the survey in parts that share one")
        return self.columns[0]

    @property
    def first(self) -> WaterColumn:
        """Return the water of the first ping, for what a record states once, such as its cast."""
        return self.at(0)

    @property
    def slowest(self) -> float:
        """Return the lowest sound speed of all pings [m/s]."""
        return min(float(np.min(column.profile.sound_speed)) for column in self.columns)

    @property
    def fastest(self) -> float:
        """Return the highest sound speed of all pings [m/s]."""
        return max(float(np.max(column.profile.sound_speed)) for column in self.columns)

    @property
    def least_absorption_db(self) -> float:
        """Return the lowest absorption of all pings [dB/m]."""
        return min(float(np.min(column.absorption.absorption_db)) for column in self.columns)

    @property
    def scatter(self) -> bool:
        """Return True if the water itself scatters sound back at any ping."""
        return any(column.volume is not None for column in self.columns)
