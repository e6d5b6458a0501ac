"""Synthetic aperture: a strip of raw echoes, and the image focused from them.

    plan       arrays, distance between pings, depth of the bed                         `plan`
    raw        echoes of every receiver, ping by ping, with the true trajectory         `image`
    image      focused on a grid, with its truth                                        `image`
"""
from __future__ import annotations

from collections.abc import Callable

import mitsuba as mi
import numpy as np
import xarray as xr

from ..pressure.signals import LEAD
from ..sensor import RunSettings
from .image import strip_image
from .plan import StripSensor, StripSurvey, plan as plan_strip


def plan(scene: mi.Scene, sensor: StripSensor, settings: RunSettings) -> StripSurvey:
    """Plan a run over a scene whose record begins a pulse early; see `plan.plan`."""
    return plan_strip(scene, sensor, settings, LEAD)


def plan_elements(scene: mi.Scene, sensor: StripSensor, settings: RunSettings, lead: float = 0.0) -> StripSurvey:
    """Plan a run that records the signals of elements; the record begins `lead` pulses early."""
    return plan_strip(scene, sensor, settings, lead)


def picture(survey: StripSurvey, sensor: StripSensor, seed: int,
            progress: Callable[[float, float], None] | None = None,
            say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Return the focused image with its truth; see `mitsonar.render`."""
    survey.world.still.refuse_bodies("a focused image has truth for")
    return strip_image(survey, seed, progress, say)


def rows(level: np.ndarray) -> np.ndarray:
    """Return levels (bank, along track, across track) as rows of one image, bank after bank."""
    return level.reshape(-1, level.shape[-1])
