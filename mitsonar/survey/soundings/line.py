"""Soundings of a line, ping by ping, each with its truth and its errors.

    measure    times and angles of the bed                                              an `Instrument`
    reduce     places, from the profile, the sound speed at the head and the motion measured by the sensors
    compare    with the bed of the scene, and with the true motion, error by error      `hydrography.reduction`

Depths are below the datum z = 0. Where the water has a tide, sensors measure depths below the surface, casts hold below
it, and both are reduced to the datum with the tide in use. Without any tide in use, depths are below the surface. By
`heights` "gnss", sensors measure heights above the ellipsoid, and the separation in use reduces these to the datum; the
water level, for the cast, then follows from them and from the depth below the surface.

An array that moves with v receives waves from n' at the sine a_r·n' c / (c + n'·v). Instruments neglect the motion; the
difference counts as an error by motion.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from functools import cached_property, partial
from typing import Generic, Protocol, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import sonar_seed
from mitsonar.device.turns import workers_ended
from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.errors import Reduction, errors
from mitsonar.hydrography.reduction.motion_errors import MotionErrors, SensedMotion
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.hydrography.reduction.uncertainty import Accuracies, Deviations, uncertainties
from mitsonar.io.tracks.tides import Tide
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import registry_index
from mitsonar.units import db_from_power
from mitsonar.water.profile import SoundSpeedProfile

from .field_effect import without_field
from .heights import DepthReference, EllipsoidHeights, place_of
from .instrument import PingMeasurement
from .survey import SoundedSurvey

ASIDE = 1e-3                       # [m]: a ray that slips between two facets is sent again, so far beside their edge
RATE = 100.0                       # [Hz] of the motion sensors
MARGIN = 0.1                       # [s] before the first transmission and after the last reception
STEP = 0.005                       # [s] over which velocities are computed
START = "2000-01-01T00:00:00Z"     # motion begins before time 0, and formats count from 1970
DATED = 1e8                        # [s] above which times of a track count from 1970: no line lasts three years
MeasurementT = TypeVar("MeasurementT", bound=PingMeasurement)


@dataclass(frozen=True, kw_only=True, eq=False)
class BedPoints:
    """Labels and scattering strengths of the bed below places, (N,) each."""

    label: np.ndarray  # number of the instance, 0 where there is no bed
    strength: np.ndarray  # of the material's law, for backscatter


def bed_depth(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float) -> np.ndarray:
    """Return the depth of the bed below places x, y (N,) [m], seen from the depth `above` [m]; NaN without a bed."""
    depth = np.full(len(x), np.nan)
    for aside in (0.0, ASIDE):
        missing = np.flatnonzero(np.isnan(depth) & np.isfinite(x))
        if missing.size:
            si = geometry.scene.ray_intersect(_down(x[missing] + aside, y[missing] + 0.6 * aside, above))
            depth[missing] = np.where(si.is_valid().numpy(), above + si.t.numpy(), np.nan)
    return depth


def bed_at(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float, arrival: np.ndarray,
           sound_speed: float, frequency: float) -> BedPoints:
    """Return the bed below places x, y (N,) [m]; `arrival` (N, 3) are unit vectors of the sound that arrives there."""
    ray = _down(x, y, above)
    si, pi = geometry.scene.ray_intersect(ray), geometry.scene.ray_intersect_preliminary(ray)
    valid = si.is_valid()
    towards = mi.Vector3f(*(upload(mi.Float, np.nan_to_num(part).astype(np.float32)) for part in arrival.T))
    hits = Hits.on_surface(valid=valid, point=arrays_of(mi.Float).Array3f64(si.p), normal=mi.Vector3f(si.n),
                           arrival_direction=towards, sound_speed=dr.opaque(mi.Float64, sound_speed), shape=si.shape,
                           primitive=si.prim_index, uv=si.uv)
    strength, _ = scattering_strength(hits, valid, frequency)
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), valid)
    on_bed = valid.numpy() & np.isfinite(x)
    return BedPoints(label=np.where(on_bed, label.numpy(), 0).astype(np.uint32),
                     strength=np.where(on_bed, strength.numpy(), np.nan))


def _down(x: np.ndarray, y: np.ndarray, above: float) -> mi.Ray3f:
    """Return vertical rays downwards from the depth `above` [m]."""
    place = (upload(mi.Float, np.nan_to_num(v).astype(np.float32)) for v in (x, y))
    return mi.Ray3f(mi.Point3f(*place, dr.opaque(mi.Float, -float(above))), mi.Vector3f(0, 0, -1))


def true_motion(survey: SoundedSurvey, *, earlier: float = 0.0) -> PlatformMotion:
    """Sample the motion of the reference point, as it was a time `earlier` [s]."""
    trajectory = replace(survey.voyage.trajectory, offset=np.zeros(3))
    last = max(run.survey.track.time[-1] + run.survey.time[-1] for run in survey.transmissions)
    first = survey.track.time[0] - MARGIN
    time = first + np.arange(int(np.ceil((last + MARGIN - first) * RATE)) + 1) / RATE
    position, attitude = trajectory.pose(time - earlier)
    return PlatformMotion(time=time, x=position[:, 0], y=position[:, 1], depth=-position[:, 2], roll=attitude[:, 0],
                          pitch=attitude[:, 1], heading=np.unwrap(attitude[:, 2]))


def measured_motion(survey: SoundedSurvey, seed: int) -> SensedMotion:
    """Return the motion with the errors of its sensors."""
    wrong = survey.motion_errors
    late, fixed = (true_motion(survey, earlier=age) for age in (wrong.latency, wrong.position_latency))
    return wrong.sensed(late, fixed, sonar_seed(seed, "motion sensors"))


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """Variables of soundings other than their places."""

    variables: dict[str, np.ndarray | float]  # by their names in the record
    deviations: Deviations | None = None  # standard deviations of the measurement


class Instrument(Protocol[MeasurementT]):
    """Sonar of a line, as soundings need it; its measurements have at least ``valid`` (B,) and ``sector`` (B,)."""

    sonar: str  # kind of sonar
    installation: Installation  # to which its angles and times refer
    backscatter: str  # corrections that its strengths contain

    def absorption_db(self, ping: int) -> np.ndarray:
        """Return the absorption (S,) [dB/m] of a ping's transmissions, mean from the sonar down to the lowest bed."""
        ...

    def measure(self, ping: int) -> MeasurementT:
        """Return the measurement of a ping."""
        ...

    def measured(self, ping: int, made: MeasurementT, head_speed: float, closing: np.ndarray | None = None) -> Measured:
        """Return the times and angles that follow from a sound speed at the head [m/s].

        With `closing` (B,) [m/s], the receivers' speed towards the echoes, angles are those of receivers at rest.
        """
        ...

    def finding(self, ping: int, made: MeasurementT, final: Located) -> Finding:
        """Return the other variables of soundings, from their final places."""
        ...


