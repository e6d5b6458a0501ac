"""Soundings of a line, ping by ping, with the truth beside each.

    measure    times and angles of the bed                                              an `Instrument`
    reduce     places, by the profile, the head's sound speed and the motion said       `hydrography.reduction`
    compare    with the bed that lies there, cause by cause                `hydrography.errors`, `bed_truth`

An array that moves with v meets waves from n' at a slant, with the sine a_r·n' c / (c + n'·v). Instruments leave that
out: it counts as an error by motion.

The motion of a swath's platform as its sensors have it: what is true, and what they say.

The bed that soundings should find: what lies at x, y, whose it is, and how strongly it scatters there.
"""
from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import sonar_seed
from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.errors import Reduction, disturbed, errors
from mitsonar.hydrography.reduction.motion_errors import MotionErrors
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.hydrography.reduction.uncertainty import Accuracies, Deviations, with_uncertainty
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.materials import scattering_strength
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import registry_index
from mitsonar.sonar.motion.trajectory import Trajectory
from mitsonar.units import db_from_power
from mitsonar.water.profile import SoundSpeedProfile

from .survey import SoundedSurvey

ASIDE = 1e-3                       # [m] beside an edge of facets, where a ray that slips between them is sent again


@dataclass(frozen=True, kw_only=True, eq=False)
class BedPoints:
    """Hold label and strength of the bed below places, (N,) each."""

    label: np.ndarray  # of the instance
    strength: np.ndarray  # by the material's law, for sound that comes from where it was sent


def bed_depth(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float) -> np.ndarray:
    """Return the depth of what lies below places, (N,) [m]; NaN where nothing does."""
    # x, y (N,) [m]; above [m]
    depth = np.full(len(x), np.nan)
    for aside in (0.0, ASIDE):
        lost = np.flatnonzero(np.isnan(depth) & np.isfinite(x))
        if lost.size:
            si = geometry.scene.ray_intersect(_down(x[lost] + aside, y[lost] + 0.6 * aside, above))
            depth[lost] = np.where(si.is_valid().numpy(), above + si.t.numpy(), np.nan)
    return depth


def bed_at(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float, arrival: np.ndarray,
           sound_speed: float, frequency: float) -> BedPoints:
    """Return what lies below places."""
    # arrival (N, 3); sound_speed [m/s]; frequency [Hz]
    ray = _down(x, y, above)
    si, pi = geometry.scene.ray_intersect(ray), geometry.scene.ray_intersect_preliminary(ray)
    valid = si.is_valid()
    towards = mi.Vector3f(*(upload(mi.Float, np.nan_to_num(part).astype(np.float32)) for part in arrival.T))
    hits = Hits.on_surface(valid=valid, point=arrays_of(mi.Float).Array3f64(si.p), normal=mi.Vector3f(si.n),
                           arrival_direction=towards, sound_speed=dr.opaque(mi.Float64, sound_speed), shape=si.shape,
                           primitive=si.prim_index, uv=si.uv)
    strength, _ = scattering_strength(hits, valid, frequency)
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), valid)
    there = valid.numpy() & np.isfinite(x)
    return BedPoints(label=np.where(there, label.numpy(), 0).astype(np.uint32),
                     strength=np.where(there, strength.numpy(), np.nan))


def _down(x: np.ndarray, y: np.ndarray, above: float) -> mi.Ray3f:
    """Return rays straight down."""
    place = (upload(mi.Float, np.nan_to_num(v).astype(np.float32)) for v in (x, y))
    return mi.Ray3f(mi.Point3f(*place, dr.opaque(mi.Float, -float(above))), mi.Vector3f(0, 0, -1))


RATE = 100.0                       # [Hz] of the sensors
MARGIN = 0.1                       # [s] before the first transmission and after the last reception


def true_motion(survey: SoundedSurvey, *, earlier: float = 0.0) -> PlatformMotion:
    """Sample the reference point's way and attitude; attitude and depth of `earlier` [s] before."""
    trajectory = _reference(survey.voyage.trajectory)
    last = max(run.survey.track.time[-1] + run.survey.time[-1] for run in survey.transmissions)
    first = survey.track.time[0] - MARGIN
    time = first + np.arange(int(np.ceil((last + MARGIN - first) * RATE)) + 1) / RATE
    position, _ = trajectory.pose(time)
    before, attitude = trajectory.pose(time - earlier)
    return PlatformMotion(time=time, x=position[:, 0], y=position[:, 1], depth=-before[:, 2], roll=attitude[:, 0],
                  pitch=attitude[:, 1], heading=np.unwrap(attitude[:, 2]))


def said_motion(survey: SoundedSurvey, seed: int) -> PlatformMotion:
    """Return the motion with the errors of its sensors."""
    errors = survey.motion_errors
    true = true_motion(survey, earlier=errors.latency)
    added = errors.added(true.time, sonar_seed(seed, "motion sensors"))
    return disturbed(true, latency=0.0, **added)


