"""What a file of a cast holds (`Samples`), what was left out of it (`Cleaning`), and the cast itself (`Cast`)."""
import datetime
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mitsonar.water.profile import SoundSpeedProfile


@dataclass(frozen=True, kw_only=True)
class Cleaning:
    """Count the samples of a file and why some are no nodes of the profile.

    Parameters
    ----------
    read : int
        Samples in the file (or its section). Take all that follow from it, and the nodes are left.
    flagged : int
        Marked bad by the instrument's own software.
    in_air : int
        Before the water and after it.
    spikes : int
        At a depth where no instrument gets from one sample to the next.
    upcast : int
        After the deepest sample.
    soak : int
        Before the way down from the surface, while the sensors settled.
    reversals : int
        On the way down, but no deeper than a sample before.
    merged : int
        Averaged into another sample of the same depth.
    """

    read: int
    flagged: int = 0
    in_air: int = 0
    spikes: int = 0
    upcast: int = 0
    soak: int = 0
    reversals: int = 0
    merged: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Hold what a file says, before anything is cleaned or computed.

    Parameters
    ----------
    lines : array (K,)
        Line numbers in the file.
    columns : dict of str to array (K,)
        Of `fields.QUANTITIES`, in their units: depth or pressure at least.
    state : {"recorded", "processed", "ordered"}
        "recorded": as an instrument logs it in time, in air and down and up; "processed": nodes in any order;
        "ordered": nodes whose depths must increase.
    flagged : int
        How many samples were marked bad and are not here.
    latitude, longitude : float [deg] or None
    time : datetime or None
    sections : int
    """

    lines: np.ndarray
    columns: dict[str, np.ndarray]
    state: Literal["recorded", "processed", "ordered"]
    flagged: int = 0
    latitude: float | None = None
    longitude: float | None = None
    time: datetime.datetime | None = None
    sections: int = 1

    def taking(self, which: np.ndarray | Sequence[int] | slice, **columns: np.ndarray) -> "Samples":
        """Give the samples of an index or a mask, with ``columns`` added or replaced (those already taken)."""
        taken = {what: values[which] for what, values in self.columns.items()} | columns
        return replace(self, lines=self.lines[which], columns=taken)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cast:
    """Hold one cast.

    Parameters
    ----------
    profile : SoundSpeedProfile
        The nodes that were measured, then those of the extension, if it has any.
    format : str
        The name of the format it was read from.
    temperature : array (K,) [deg C] or None
        In situ, ITS-90, at the nodes of the profile.
    salinity : array (K,) [-] or None
        Practical salinity at the nodes of the profile.
    latitude, longitude : float [deg] or None
        Where the file says so in a way that can be read; so is the time.
    time : datetime or None
        Aware, in UTC (taken for it where the file names no zone).
    sections : int
        How many casts the file holds; this is one of them.
    sound_speed_source : {"file", "teos-10"}
        Whether the file gives the sound speed or it was computed.
    pressure_latitude : float [deg] or None
        For which pressures were turned into depths: the cast's latitude, or 45 where that is not known. None where
        the file gives depths.
    extension : {"constant", "gradient"}
        How it goes on below the deepest sample.
    measured : int or None
        How many nodes, from the first, were measured; the others are the extension. None: all.
    cleaning : Cleaning or None
    """

    profile: SoundSpeedProfile
    format: str
    temperature: np.ndarray | None = None
    salinity: np.ndarray | None = None
    latitude: float | None = None
    longitude: float | None = None
    time: datetime.datetime | None = None
    sections: int = 1
    sound_speed_source: str = "file"
    pressure_latitude: float | None = None
    extension: str = "constant"
    measured: int | None = None
    cleaning: Cleaning | None = None
