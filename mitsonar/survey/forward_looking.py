"""Forward-looking sonar: an array across the bow, whose picture is a fan of beams with the bearing of each.

Its run is that of a sonar with arrays (`survey.array`). Its beams have equal steps of the bearing ψ or of sin ψ.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import xarray as xr

from ..imaging import fan
from . import array
from .array import ArraySensor, plan, plan_elements, rows
from .array_survey import ArraySurvey

__all__ = ["ForwardLookingSensor", "picture", "plan", "plan_elements", "rows"]


class ForwardLookingSensor(ArraySensor, Protocol):
    """What the sensor of a forward-looking sonar says, beside what one with arrays does.

    Attributes
    ----------
    beam_steps : str
        What grows by equal steps from beam to beam: one of `fan.STEPS`.
    """

    beam_steps: str


def picture(survey: ArraySurvey, sensor: ForwardLookingSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Render the picture of the beams, with its truth and the coordinate ``bearing`` [rad]; see `mitsonar.render`."""
    directions = fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width, sensor.beam_steps)
    image = array.picture_of(survey, directions, seed, progress, say, way=sensor.picture)
    head_depth = float(np.mean(-survey.track.position[:, 2]))
    words = {"units": "rad", "long_name": "angle from the middle of the fan, positive to starboard"}
    return image.assign_coords(bearing=("beam", image["beam"].values, words)).assign_attrs(
        sonar="forward_looking", absorption_db=float(survey.absorption.at(head_depth)))
