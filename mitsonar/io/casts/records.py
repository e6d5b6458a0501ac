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
    in_air: int = 0  # before the instrument went into the water and after
    spikes: int = 0  # at a depth that no instrument reaches from one sample to the next
    upcast: int = 0  # after the deepest sample
    soak: int = 0  # before the way down from the surface, while the sensors settled
    reversals: int = 0  # on the way down, but no deeper than a sample before
    merged: int = 0  # averaged into another sample of the same depth


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Content of a file before cleaning and completion."""

    lines: np.ndarray  # (K,): line numbers in the file
    columns: dict[str, np.ndarray]  # (K,): quantities of `fields.QUANTITIES`, in the first unit of `fields.UNITS`
    state: Literal["recorded", "processed", "ordered"]  # over time, by depth, or in a plain table
    flagged: int = 0  # number of samples that were marked bad and left out
    latitude: float | None = None  # [deg]
    longitude: float | None = None  # [deg]
    time: datetime.datetime | None = None
    sections: int = 1

    def taking(self, which: np.ndarray | Sequence[int] | slice, **columns: np.ndarray) -> "Samples":
        """Return the samples of an index or a mask, with ``columns`` (already selected) added or replaced."""
        taken = {what: values[which] for what, values in self.columns.items()} | columns
        return replace(self, lines=self.lines[which], columns=taken)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """A cast: its profile and what the file says about it."""

    profile: SoundSpeedProfile  # the measured nodes, then those of the extension
    format: str  # name of the file format
    temperature: np.ndarray | None = None  # (K,) [deg C]: in situ, ITS-90, at the nodes of the profile
    salinity: np.ndarray | None = None  # (K,) [-]: practical salinity at the nodes of the profile
    latitude: float | None = None  # [deg]: None if the file states none that can be read
    longitude: float | None = None  # [deg]: the same
    time: datetime.datetime | None = None  # UTC, with time zone; a time without a zone is taken for UTC
    sections: int = 1  # number of casts in the file
    sound_speed_source: str = "file"  # "file", or "teos-10" if it was computed
    pressure_latitude: float | None = None  # [deg]: latitude for which pressures were converted to depths
    extension: str = "constant"  # sound speed below the deepest sample
    measured: int | None = None  # number of measured nodes, which come first
    cleaning: Cleaning | None = None
