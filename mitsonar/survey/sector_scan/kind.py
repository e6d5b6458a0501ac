"""Sector scan: a head with a single beam that turns from ping to ping; its run over a scene, and its picture.

The head is a sonar with one element (`survey.array`) whose body is the head itself: forward is along the beam, and the
track has the beam's attitude (`sonar.rotating_head`). The transmit pattern is therefore that of the head's attitude at
the transmission, the receive pattern that of its place and attitude at the reception of each echo.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.progress import counted, part_of, shares
from mitsonar.imaging import sector_scan as imaging
from mitsonar.imaging.energy_record import gathered, only_row
from mitsonar.scene import objects
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.labels import classes_of
from mitsonar.signal.matched_filtering import compression, matched_filter
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.arrays.beam_patterns import element_directivity_index_db
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.motion.rotating_head import HeadTrajectory, RotatingHead, stepped_voyage, turned_voyage
from mitsonar.sonar.motion.trajectory import Voyage
from mitsonar.sonar.pulses.pulses import Pulse
from mitsonar.units import db_from_power, power_from_db

from .. import limits
from ..energy import energy
from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..pressure.pressure import PressureRecord
from ..pressure.signals import LEAD, received_signals
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed
from .signals import StepSignals
from .steps import Steps

SIGNALS, ELEMENT_SIGNALS = 0.3, 0.98           # share of the work before the truth: by beams, and by elements


class SectorScanSensor(Sensor, Protocol):
    """Sensor of a rotating head."""

    source_level_db: float  # [dB re 1 µPa @ 1 m]: on the axis of the beam
    pulse: Pulse
    beam_widths: tuple[float, float]  # [rad]: full one-way -3 dB widths, in the plane that the beam turns in and across
    vertical_floor: float  # mean power of diffuse side lobes across, of the face, relative to its axis
    head: RotatingHead
    self_noise_db: float | None  # [dB re 1 µPa²/Hz]: of the receiver
    picture: str | None  # "beams", "elements" or None: by beams where that is possible


def plan(scene: mi.Scene, sensor: SectorScanSensor, settings: RunSettings) -> ArraySurvey:
    """Plan a run for a picture; its record begins a pulse early, see `plan_elements`."""
    return plan_elements(scene, sensor, settings, LEAD)


def plan_elements(scene: mi.Scene, sensor: SectorScanSensor, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
    """Plan a run over a scene."""
    geometry = Geometry(scene)
    shortest = sensor.film().window(slowest_speed(sensor))[0][1]
    passage = sensor.route.lay(geometry, shortest)
    interval = 1 / sensor.route.ping_rate if sensor.route.ping_rate else shortest
    turned = turned_voyage(passage.voyage, sensor.head, interval)
    passage = replace(passage, voyage=turned, platform=passage.voyage, of_ping=partial(
        stepped_voyage, planned=turned, head=sensor.head, interval=interval))
    speed = head_speed(sensor, passage.depth)
    face = _face(sensor, speed)
    return survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=speed, transmit=face, receive=face,
                     pulse=sensor.pulse, source_level_db=sensor.source_level_db, bins_are_samples=False,
                     whole_bins=True, self_noise_db=sensor.self_noise_db)


def picture(survey: ArraySurvey, sensor: SectorScanSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the head's pings, with its truth; see `mitsonar.render`."""
    steps, signals, way = steps_of(survey, sensor), StepSignals(survey), _way(survey, sensor)
    before = SIGNALS if way == "beams" else ELEMENT_SIGNALS
    whole = shares(progress, survey.track.pings)
    progress_before = counted(part_of(whole, 0.0, before))
    if way == "elements":
        received = received_signals(PressureRecord(survey, seed=seed), range(survey.track.pings),
                                    progress=progress_before, say=say)
        power = _received_power(received, survey, steps)
    else:
        power = signals.power(steps.bins.count, seed, progress_before)
    record = only_row(energy.record(survey, steps, seed, counted(part_of(whole, before, 1.0))))
    expected = steps.shown(record.intensity.astype(float))
    if record.coherent is not None:
        expected = expected + signals.power(steps.bins.count, None)
    image = imaging.image(power, record, expected, turns=_turns(sensor, 0, survey.planned),
                          depth_below=survey.depth_below, **_shared(survey, sensor, seed))
    return objects.annotated(image, *classes_of(survey.labels), survey.world.still, survey.track.position)


