"""Soundings of a multibeam echo sounder, ping by ping, with the truth beside each.

    measure    times and angles of the bed in the beams                                 `measuring`
    reduce     places, by the profile, the head's sound speed and the motion said       `hydrography.reduction`
    compare    with the bed that lies there, cause by cause                `hydrography.errors`, `bed_truth`

An array that moves with v meets waves from n' at a slant, with the sine a_r·n' c / (c + n'·v). Instruments leave that
out: it counts as an error by motion.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from ...hydrography.errors import Reduction, errors
from ...hydrography.motion_errors import MotionErrors
from ...hydrography.record import variable
from ...hydrography.reduction import Installation, Located, Measured
from ...hydrography.uncertainty import Accuracies, with_uncertainty
from ...imaging.fan import levels
from ...units import db_from_power
from ...water.profile import SoundSpeedProfile
from .bed_truth import BedPoints, bed_at, bed_depth
from .measuring import Measurement, SwathBeams
from .motion import said_motion, true_motion
from .strength import WORDS, Strengths
from .survey import SwathSurvey

__all__ = ["SoundingLine"]

STEP = 0.005                       # [s] over which the velocity is taken
START = "2000-01-01T00:00:00Z"     # motion sensors speak before time 0, and formats count from 1970


class SoundingLine:
    """Make the soundings of a line.

    Parameters
    ----------
    survey : SwathSurvey
    seed : int
    profile : SoundSpeedProfile or None
        That soundings are made with; None: the scene's own.
    column : bool
        Whether the water column is kept.
    snippets : int
        Samples about each sounding that are kept.
    """

    def __init__(self, survey: SwathSurvey, seed: int, *, profile: SoundSpeedProfile | None = None,
                 column: bool = False, snippets: int = 0):
        self._survey, self._column, self._snippets = survey, column, snippets
        self._profile = profile or survey.profile
        self._beams = SwathBeams(survey, seed)
        self._strengths = Strengths(survey, self._beams.sectors)
        self._true, self._said = true_motion(survey), said_motion(survey, seed)
        self._installation, self._accuracies = _installation(survey), _accuracies(survey.motion_errors)
        self._line = self._of_the_line("another than the scene's" if profile else "the scene's", seed)

    def pings(self, numbers: Sequence[int] | None = None) -> Iterator[xr.Dataset]:
        """Yield the soundings of pings one by one: what is kept does not grow with their number."""
        for ping in range(self._survey.track.pings) if numbers is None else numbers:
            yield self._ping(int(ping))

    def _ping(self, ping: int) -> xr.Dataset:
        made = self._beams.measure(ping)
        head_speed = self._survey.sectors[0].survey.sound_speed(ping) + self._survey.head_speed_error
        measured = Measured(ping_time=np.full(len(made.sent), self._survey.track.time[ping]), transmit_time=made.sent,
                            travel_time=made.travel_time, angle=made.angle, transmit_angle=made.transmit_angle,
                            head_sound_speed=np.full(len(made.sent), head_speed))
        true = Reduction(motion=self._true, installation=self._installation, profile=self._survey.profile, node=False)
        used = Reduction(motion=self._said, installation=self._installation, profile=self._profile)
        above = -float(self._survey.track.position[ping, 2])
        final, off = errors(measured, true, used, lambda x, y: bed_depth(self._survey.geometry, x, y, above=above),
                            at_rest=self._at_rest(measured, true))
        bed = self._bed(ping, final)
        values = {**self._of_a_ping(ping, head_speed), **_sounded(made, final),
                  **self._strengths.of(ping, made, final, self._snippets),
                  **off.variables(), "label": bed.label,
                  "true_backscatter_db": db_from_power(np.maximum(bed.strength, 1e-30))}
        if self._snippets:
            values["snippet_rate"] = self._survey.sectors[0].survey.sampling_rate
        if self._column:
            values.update(self._of_the_column(ping, made))
        whole = {name: variable(name, np.asarray(value)[None]) for name, value in values.items()}
        made_up = xr.Dataset({**self._line.data_vars, **whole}, coords={"ping": [ping]}, attrs=self._line.attrs)
        return with_uncertainty(made_up, self._accuracies)

    def _at_rest(self, measured: Measured, true: Reduction) -> Measured:
        """Give the angles that an array at rest would have measured."""
        rough = true.located(measured)
        heard = np.nan_to_num(measured.transmit_time + measured.travel_time)
        arm = np.asarray(self._installation.receive_offset)
        place, later = (self._true.at(heard + step).carried(arm)
                        for step in (-STEP, STEP))
        towards = np.stack([rough.x, rough.y, rough.depth], -1) - 0.5 * (place + later)
        towards = towards / np.linalg.norm(towards, axis=-1, keepdims=True)
        closing = np.sum(towards * (later - place), -1) / (2 * STEP)
        sine = np.sin(measured.angle) * (1 + closing / measured.head_sound_speed)
        return replace(measured, angle=np.arcsin(np.clip(sine, -1, 1)))

    def _bed(self, ping: int, some: Located) -> BedPoints:
        """Whose the bed below soundings is, and how strongly it scatters back at the frequency of each sector."""
        survey, parts = self._survey, []
        origin = survey.track.position[ping]
        away = np.stack([some.x - origin[0], some.y - origin[1]], -1)
        away = away / np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9)
        arrival = np.concatenate([away * np.cos(some.grazing)[:, None], -np.sin(some.grazing)[:, None]], -1)
        depth = float(np.nanmean(some.depth)) if some.found.any() else -origin[2]
        for run in survey.sectors:
            parts.append(bed_at(survey.geometry, some.x[run.beams], some.y[run.beams], above=-float(origin[2]),
                                arrival=arrival[run.beams], sound_speed=float(survey.profile.at(depth)),
                                frequency=run.survey.frequency))
        return BedPoints(label=np.concatenate([part.label for part in parts]),
                         strength=np.concatenate([part.strength for part in parts]))

    def _of_a_ping(self, ping: int, head_speed: float) -> dict[str, np.ndarray | float]:
        """What is of the ping and of its sectors."""
        survey = self._survey
        time = float(survey.track.time[ping])
        pose = self._said.at(np.array([time]))
        runs = [run.survey for run in survey.sectors]
        sines = np.array([run.transmit_sines[ping] * run.said[ping] for run in survey.sectors])
        return {"ping_time": time, "ping_x": pose.place[0, 0], "ping_y": pose.place[0, 1],
                "ping_depth": pose.place[0, 2], "ping_roll": pose.roll[0], "ping_pitch": pose.pitch[0],
                "ping_heading": pose.heading[0] % (2 * np.pi), "head_sound_speed": head_speed,
                "sector_frequency": np.array([run.frequency for run in runs]),
                "sector_delay": np.array([run.sector.delay for run in survey.sectors]),
                "sector_angle": np.arcsin(np.clip(sines, -1, 1)),
                "sector_pulse_length": np.array([run.pulse.duration for run in runs]),
                "sector_bandwidth": np.array([run.pulse.bandwidth for run in runs]),
                "sector_source_level_db": np.array([run.source_level_db for run in runs]),
                "sector_absorption_db": self._strengths.absorption_db}

    def _of_the_column(self, ping: int, made: Measurement) -> dict[str, np.ndarray]:
        """Levels of all beams."""
        runs = self._survey.sectors
        angle = np.concatenate([np.arcsin(np.clip(run.sines[ping] * run.said[ping], -1, 1)) for run in runs])
        beams = [run.sines.shape[1] for run in runs]
        level = np.concatenate([levels(halves.whole) for halves, _ in made.halves])
        time = made.halves[0][1]
        # echoes change over the length of a pulse: two samples of it are kept
        rate = runs[0].survey.sampling_rate
        step = max(1, int(rate * min(made.pulse_length) / 2))
        return {"column_angle": angle, "column_sector": np.repeat(np.arange(len(runs)), beams),
                "column_start": np.full(len(angle), time[0]),
                "column_rate": np.full(len(angle), rate / step), "column_level_db": level[:, ::step]}

    def _of_the_line(self, profile: str, seed: int) -> xr.Dataset:
        """What all pings share."""
        installation, motion, geometry = self._installation, self._said, self._survey.geometry
        water = self._survey.profile
        values = {"cast_depth": self._profile.depth, "cast_sound_speed": self._profile.sound_speed,
                  "true_cast_depth": water.depth, "true_cast_sound_speed": water.sound_speed,
                  **{name: getattr(installation, name) for name in
                     ("transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting")},
                  **{f"motion_{name}": getattr(motion, name) for name in
                     ("time", "x", "y", "depth", "roll", "pitch")},
                  "motion_heading": motion.heading % (2 * np.pi)}
        attrs = {"sonar": "multibeam", "title": "simulated by mitsonar", "start": START, "preset": self._survey.preset,
                 "profile": profile, "backscatter": WORDS, "seed": int(seed),
                 "labels": {str(number): name for number, name in self._survey.labels.items()}}
        frame = self._survey.passage.frame
        crs = geometry.crs or (None if frame is None else frame.crs)
        attrs["crs"] = crs
        if crs is not None:
            origin = geometry.local_origin if geometry.local_origin is not None else getattr(frame, "origin")
            attrs["origin"] = (float(origin[0]), float(origin[1]))
        return xr.Dataset({name: variable(name, value) for name, value in values.items()}, attrs=attrs)


def _sounded(made: Measurement, final: Located) -> dict[str, np.ndarray]:
    """The soundings themselves."""
    return {"valid": made.valid & final.found, "travel_time": made.travel_time, "angle": made.angle,
            "transmit_angle": made.transmit_angle, "sector": made.sector, "depth": final.depth, "x": final.x,
            "y": final.y, "across_track": final.across_track, "along_track": final.along_track,
            "detection": made.method, "quality": made.quality, "grazing": final.grazing}


def _installation(survey: SwathSurvey) -> Installation:
    """Where the arrays are on the platform."""
    offset = survey.voyage.trajectory.offset
    first = survey.sectors[0].survey
    return Installation(
        transmit_offset=offset + first.transmit.position.mean(0),
        receive_offset=offset + first.receive.position.mean(0),
        transmit_mounting=survey.mounting, receive_mounting=survey.mounting)


def _accuracies(errors: MotionErrors) -> Accuracies:
    """Of the sensors as the scene says them; nobody knows a bias."""
    return Accuracies(angle=0.0, roll=errors.attitude_noise, pitch=errors.attitude_noise,
                      heading=errors.heading_noise, heave=errors.heave_noise, heave_share=0.0, draught=0.0,
                      position=errors.position_noise * float(np.sqrt(2)), latency=0.0, profile=0.0, head=0.0)