def _reference(trajectory: Trajectory) -> Trajectory:
    """Return the way of the reference point, where the track leads."""
    return replace(trajectory, offset=np.zeros(3))


STEP = 0.005                       # [s] over which the velocity is taken
START = "2000-01-01T00:00:00Z"     # motion sensors speak before time 0, and formats count from 1970
DATED = 1e8                        # [s] from which a track's times are since 1970: no line lasts three years


@dataclass(frozen=True, kw_only=True, eq=False)
class Finding:
    """Hold the variables of soundings beside their places."""

    variables: dict[str, np.ndarray | float]  # of the record, by its names
    deviations: Deviations | None = None  # of the measurement


class Instrument(Protocol):
    """The sonar of a line as soundings need it.

    A measurement has ``valid`` (B,), ``sector`` (B,) and what else it needs.

    Attributes
    ----------
    sonar : str
        Kind of sonar.
    installation : Installation
        That its angles and times are of.
    absorption_db : (S,) [dB/m]
        Of the transmissions, mean from the sonar down to the lowest bed.
    backscatter : str
        What its strengths are corrected for.
    """

    sonar: str
    installation: Installation
    absorption_db: np.ndarray
    backscatter: str

    def measure(self, ping: int) -> Any:
        """Measure a ping."""
        ...

    def measured(self, ping: int, made: Any, head_speed: float, closing: np.ndarray | None = None) -> Measured:
        """Return times and angles as a sound speed at the head [m/s] makes them.

        With `closing` (B,) [m/s], the receivers' speed towards the echoes, angles are those of receivers at rest.
        """
        ...

    def finding(self, ping: int, made: Any, final: Located) -> Finding:
        """Return the other variables of soundings with places."""
        ...


