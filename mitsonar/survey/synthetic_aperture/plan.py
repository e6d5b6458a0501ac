"""Plan of a synthetic aperture's run: arrays, transmitter of every ping, and depth of the bed."""
from __future__ import annotations

import warnings
from dataclasses import dataclass, fields
from typing import Protocol

import mitsuba as mi
import numpy as np

from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.pulses.pulses import Pulse

from .. import placement
from ..pressure.array_survey import ArraySurvey
from ..pressure.planning import survey_of
from ..sensor import RunSettings, Sensor, head_speed, slowest_speed


@dataclass(frozen=True, kw_only=True)
class StripSurvey(ArraySurvey):
    """Survey of a synthetic aperture."""

    bank: np.ndarray  # (E,), number of the row of each receiver
    look: np.ndarray  # (3,) [-], unit vector along which the elements look, body frame
    bed_depth: float  # [m], mean depth of the bed within the record
    grid: str  # of the image: "ground" or "slant"
    grid_spacing: float | None  # [m], between its points
    aperture_window: str  # window over the aperture's angles
    range_window: str  # window over the pulse's band
    preset: str


ALONG, ACROSS = 9, 17              # number of depths of the bed that are averaged, along and across the track


class StripSensor(Sensor, Protocol):
    """Sensor of a synthetic aperture; fields without a comment are those of `StripSurvey`."""

    preset: str
    source_level_db: float  # [dB re 1 µPa @ 1 m], of one transmitter
    pulse: Pulse
    transmit: Array
    receive: Array
    bank: np.ndarray
    grid: str
    grid_spacing: float | None
    windows: tuple[str, str]  # over the aperture's angles and the pulse's band
    self_noise_db: float | None  # [dB re 1 µPa²/Hz]
    thin_below: float


def plan(scene: mi.Scene, sensor: StripSensor, settings: RunSettings, lead: float) -> StripSurvey:
    """Plan a run over a scene; the record begins `lead` pulse lengths early."""
    geometry = Geometry(scene)
    passage = sensor.route.lay(geometry, sensor.film().window(slowest_speed(sensor))[0][1] + sensor.pulse.duration)
    track = passage.voyage.track
    speed = head_speed(sensor, passage.depth)
    survey = survey_of(geometry, sensor, settings, passage, lead=lead, sound_speed=speed, transmit=sensor.transmit,
                       receive=sensor.receive, pulse=sensor.pulse, source_level_db=sensor.source_level_db,
                       bins_are_samples=True, self_noise_db=sensor.self_noise_db)
    # echoes from the end of the range are recorded to their end: pulse compression needs the whole pulse
    longer = survey.samples + int(np.ceil(sensor.pulse.duration * survey.sampling_rate))
    _warn_of_gaps(survey, sensor)
    senders = sensor.transmit.elements
    return StripSurvey(
        **{**{field.name: getattr(survey, field.name) for field in fields(ArraySurvey)},
           "samples": longer, "sending": np.arange(track.pings) % senders, "thin_below": sensor.thin_below,
           "cell_size": settings.cell_size or _cell_size(sensor, settings, speed)},
        bank=sensor.bank, look=sensor.receive.normal[0], bed_depth=_bed_depth(survey, sensor), grid=sensor.grid,
        grid_spacing=sensor.grid_spacing, aperture_window=sensor.windows[0], range_window=sensor.windows[1],
        preset=sensor.preset)


def _cell_size(sensor: StripSensor, settings: RunSettings, sound_speed: float) -> float:
    """Return the side [m] of cells of which a resolution cell, half an element by c / 2B, holds the requested number.

    A cell is half a square whose diagonal is its longest side.
    """
    along = 0.5 * max(sensor.transmit.length, sensor.receive.length)
    across = 0.5 * sound_speed / sensor.pulse.bandwidth
    return 2 * float(np.sqrt(along * across / settings.scatterers_per_cell))


def _bed_depth(survey: ArraySurvey, sensor: StripSensor) -> float:
    """Return the mean depth of the bed within the record [m], at places where straight rays meet a level bed."""
    track, below = survey.track, float(np.mean(survey.depth_below))
    speed = survey.planned_speed
    nearest, farthest = (0.5 * speed * survey.time[i] for i in (survey.lead, -1))
    reach = np.sqrt(np.maximum(np.linspace(max(nearest, 0.0), farthest, ACROSS) ** 2 - below ** 2, 0.0))
    pings = np.unique(np.linspace(0, track.pings - 1, ALONG).astype(int))
    rotation, looks = track.rotation()[pings], sensor.receive.normal[0]
    aside = (rotation @ looks)[:, :2]
    aside = aside / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-9)
    place = track.position[pings, None, :2] + reach[:, None] * aside[:, None, :]
    depth = placement.soundings(survey.world.still, place[..., 0].ravel(), place[..., 1].ravel())
    if np.isnan(depth).all():
        raise ValueError("The synthetic aperture sees no seabed within its record. Change side or heading_deg, or the "
                         "film's range_min and range.")
    return float(np.nanmean(depth))


def _warn_of_gaps(survey: ArraySurvey, sensor: StripSensor) -> None:
    """Warn if pings are too far apart to fill the aperture."""
    track = survey.track
    if track.pings < 2:
        return
    place = sensor.receive.position[sensor.bank == 0, 0]
    length = float(np.diff(np.sort(place)).min()) if len(place) > 1 else sensor.receive.length
    filled = 0.5 * len(place) * length
    step = float(np.linalg.norm(np.diff(track.position, axis=0), axis=1).max())
    if step > filled * 1.001:
        warnings.warn(f"Pings are {step:.3g} m apart, but each fills only {filled:.3g} m of the aperture: the image "
                      "will have ghosts along the track. Sail slower, ping faster, or set overlap.", stacklevel=2)
