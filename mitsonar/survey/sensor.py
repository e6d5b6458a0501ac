"""Define the protocols of a sensor, its water and its film, and the settings of a run."""
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.volume import VolumeScattering

from .voyage import Route


class Water(Protocol):
    """Hold the water as its medium has it.

    Attributes
    ----------
    profile : SoundSpeedProfile
    loaded_profile : SoundSpeedProfile
        The profile when the scene was loaded, whatever `mi.traverse` has changed since.
    volume : VolumeScattering or None
    """

    profile: SoundSpeedProfile
    loaded_profile: SoundSpeedProfile
    volume: VolumeScattering | None

    def absorption_column(self, frequency: float) -> AbsorptionColumn:
        """Return absorption against depth at one frequency [Hz]."""
        ...

    def mean_absorption(self, top: float, bottom: float) -> Callable[[np.ndarray], np.ndarray] | None:
        """Absorption [dB/m] between two depths [m] as a function of frequencies [Hz]; None where it is one for all."""
        ...

    def noise_level_db(self, frequency: float) -> float:
        """Return ambient noise [dB re 1 µPa²/Hz] at a frequency [Hz]."""
        ...


class Film(Protocol):
    """Hold the record as its film has it.

    Attributes
    ----------
    written : (str, float)
        The attribute that the scene sets the sampling by, ``bins`` or ``sample_rate_khz``, and its value.
    """

    @property
    def written(self) -> tuple[str, float]:
        """See above."""
        ...

    def window(self, sound_speed: float) -> tuple[tuple[float, float], int]:
        """Return two-way time window (start, end) [s] and number of bins."""
        ...

    def sampling(self, sound_speed: float, usual_rate: float, *, written: bool = True) -> tuple[float, float, int]:
        """Return start of the record [s], sampling rate [Hz] and number of samples."""
        ...


class Sensor(Protocol):
    """Define what sensors of all kinds have.

    Attributes
    ----------
    kind : str
        One of `survey.kinds.KINDS`.
    water : Water
    route : Route
    sound_speed : float or None [m/s]
        At the sonar, for slant range and steering; None: the profile's there, see `head_speed`.
    noise : bool
        Whether the sea's noise is added.
    pass_number : int
        Which pass over the ground it is, from 0.
    """

    kind: str
    water: Water
    route: Route
    sound_speed: float | None
    noise: bool
    pass_number: int

    def film(self) -> Film:
        """Return the record's window and bins."""
        ...

    def noise_level_db(self) -> float:
        """Return ambient noise spectrum level [dB re 1 µPa²/Hz] at the sonar's frequency."""
        ...

    def place_of(self, tag: str, name: str) -> str:
        """Return where the scene's file writes an attribute of a kind of element, to begin an error with."""
        ...


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Hold the integrator's settings of a run."""

    rays: int  # per ping
    first_pass: float  # share of a sidescan's rays that only finds out where rays are needed
    max_depth: int  # bounces that an echo may have made
    ensonification: str  # how an array's scatterers are found
    cell_size: float | None  # [m]: longest side of a scatterer's cell
    scatterers_per_cell: float  # how many a resolution cell of an array's picture in the beam domain has
    ray_sources: str  # where an array's rays start
    ray_source_count: int  # how many, where they are interpolated


def head_speed(sensor: Sensor, depth: np.ndarray | float) -> float:
    """Return the sound speed at the sonar's depths [m] that the film's slant ranges become times by [m/s].

    It is that of the scene as loaded: what changes the water or the track later must not move the window's times, which
    gradients hold.
    """
    return sensor.sound_speed or float(np.mean(sensor.water.loaded_profile.at(np.asarray(depth, float))))


def slowest_speed(sensor: Sensor) -> float:
    """Return the sound speed [m/s] that makes the longest wait for the last echo, of the scene as loaded."""
    return sensor.sound_speed or float(np.min(sensor.water.loaded_profile.sound_speed))