class SoundingLine:
    """Make the soundings of a line."""

    def __init__(self, survey: SoundedSurvey, instrument: Instrument, seed: int, *,
                 profile: SoundSpeedProfile | None = None):
        self._survey, self._instrument = survey, instrument
        self._profile = profile or survey.profile
        self._true, self._said = true_motion(survey), said_motion(survey, seed)
        self._installation, self._accuracies = instrument.installation, _accuracies(survey.motion_errors)
        self._transmissions = survey.transmissions
        first = float(survey.track.time[0])
        self._since = math.floor(first) if first > DATED else 0.0
        self._line = self._of_the_line("another than the scene's" if profile else "the scene's", seed)

    def pings(self, numbers: Sequence[int] | None = None) -> Iterator[xr.Dataset]:
        """Yield the soundings of pings one by one: what is kept does not grow with their number."""
        for ping in range(self._survey.track.pings) if numbers is None else numbers:
            yield self.ping(int(ping), self._instrument.measure(int(ping)))

    def ping(self, ping: int, made: Any) -> xr.Dataset:
        """Return the soundings of a ping from what its instrument measured."""
        survey, instrument = self._survey, self._instrument
        there = self._transmissions[0].survey.sound_speed(ping)
        head_speed = there + survey.head_speed_error
        measured = instrument.measured(ping, made, head_speed)
        truly = instrument.measured(ping, made, there) if survey.head_speed_error else measured
        true = Reduction(motion=self._true, installation=self._installation, profile=survey.profile, node=False)
        used = Reduction(motion=self._said, installation=self._installation, profile=self._profile)
        above = -float(survey.track.position[ping, 2])
        closing = self._closing(truly, true)
        final, off = errors(measured, true, used, lambda x, y: bed_depth(survey.geometry, x, y, above=above),
                            at_rest=instrument.measured(ping, made, there, closing),
                            refracted=instrument.measured(ping, made, head_speed, closing))
        bed, finding = self._bed(ping, final), instrument.finding(ping, made, final)
        values = {**self._of_a_ping(ping, head_speed), **_sounded(made, measured, final), **finding.variables,
                  **off.variables(), "label": bed.label,
                  "true_backscatter_db": db_from_power(np.maximum(bed.strength, 1e-30))}
        whole = {name: variable(name, np.asarray(value)[None]) for name, value in values.items()}
        made_up = xr.Dataset({**self._line.data_vars, **whole}, coords={"ping": [ping]}, attrs=self._line.attrs)
        return with_uncertainty(made_up, self._accuracies, finding.deviations)

    def _closing(self, measured: Measured, true: Reduction) -> np.ndarray:
        """Return speed of the receivers towards the echoes (B,) [m/s]."""
        rough = true.located(measured)
        heard = np.nan_to_num(measured.transmit_time + measured.travel_time)
        arm = np.asarray(self._installation.receive_offset)
        place, later = (self._true.at(heard + step).carried(arm)
                        for step in (-STEP, STEP))
        towards = np.stack([rough.x, rough.y, rough.depth], -1) - 0.5 * (place + later)
        towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        return np.sum(towards * (later - place), -1) / (2 * STEP)

    def _bed(self, ping: int, some: Located) -> BedPoints:
        """Whose the bed below soundings is, and how strongly it scatters back at the frequency of each sector."""
        survey, parts = self._survey, []
        origin = survey.track.position[ping]
        away = np.stack([some.x - origin[0], some.y - origin[1]], -1)
        away = away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9)
        arrival = np.concatenate([away * np.cos(some.grazing)[:, None], -np.sin(some.grazing)[:, None]], -1)
        depth = float(np.nanmean(some.depth)) if some.found.any() else -origin[2]
        for run in self._transmissions:
            parts.append(bed_at(survey.geometry, some.x[run.beams], some.y[run.beams], above=-float(origin[2]),
                                arrival=arrival[run.beams], sound_speed=float(survey.profile.at(depth)),
                                frequency=run.survey.frequency))
        return BedPoints(label=np.concatenate([part.label for part in parts]),
                         strength=np.concatenate([part.strength for part in parts]))

    def _of_a_ping(self, ping: int, head_speed: float) -> dict[str, np.ndarray | float]:
        """Return the variables of a ping and of its sectors."""
        survey = self._survey
        time = float(survey.track.time[ping])
        pose = self._said.at(np.array([time]))
        runs = [run.survey for run in self._transmissions]
        sines = np.array([run.sines[ping] for run in self._transmissions])
        return {"ping_time": time - self._since, "ping_x": pose.place[0, 0], "ping_y": pose.place[0, 1],
                "ping_depth": pose.place[0, 2], "ping_roll": pose.roll[0], "ping_pitch": pose.pitch[0],
                "ping_heading": pose.heading[0] % (2 * np.pi), "head_sound_speed": head_speed,
                "sector_frequency": np.array([run.frequency for run in runs]),
                "sector_delay": np.array([run.delay for run in self._transmissions]),
                "sector_angle": np.arcsin(np.clip(sines, -1, 1)),
                "sector_pulse_length": np.array([run.pulse.duration for run in runs]),
                "sector_bandwidth": np.array([run.pulse.bandwidth for run in runs]),
                "sector_source_level_db": np.array([run.source_level_db for run in runs]),
                "sector_absorption_db": self._instrument.absorption_db}

    @property
    def _start(self) -> str:
        """Return date of time 0: the track's, where that is recorded."""
        if not self._since:
            return START
        return datetime.fromtimestamp(self._since, timezone.utc).isoformat().replace("+00:00", "Z")

    def _of_the_line(self, profile: str, seed: int) -> xr.Dataset:
        """Return the variables and attributes that all pings share."""
        installation, motion, geometry = self._installation, self._said, self._survey.geometry
        water = self._survey.profile
        values = {"cast_depth": self._profile.depth, "cast_sound_speed": self._profile.sound_speed,
                  "true_cast_depth": water.depth, "true_cast_sound_speed": water.sound_speed,
                  **{name: getattr(installation, name) for name in
                     ("transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting")},
                  **{f"motion_{name}": getattr(motion, name) for name in
                     ("x", "y", "depth", "roll", "pitch")},
                  "motion_time": motion.time - self._since, "motion_heading": motion.heading % (2 * np.pi)}
        attrs = {"sonar": self._instrument.sonar, "title": "simulated by mitsonar", "start": self._start,
                 "preset": self._survey.preset, "profile": profile,
                 "backscatter": self._instrument.backscatter, "seed": int(seed),
                 "labels": {str(number): name for number, name in self._survey.labels.items()}}
        frame = self._survey.passage.frame
        crs = geometry.crs or (None if frame is None else frame.crs)
        attrs["crs"] = crs
        if crs is not None:
            origin = geometry.local_origin if geometry.local_origin is not None else getattr(frame, "origin")
            attrs["origin"] = (float(origin[0]), float(origin[1]))
        return xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=attrs)


def _sounded(made: Any, measured: Measured, final: Located) -> dict[str, np.ndarray]:
    """Return the soundings themselves."""
    return {"valid": made.valid & final.found, "travel_time": measured.travel_time, "angle": measured.angle,
            "transmit_angle": measured.transmit_angle, "sector": made.sector, "depth": final.depth, "x": final.x,
            "y": final.y, "across_track": final.across_track, "along_track": final.along_track,
            "grazing": final.grazing}


def _accuracies(errors: MotionErrors) -> Accuracies:
    """Return the accuracies of the sensors from the scene; biases are unknown."""
    return Accuracies(angle=0.0, roll=errors.attitude_noise, pitch=errors.attitude_noise,
                      heading=errors.heading_noise, heave=errors.heave_noise, heave_share=0.0, draught=0.0,
                      position=errors.position_noise * float(np.sqrt(2)), latency=0.0, profile=0.0, head=0.0)
