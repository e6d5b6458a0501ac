"""Echo sounder: one beam that looks down; its run over a scene, and its echogram.

    plan       a survey of one element, which sends and receives                        `pressure.planning`
    signals    of the face and of the halves of its quadrants, in the beam domain       `signals`
    echogram   strengths, angles and depths by the sonar equation                       `imaging.echo_sounder`
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.imaging import echo_sounder as imaging
from mitsonar.imaging.energy_record import EnergyRecord, gathered, only_row
from mitsonar.scene import objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.signal.matched_filtering import compression
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.pulses.pulses import Pulse
from mitsonar.units import db_from_power

from .. import limits
from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.signals import LEAD
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed
from ..survey import PerSurroundings
from .signals import FaceSignals, split_survey

SAMPLES = 6.0, 24.0                # sampling rate over bandwidth, of sweeps and of other pulses: peaks within 0.1 dB
SWEEP = 4.0                        # least duration times bandwidth of a sweep


class EchoSounderSensor(Sensor, Protocol):
    """Sensor of an echo sounder."""

    preset: str
    source_level_db: float  # [dB re 1 µPa @ 1 m]: on the axis
    pulse: Pulse
    transmit: Array  # the whole face, one element
    quadrants: Array | None  # of a split beam; None: a single beam
    beam_width: float  # [rad]: full one-way -3 dB width
    depth_gate: tuple[float, float] | None  # [m]: below the sonar, where the bed is searched for
    bottom_level_db: float  # [dB re 1/m]: least volume strength of the bed
    self_noise_db: float | None  # [dB re 1 µPa²/Hz]: of the whole face


def plan(scene: mi.Scene, sensor: EchoSounderSensor, settings: RunSettings, lead: float = LEAD) -> ArraySurvey:
    """Plan a run for a picture; the record begins `lead` pulse lengths early."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1])
    pulse, face = sensor.pulse, sensor.transmit
    rate = SAMPLES[0 if pulse.duration * pulse.bandwidth > SWEEP else 1] * pulse.bandwidth
    return survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=head_speed(sensor, passage.depth),
                     transmit=face, receive=face, pulse=pulse, source_level_db=sensor.source_level_db,
                     bins_are_samples=False, whole_bins=True, self_noise_db=sensor.self_noise_db, usual_rate=rate)


def plan_elements(scene: mi.Scene, sensor: EchoSounderSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan the same run with the quadrants as receive elements, or the whole face of a single beam."""
    whole = plan(scene, sensor, settings, lead)
    return whole if sensor.quadrants is None else split_survey(whole, sensor.quadrants)


def picture(survey: ArraySurvey, sensor: EchoSounderSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the echogram, with its truth; see `mitsonar.render`."""
    pings, speed = survey.track.pings, head_speed(sensor, survey.passage.depth)
    limits.check_beams(survey, 1, pings=pings)
    _, bins = sensor.film().window(speed)
    signals = PerSurroundings(survey, lambda part: FaceSignals(part, sensor.quadrants, bins))
    sounder, measured = _calibrated(survey, sensor, speed, bins), []

    def of(ping: int) -> tuple[Any, EnergyRecord]:
        made = signals.at(ping).ping(ping, seed)
        return sounder.measured(made.whole, made.halves), made.truth

    def records() -> Iterator[EnergyRecord]:
        for values, truth in survey.each_part(of, range(pings), progress):
            measured.append(values)
            yield truth

    record = only_row(gathered(records(), pings=pings, rows=1))
    classes, class_of = classes_of(survey.labels)
    image = imaging.image(
        sounder, measured, record, track=survey.track, depth_below=survey.depth_below, labels=survey.labels,
        class_of=class_of, attrs={
            "seed": int(seed), "preset": sensor.preset, "frequency": float(survey.frequency),
            "pulse": survey.pulse.numbers, "noise_db": _noise_db(survey)})
    return objects.annotated(image, classes, class_of, survey.world.still, survey.track.position)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, range) as rows of one picture, unchanged."""
    return level


def _calibrated(survey: ArraySurvey, sensor: EchoSounderSensor, speed: float, bins: int) -> imaging.CalibratedSounder:
    """Return the calibration of the sounder, with the absorption down the axis of its beam."""
    time = survey.time[survey.lead:]
    normal, top = survey.receive.normal[0], -float(survey.track.position[:, 2].mean())
    way = np.linspace(0, 0.5 * speed * time[-1], 2 * len(time))
    alpha = survey.waters.first.absorption.at(np.maximum(top + normal[2] * way, 0.0))
    loss = np.concatenate([[0], np.cumsum((alpha[1:] + alpha[:-1]) * np.diff(way))])
    return imaging.CalibratedSounder(
        time=time, bins=bins, sound_speed=speed, loss_db=np.interp(0.5 * speed * time, way, loss),
        source_level_db=float(survey.source_level_db),
        pulse=survey.pulse, wavelength=speed / survey.frequency, face=sensor.transmit,
        quadrants=sensor.quadrants, depth_gate=sensor.depth_gate,
        bottom_level_db=sensor.bottom_level_db)


def _noise_db(survey: ArraySurvey) -> float | None:
    """Return the noise behind the matched filter [dB re 1 µPa], None without noise."""
    if survey.noise is None:
        return None
    spectra = [level for level in (survey.noise.ambient_db, survey.noise.self_noise_db) if level is not None]
    bandwidth = compression(survey.pulse, survey.sampling_rate)[1]
    return float(db_from_power(bandwidth * np.sum(10 ** (0.1 * np.array(spectra)))))