def frame(survey: ArraySurvey, sensor: SectorScanSensor, seed: int) -> Callable[[int], xr.Dataset]:
    """Return the function that renders one ping of a sonar that is stepped; see `mitsonar.Sonar`."""
    steps, signals, way = steps_of(survey, sensor), StepSignals(survey), _way(survey, sensor)
    blocks, pressure = energy.energy_blocks(survey, steps, seed), PressureRecord(survey, seed=seed)
    known = objects.known(*classes_of(survey.labels), survey.world.still, survey.planned.track.position)
    shared = _shared(survey, sensor, seed)

    def of(ping: int) -> xr.Dataset:
        if way == "elements":
            power = _received_power(received_signals(pressure, [ping]), survey, steps)
        else:
            power = signals.of(ping, steps.bins.count, seed)[None]
        record = only_row(gathered([blocks.at(ping).echoes(np.array([ping]))], pings=1, rows=1))
        expected = steps.shown(record.intensity.astype(float))
        if record.coherent is not None:
            expected = expected + signals.of(ping, steps.bins.count, None)
        image = imaging.image(power, record, expected, turns=_turns(sensor, ping, survey.voyage.single),
                              depth_below=survey.depth_below[-1:], first=ping, **shared).assign_attrs(known)
        return image.assign_attrs(unseen=objects.unseen(image, warn=False))

    return of


def _way(survey: ArraySurvey, sensor: SectorScanSensor) -> str:
    """Return the method by which the picture is made: beams or elements."""
    way = sensor.picture or ("beams" if survey.ensonification == "scatterers" else "elements")
    if way == "beams" and survey.ensonification != "scatterers":
        raise ValueError("picture is beams, but rays are to find the scatterers (ensonification); leave one of them "
                         "out, or set picture to elements")
    return way


def _received_power(received: xr.DataArray, survey: ArraySurvey, steps: Steps) -> np.ndarray:
    """Return the mean power (P, bins) [µPa²] of the element's signals."""
    compressed = matched_filter(received.values[:, 0, 0], survey.pulse, survey.sampling_rate)
    return imaging.mean_power(compressed, steps.bins.count)


def _shared(survey: ArraySurvey, sensor: SectorScanSensor, seed: int) -> dict[str, Any]:
    """Return what the images of all pings have in common, as arguments."""
    speed = head_speed(sensor, survey.passage.depth)
    window, bins = sensor.film().window(speed)
    return dict(
        sound_speed=speed, time=window[0] + (np.arange(bins) + 0.5) * (window[1] - window[0]) / bins,
        labels=survey.labels, class_of=classes_of(survey.labels)[1],
        attrs={"seed": int(seed), "picture": _way(survey, sensor), "frequency": float(survey.frequency),
               "pulse": survey.pulse.numbers, "source_level_db": float(survey.source_level_db),
               "noise_db": _noise_db(survey, sensor, speed),
               "absorption_db": float(survey.waters.first.absorption.at(survey.planned_depth))})


def steps_of(survey: ArraySurvey, sensor: SectorScanSensor) -> Steps:
    """Return the rows of the picture's energy record."""
    limits.check_beams(survey, 1, pings=survey.track.pings)
    return Steps(survey, *sensor.film().window(head_speed(sensor, survey.passage.depth)))


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, range) as rows of one picture, unchanged."""
    return level


def _face(sensor: SectorScanSensor, sound_speed: float) -> Array:
    """Return the element of the head, which transmits and receives."""
    length, height = (length_for_beam_width(width, sound_speed / sensor.pulse.frequency)
                      for width in sensor.beam_widths)
    return element_array([0.0, 0.0, 0.0], normal="forward", along="starboard", length=length, height=height,
                         floor=sensor.vertical_floor if height else 0.0, pattern="rectangular", baffle="hard")


def _turns(sensor: SectorScanSensor, first: int, voyage: Voyage) -> imaging.Turns:
    """Return the directions of the head at the pings of a voyage, numbered from the first on."""
    head, trajectory, time = sensor.head, voyage.trajectory, voyage.track.time
    if not isinstance(trajectory, HeadTrajectory):
        raise ValueError("a sector scan needs the voyage of a rotating head; make the survey by the sensor's own plan")
    ping = first + np.arange(len(time))
    bearing = np.angle(np.exp(1j * head.sweep.bearing(ping)))
    return imaging.Turns(bearing=np.where(bearing > np.pi - 1e-9, bearing - 2 * np.pi, bearing),
                         turn=head.sweep.turn(ping), platform=trajectory.platform.track(time), mount=head.mount,
                         tilt=head.tilt, sector=head.sweep.sector)


def _noise_db(survey: ArraySurvey, sensor: SectorScanSensor, sound_speed: float) -> float | None:
    """Return the noise behind the matched filter [dB re 1 µPa], None without noise."""
    if survey.noise is None:
        return None
    spectra = [] if sensor.self_noise_db is None else [sensor.self_noise_db]
    if sensor.noise:
        wavelength = sound_speed / survey.frequency
        spectra.append(sensor.noise_level_db() - element_directivity_index_db(survey.receive, wavelength))
    bandwidth = compression(survey.pulse, survey.sampling_rate)[1]
    return float(db_from_power(bandwidth * sum(power_from_db(spectrum) for spectrum in spectra)))