class SoundingLine(Generic[MeasurementT]):
    """Soundings of a line."""

    def __init__(self, survey: SoundedSurvey, instrument: Instrument[MeasurementT], seed: int, *,
                 profile: SoundSpeedProfile | None = None, by: DepthReference | None = None):
        by, wrong = by or DepthReference(), survey.motion_errors
        self._survey, self._instrument = survey, instrument
        sensed = measured_motion(survey, seed)
        self._profile, self._true, self._sensed = profile, true_motion(survey), sensed.motion
        self._installation = instrument.installation
        arms = {name: getattr(self._installation, name) + wrong.offset_error
                for name in ("transmit_offset", "receive_offset")}
        self._stated = replace(self._installation, **arms) if any(wrong.offset_error) else self._installation
        self._heights = EllipsoidHeights.of(survey, sensed, by)
        self._tide = _level(survey, by.tide, wrong.tide_error) if self._by_tide else self._followed
        self._accuracies = _accuracies(wrong, wrong.heave_noise if self._by_tide else wrong.height_noise)
        self._transmissions = survey.transmissions
        first = float(survey.track.time[0])
        self._since = math.floor(first) if first > DATED else 0.0
        self._line = self._line_data("another than the scene's" if profile else "the scene's", seed)

    def pings(self, numbers: Iterable[int] | None = None) -> Iterator[xr.Dataset]:
        """Yield the soundings of pings one by one; memory does not grow with their number."""
        for ping in range(self._survey.track.pings) if numbers is None else numbers:
            yield self.ping(int(ping), self._instrument.measure(int(ping)))

    @workers_ended()
    def ping(self, ping: int, made: MeasurementT) -> xr.Dataset:
        """Return the soundings of a ping from the measurement of its instrument."""
        survey, instrument = self._survey, self._instrument
        true_speed = self._transmissions[0].survey.sound_speed(ping)
        head_speed = true_speed + survey.head_speed_error
        measured = instrument.measured(ping, made, head_speed)
        truly = instrument.measured(ping, made, true_speed) if survey.head_speed_error else measured
        column, geometry = survey.water_at(ping), survey.world.at(ping)
        water = column.profile
        true = Reduction(motion=self._true, installation=self._installation, profile=water, node=False)
        used = Reduction(motion=self._sensed if self._by_tide else self._separated(truly=True),
                         installation=self._stated, profile=self._cast(ping, column.level))
        last = self._reduced_by(ping, used)
        above = -float(survey.track.position[ping, 2])
        closing = self._closing(truly, true)
        at_rest = instrument.measured(ping, made, true_speed, closing)
        if column.field is not None:
            at_rest = without_field(at_rest, true.located(at_rest), water, column.field, self._true,
                                    self._installation)
        final, causes = errors(measured, true, used, lambda x, y: bed_depth(geometry, x, y, above=above),
                               at_rest=at_rest,
                               refracted=instrument.measured(ping, made, head_speed, closing),
                               **({"tidal": last} if self._by_tide else {"separated": last}))
        bed, finding = self._bed(ping, final), instrument.finding(ping, made, final)
        values = {
            **self._ping_data(ping, head_speed), "valid": made.valid & final.found,
            "travel_time": measured.travel_time, "angle": measured.angle, "transmit_angle": measured.transmit_angle,
            "sector": made.sector, "depth": final.depth, "x": final.x, "y": final.y,
            "across_track": final.across_track, "along_track": final.along_track, "grazing": final.grazing,
            **finding.variables, **causes.variables(), "label": bed.label,
            "true_backscatter_db": db_from_power(np.maximum(bed.strength, 1e-30))}
        variables = {**self._line.variables,
                     **{name: variable(name, np.asarray(value)[None]) for name, value in values.items()}}
        variables |= uncertainties(variables, self._accuracies, finding.deviations)
        return xr.Dataset(variables, coords={"ping": [ping]}, attrs=self._line.attrs)

    def _cast(self, ping: int, level: float) -> SoundSpeedProfile:
        """Return the cast in use at a ping, below a water level [m]."""
        column = self._survey.water_at(ping)
        return (self._profile or column.profile.lifted(-column.level)).lifted(level)

    @property
    def _by_tide(self) -> bool:
        """Return True if depths are reduced by a tide, or by none, and not by heights above the ellipsoid."""
        return self._heights is None or not self._heights.reduce

    def _separated(self, *, truly: bool = False) -> PlatformMotion:
        """Return the motion as sensors measure it, its depth by heights less the separation in use, or the true one."""
        heights = self._heights
        assert heights is not None
        separation = heights.true_separation if truly else heights.separation
        return replace(self._sensed, depth=separation - heights.height)

    def _followed(self, times: np.ndarray) -> np.ndarray:
        """Return the water level [m] that follows from heights and depths below the surface."""
        sensed, reduced = (motion.at(times).place[..., 2] for motion in (self._sensed, self._reduced))
        return sensed + self._survey.passage.level(times) - reduced

    def _reduced_by(self, ping: int, used: Reduction) -> Reduction | None:
        """Return the reduction with the tide or the separation in use; None without either."""
        if self._tide is None:
            return None
        level = float(self._tide(np.array(self._survey.track.time[ping])))
        return replace(used, motion=self._reduced, profile=self._cast(ping, level))

    @cached_property
    def _reduced(self) -> PlatformMotion:
        """Return the motion as sensors measure it, reduced to the datum with the tide or the separation in use."""
        if not self._by_tide:
            return self._separated()
        sensed, tide = self._sensed, self._tide
        if tide is None:
            return sensed
        return replace(sensed, depth=sensed.depth + self._survey.passage.level(sensed.time) - tide(sensed.time))

    def _closing(self, measured: Measured, true: Reduction) -> np.ndarray:
        """Return the speed of the receivers towards the echoes (B,) [m/s]."""
        rough = true.located(measured)
        received = np.nan_to_num(measured.transmit_time + measured.travel_time)
        arm = np.asarray(self._installation.receive_offset)
        place, later = (self._true.at(received + step).carried(arm) for step in (-STEP, STEP))
        towards = np.stack([rough.x, rough.y, rough.depth], -1) - 0.5 * (place + later)
        towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        return np.sum(towards * (later - place), -1) / (2 * STEP)

    def _bed(self, ping: int, places: Located) -> BedPoints:
        """Return the labels of the bed below soundings, and its backscatter at the frequency of each sector."""
        survey = self._survey
        origin = survey.track.position[ping]
        away = np.stack([places.x - origin[0], places.y - origin[1]], -1)
        away = away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9)
        arrival = np.concatenate([away * np.cos(places.grazing)[:, None], -np.sin(places.grazing)[:, None]], -1)
        depth = float(np.nanmean(places.depth)) if places.found.any() else -origin[2]
        parts = [bed_at(survey.world.at(ping), places.x[run.beams], places.y[run.beams], above=-float(origin[2]),
                        arrival=arrival[run.beams], sound_speed=float(survey.water_at(ping).profile.at(depth)),
                        frequency=run.survey.frequency) for run in self._transmissions]
        return BedPoints(label=np.concatenate([part.label for part in parts]),
                         strength=np.concatenate([part.strength for part in parts]))

    def _ping_data(self, ping: int, head_speed: float) -> dict[str, np.ndarray | float]:
        """Return the variables of a ping and of its sectors."""
        time = float(self._survey.track.time[ping])
        pose = self._reduced.at(np.array([time]))
        tides = {} if self._tide is None else {"tide": float(self._tide(np.array(time))),
                                               "true_tide": float(self._survey.passage.level(np.array(time)))}
        heights = {} if self._heights is None else self._heights.at(time)
        runs = [run.survey for run in self._transmissions]
        sines = np.array([run.sines[ping] for run in self._transmissions])
        return {**tides, **heights, "ping_time": time - self._since,
                "ping_x": pose.place[0, 0], "ping_y": pose.place[0, 1],
                "ping_depth": pose.place[0, 2], "ping_roll": pose.roll[0], "ping_pitch": pose.pitch[0],
                "ping_heading": pose.heading[0] % (2 * np.pi), "head_sound_speed": head_speed,
                "sector_frequency": np.array([run.frequency for run in runs]),
                "sector_delay": np.array([run.delay for run in self._transmissions]),
                "sector_angle": np.arcsin(np.clip(sines, -1, 1)),
                "sector_pulse_length": np.array([run.pulse.duration for run in runs]),
                "sector_bandwidth": np.array([run.pulse.bandwidth for run in runs]),
                "sector_source_level_db": np.array([run.source_level_db for run in runs]),
                "sector_absorption_db": self._instrument.absorption_db(ping)}

    @property
    def _start(self) -> str:
        """Return the date of time 0: that of the track if the track has dates, else `START`."""
        if not self._since:
            return START
        return datetime.fromtimestamp(self._since, timezone.utc).isoformat().replace("+00:00", "Z")

    def _line_data(self, profile: str, seed: int) -> xr.Dataset:
        """Return the variables and attributes that all pings share."""
        installation, motion = self._stated, self._reduced
        water = self._survey.waters.first.profile
        first = self._survey.planned.track.time[0]
        used = self._cast(0, 0.0 if self._tide is None else float(self._tide(np.array(first))))
        values = {"cast_depth": used.depth, "cast_sound_speed": used.sound_speed,
                  "true_cast_depth": water.depth, "true_cast_sound_speed": water.sound_speed,
                  **{name: getattr(installation, name) for name in
                     ("transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting")},
                  **{f"motion_{name}": getattr(motion, name) for name in ("x", "y", "depth", "roll", "pitch")},
                  "motion_time": motion.time - self._since, "motion_heading": motion.heading % (2 * np.pi)}
        attrs = {"sonar": self._instrument.sonar, "title": "simulated by mitsonar", "start": self._start,
                 "preset": self._survey.preset, "profile": profile,
                 "backscatter": self._instrument.backscatter, "seed": int(seed),
                 "labels": {str(number): name for number, name in self._survey.labels.items()}}
        frame = place_of(self._survey)
        attrs["crs"] = None if frame is None else frame.crs
        if frame is not None:
            attrs["origin"] = frame.origin
        if self._heights is not None:
            attrs |= {"heights": "tide" if self._by_tide else "gnss"}
            attrs |= {"vertical_datum": self._heights.datum} if self._heights.datum else {}
        return xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=attrs)


def _level(survey: SoundedSurvey, tide: Tide | float | None,
           off: float) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return the tide in use [m] by time [s]: the one given, or the water's own, and its error; None without any."""
    time = survey.planned.track.time
    if tide is None and survey.passage.tide is None and not off:
        return None
    own: Callable[[np.ndarray], np.ndarray] = survey.passage.level
    if isinstance(tide, Tide):
        own = tide.over(float(time[0]), float(time[-1])).at
    elif tide is not None:
        own = partial(_constant, tide)
    return own if not off else lambda times: own(times) + off


def _constant(value: float, times: np.ndarray) -> np.ndarray:
    return np.full(np.shape(times), value)


def _accuracies(errors: MotionErrors, heights: float) -> Accuracies:
    """Return the accuracies of the sensors, with that of heights [m]; biases are unknown, so they count as 0."""
    return Accuracies(angle=0.0, roll=errors.attitude_noise, pitch=errors.attitude_noise,
                      heading=errors.heading_noise, heave=heights, heave_share=0.0, draught=0.0,
                      position=errors.position_noise * float(np.sqrt(2)), latency=0.0, profile=0.0, head=0.0)
