"""Content of a cast's file (`Samples`), the result of its cleaning (`Cleaning`), and the cast itself (`Cast`)."""
import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mitsonar.water.profile import SoundSpeedProfile


@dataclass(frozen=True, kw_only=True)
class Cleaning:
    """Numbers of samples of a file, and of those left out by reason."""

    read: int  # samples in the file (or its section)
    flagged: int = 0  # marked bad by the instrument's own software
    in_air: int = 0  # before the water and after it
    spikes: int = 0  # at a depth where no instrument gets from one sample to the next
    upcast: int = 0  # after the deepest sample
    soak: int = 0  # before the way down from the surface, while the sensors settled
    reversals: int = 0  # on the way down, but no deeper than a sample before
    merged: int = 0  # averaged into another sample of the same depth


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Content of a file before cleaning and completion."""

    lines: np.ndarray  # (K,): line numbers in the file
    columns: dict[str, np.ndarray]  # (K,): of `fields.QUANTITIES`, in their units
    state: Literal["recorded", "processed", "ordered"]  # "recorded"
    flagged: int = 0  # how many samples were marked bad and are not here
    latitude: float | None = None  # [deg]
    longitude: float | None = None  # [deg]
    time: datetime.datetime | None = None
    sections: int = 1

    def taking(self, which: np.ndarray | Sequence[int] | slice, **columns: np.ndarray) -> "Samples":
        """Return the samples of an index or a mask, with ``columns`` added or replaced (those already taken)."""
        taken = {what: values[which] for what, values in self.columns.items()} | columns
        return replace(self, lines=self.lines[which], columns=taken)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """Hold one cast."""

    profile: SoundSpeedProfile  # the nodes that were measured, then those of the extension, if it has any
    format: str  # the name of the format it was read from
    temperature: np.ndarray | None = None  # (K,) [deg C]: in situ, ITS-90, at the nodes of the profile
    salinity: np.ndarray | None = None  # (K,) [-]: practical salinity at the nodes of the profile
    latitude: float | None = None  # [deg]: where the file says so in a way that can be read
    longitude: float | None = None  # [deg]: where the file says so in a way that can be read
    time: datetime.datetime | None = None  # aware, in UTC (taken for it where the file names no zone)
    sections: int = 1  # how many casts the file holds
    sound_speed_source: str = "file"  # whether the file gives the sound speed or it was computed
    pressure_latitude: float | None = None  # [deg]: for which pressures were turned into depths
    extension: str = "constant"  # how it goes on below the deepest sample
    measured: int | None = None  # how many nodes, from the first, were measured
    cleaning: Cleaning | None = None
