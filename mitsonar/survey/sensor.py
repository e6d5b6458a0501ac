"""Protocols of a sensor, its water and its film, and the settings of a run.

Plugins are recognised by the members of these protocols; see `scene.protocols`.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from mitsonar.imaging.recorder import Recorder
from mitsonar.io.casts import Cast
from mitsonar.io.casts.series import PlacedCast
from mitsonar.io.grids.separation import Separation
from mitsonar.io.tracks.tides import Tide
from mitsonar.scene import materials
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.protocols import SceneSonar
from mitsonar.water.column import AbsorptionColumn
from mitsonar.water.fields import UnplacedField
from mitsonar.water.profile import SoundSpeedProfile
from mitsonar.water.volume import VolumeScattering
from mitsonar.water.waters import WaterColumn, Waters

from .voyage import Passage, Route
from .waters_along import frame_of, waters_along

if TYPE_CHECKING:
    import mitsuba as mi


@runtime_checkable
class Water(Protocol):
    """Water of the scene's medium."""

    profile: SoundSpeedProfile
    loaded_profile: SoundSpeedProfile  # as the scene was loaded, before any change by `mi.traverse`
    volume: VolumeScattering | None
    casts: tuple[PlacedCast, ...]  # of water that changes along the line; none of other water
    casts_by: str | None
    casts_rule: str
    casts_step: float
    field: UnplacedField | None  # sound speed that changes across, beside the profile
    field_bending: float  # [s]: bending above which a warning is given
    tide: Tide | None  # None: the water level is z = 0
    separation: Separation | None  # height of z = 0 above the ellipsoid; None: unknown
    vertical_datum: str  # name of z = 0

    def absorption_column(self, frequency: float, cast: Cast | None = None) -> AbsorptionColumn:
        """Return the absorption against depth at one frequency [Hz], in the water of one of the casts."""
        ...

    def mean_absorption(self, top: float, bottom: float,
                        cast: Cast | None = None) -> Callable[[np.ndarray], np.ndarray] | None:
        """Return absorption [dB/m] between two depths [m] as a function of frequency [Hz]; None if it is constant."""
        ...

    def noise_level_db(self, frequency: float) -> float:
        """Return the ambient noise [dB re 1 µPa²/Hz] at a frequency [Hz]."""
        ...


@runtime_checkable
class Film(Protocol):
    """Time window and sampling of the record."""

    range: float  # [m]: end of the record

    @property
    def written(self) -> tuple[str, float]:
        """Return the attribute that sets the sampling in the scene, ``bins`` or ``sample_rate_khz``, and its value."""
        ...

    def window(self, sound_speed: float) -> tuple[tuple[float, float], int]:
        """Return the two-way time window (start, end) [s] and the number of bins."""
        ...

    def sampling(self, sound_speed: float, usual_rate: float, *, written: bool = True) -> tuple[float, float, int]:
        """Return the start of the record [s], the sampling rate [Hz] and the number of samples."""
        ...

    def put(self, image: mi.TensorXf) -> None:
        """Keep the rendered levels, a tensor (pings, columns, 1)."""
        ...


@runtime_checkable
class Sensor(SceneSonar, Protocol):
    """Attributes of sensors of all kinds; `kind` is one of `survey.kinds.KINDS`."""

    route: Route
    sound_speed: float | None  # [m/s]: at the sonar, for slant range and steering; None: that of `head_speed`
    noise: bool  # True if ambient noise is added
    pass_number: int  # number of the pass over the ground, from 0
    two_sided: bool  # True if the sonar looks to both sides
    recorder: Recorder | None  # None: nothing is recorded but levels

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return directions that the sonar looks into (A, 3), body frame, and the depressions (A,) [rad] at which they
        end; None: by their own depressions."""
        ...

    @property
    def water(self) -> Water:
        """Return the water around the sonar."""
        ...

    @property
    def leader(self) -> Sensor | None:
        """Return the sensor whose track this one shares."""
        ...

    def id(self) -> str:
        """Return the name of the sensor in its scene."""
        ...

    def own_seed(self, seed: int) -> int:
        """Return the seed of this sonar's rays, speckle and noise."""
        ...

    def film(self) -> Film:
        """Return the record's window and bins."""
        ...

    def noise_level_db(self) -> float:
        """Return the ambient noise spectrum level [dB re 1 µPa²/Hz] at the sonar's frequency."""
        ...

    def place_of(self, tag: str, name: str) -> str:
        """Return the file and line of an attribute of a kind of element, as the beginning of an error message."""
        ...


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """Integrator's settings of a run."""

    rays: int  # per ping
    first_pass: float  # share of a sidescan's rays that only find the directions in which more rays are needed
    max_depth: int  # largest number of bounces of an echo
    ensonification: str  # method that finds an array's scatterers
    cell_size: float | None  # [m]: longest side of a scatterer's cell
    scatterers_per_cell: float  # in a resolution cell of an array's picture in the beam domain
    ray_sources: str  # places where an array's rays start
    seed: int = 0  # of the scatterers of all surfaces
    ray_source_count: int  # number of these places, where they are interpolated


def sonar_of(sensor: mi.Sensor | Sensor) -> Sensor:
    """Return a sensor that is a sonar; refuse others."""
    if not isinstance(sensor, Sensor):
        raise ValueError("the integrator sonar_path needs a sonar, such as <sensor type=\"sidescan\">, got a "
                         f"{sensor.class_name()}")
    return sensor


def head_speed(sensor: Sensor, depth: np.ndarray | float) -> float:
    """Return the sound speed at the sonar's depths [m] that converts the film's slant ranges to times [m/s].

    The profile is that of the scene as loaded: later changes of the water or the track must not move the window's
    times, which gradients hold fixed.
    """
    return sensor.sound_speed or float(np.mean(sensor.water.loaded_profile.at(np.asarray(depth, float))))


def slowest_speed(sensor: Sensor) -> float:
    """Return the sound speed [m/s] with the longest wait for the last echo, of the scene as loaded."""
    return sensor.sound_speed or float(np.min(sensor.water.loaded_profile.sound_speed))


def planned_waters(sensor: Sensor, geometry: Geometry, passage: Passage, frequency: float) -> Waters:
    """Return the water of a run's pings at a frequency [Hz]; raise `ValueError` if a material does not suit it."""
    water, mean_depth = sensor.water, -float(passage.voyage.track.position[:, 2].mean())
    columns = [WaterColumn(
        profile=water.profile if cast is None else cast.profile, absorption=water.absorption_column(frequency, cast),
        volume=water.volume, mean_absorption_db=water.mean_absorption(mean_depth, geometry.depth_range[1], cast))
        for cast in [one.cast for one in water.casts] or [None]]
    for column in columns:
        materials.check(geometry, column.profile, frequency)
    waters = waters_along(water, columns, geometry, passage) if water.casts else Waters.constant(columns[0])
    track = passage.voyage.track
    if water.field is not None:
        field = water.field.placed(frame_of(geometry, passage), track.position[:, :2], float(track.time[0]))
        waters = waters.with_field(field, track.time)
    if passage.tide is None:
        return waters
    level = passage.level(track.time)
    if geometry.surface_label and level.any():
        raise ValueError(f"the tide is up to {abs(level).max():.3g} m off z = 0, and the scene has a sea_surface, "
                         "which stays there; leave out one of the two")
    return waters.lifted(passage.level, track.time)
