"""Forward-looking sonar: an array across the bow, and the picture of its fan of beams with the bearing of each.

The run is planned as for any sonar with arrays (`fan.kind`). Beams have equal steps of the bearing ψ or of sin ψ.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import xarray as xr

from mitsonar.imaging import fan

from ..beam_domain.fan_pictures import FanPictures
from ..pressure.array_survey import ArraySurvey
from .kind import ArraySensor, plan as plan, plan_elements as plan_elements, rows as rows


class ForwardLookingSensor(ArraySensor, Protocol):
    """Sensor of a forward-looking sonar.

    Attributes
    ----------
    beam_steps : str
        Quantity with equal steps from beam to beam: one of `fan.STEPS`.
    """

    beam_steps: str


def picture(survey: ArraySurvey, sensor: ForwardLookingSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the beams, with its truth and the coordinate ``bearing`` [rad]; see `mitsonar.render`."""
    return _with_bearings(_pictures(survey, sensor, seed).whole(progress, say), survey)


def frame(survey: ArraySurvey, sensor: ForwardLookingSensor, seed: int) -> Callable[[int], xr.Dataset]:
    """Return the function that renders the picture of one ping; see `mitsonar.frames`."""
    pictures = _pictures(survey, sensor, seed)
    return lambda ping: _with_bearings(pictures.of(ping), survey)


def _pictures(survey: ArraySurvey, sensor: ForwardLookingSensor, seed: int) -> FanPictures:
    return FanPictures(survey, directions(survey, sensor), seed=seed, way=sensor.picture)


def directions(survey: ArraySurvey, sensor: ForwardLookingSensor) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (B,) [rad] and directions (B, 3) of the picture's beams, body frame."""
    return fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width, sensor.beam_steps)


def _with_bearings(image: xr.Dataset, survey: ArraySurvey) -> xr.Dataset:
    words = {"units": "rad", "long_name": "angle from the middle of the fan, positive to starboard"}
    return image.assign_coords(bearing=("beam", image["beam"].values, words)).assign_attrs(
        sonar="forward_looking", absorption_db=float(survey.waters.first.absorption.at(survey.planned_depth)))
