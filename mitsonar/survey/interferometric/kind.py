"""Interferometric sidescan: rows of receivers on both sides, whose phases give the angles of echoes.

    plan       a survey of arrays for each side                                         `plan`
    rows       their signals in the beam domain, and the truth                          `instrument`
    soundings  angles from phases, reduction                                            `instrument`, `soundings.line`
"""
from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from mitsonar.device.rotations import mounted
from mitsonar.imaging import interferometric as imaging
from mitsonar.imaging.energy_record import EnergyRecord, gathered, joined
from mitsonar.scene import objects
from mitsonar.scene.labels import classes_of

from .. import limits
from ..soundings.line import Instrument, SoundingLine
from .instrument import Interferometer, RowMeasurement, measured_rows
from .plan import InterferometricSensor, InterferometricSurvey, plan as plan, plan_elements as plan_elements

KEPT = ("depth", "x", "y", "across_track", "uncertainty")


def picture(survey: InterferometricSurvey, sensor: InterferometricSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of both sides, with its truth; see `mitsonar.render`."""
    side, pings = survey.sides[0], survey.track.pings
    limits.check_rows(side, 2 * survey.bins, pings=pings)
    instrument = Interferometer(survey, seed)
    line, measured = SoundingLine(survey, instrument, seed), []

    def of(ping: int) -> tuple[dict[str, np.ndarray], EnergyRecord]:
        (port, port_truth), (starboard, starboard_truth) = (
            side.frame(ping, seed) for side in instrument.sides(ping))
        made = measured_rows(survey, (port, starboard))
        found = line.ping(ping, made)
        columns = {"power": made.level, "phase": made.phase, "coherence": made.coherence,
                   **{name: np.where(found["valid"].values[0], found[name].values[0], np.nan) for name in KEPT},
                   "valid": found["valid"].values[0], "angle": _depression(found)}
        return ({name: made.by_side(values) for name, values in columns.items()},
                joined([port_truth, starboard_truth]))

    def records() -> Iterator[EnergyRecord]:
        for columns, truth in survey.each_part(of, range(pings), progress):
            measured.append(columns)
            yield truth

    record = gathered(records(), pings=pings, rows=2)
    classes, class_of = classes_of(survey.labels)
    image = imaging.image(
        imaging.MeasuredRows(**{name: np.stack([one[name] for one in measured]) for name in measured[0]}), record,
        track=survey.track, time=survey.time, sound_speed=side.planned_speed, depth_below=survey.depth_below,
        labels=survey.labels, class_of=class_of,
        attrs={"seed": int(seed), "preset": survey.preset, "frequency": float(side.frequency),
               "pulse": side.pulse.numbers, "source_level_db": float(side.source_level_db),
               "rows": (survey.rows.place - survey.rows.place[0]).tolist(), "tilt": float(sensor.tilt),
               "absorption_db": float(survey.waters.first.absorption.at(survey.planned_depth))})
    return objects.annotated(image, classes, class_of, survey.world.still, survey.track.position)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (ping, side, range) as rows of one picture: port mirrored, then starboard."""
    return np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)


def instrument(survey: InterferometricSurvey, seed: int, *, column: bool, snippets: int) -> Instrument[RowMeasurement]:
    """Make the instrument that measures the pings; arguments as of `mitsonar.soundings`."""
    if column or snippets:
        raise ValueError("an interferometric sidescan has no beams, whose water column or snippets could be kept; "
                         "leave that out, or render its picture")
    limits.check_rows(survey.sides[0], 2 * survey.bins, pings=1)
    return Interferometer(survey, seed)


def _depression(found: xr.Dataset) -> np.ndarray:
    """Return the angles (B,) [rad] of soundings below the horizontal, by the attitude of the motion sensors."""
    angle, forward = found["angle"].values[0], np.sin(found["transmit_angle"].values[0])
    starboard = np.sin(angle)
    down = np.sqrt(np.maximum(1 - starboard ** 2 - forward ** 2, 0))
    roll, pitch = (float(found[name].values[0]) for name in ("ping_roll", "ping_pitch"))
    level = mounted(np.stack([forward, starboard, down], -1), roll, pitch)[..., 2]
    return np.where(found["valid"].values[0], np.arcsin(np.clip(level, -1, 1)), np.nan)
