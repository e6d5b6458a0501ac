"""The motion of a swath's platform as its sensors have it: what is true, and what they say."""
from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...device.chance import sonar_seed
from ...hydrography.attitude import Motion
from ...hydrography.errors import disturbed
from ...sonar.trajectory import Trajectory
from .survey import SoundedSurvey

__all__ = ["RATE", "said_motion", "true_motion"]

RATE = 100.0                       # [Hz] of the sensors
MARGIN = 0.1                       # [s] before the first transmission and after the last reception


def true_motion(survey: SoundedSurvey, *, earlier: float = 0.0) -> Motion:
    """Sample the reference point's way and attitude; attitude and depth of `earlier` [s] before."""
    trajectory = _reference(survey.voyage.trajectory)
    last = max(run.survey.track.time[-1] + run.survey.time[-1] for run in survey.transmissions)
    first = survey.track.time[0] - MARGIN
    time = first + np.arange(int(np.ceil((last + MARGIN - first) * RATE)) + 1) / RATE
    position, _ = trajectory.pose(time)
    before, attitude = trajectory.pose(time - earlier)
    return Motion(time=time, x=position[:, 0], y=position[:, 1], depth=-before[:, 2], roll=attitude[:, 0],
                  pitch=attitude[:, 1], heading=np.unwrap(attitude[:, 2]))


def said_motion(survey: SoundedSurvey, seed: int) -> Motion:
    """Give the same as the motion sensors say it."""
    errors = survey.motion_errors
    true = true_motion(survey, earlier=errors.latency)
    added = errors.added(true.time, sonar_seed(seed, "motion sensors"))
    return disturbed(true, latency=0.0, **added)


def _reference(trajectory: Trajectory) -> Trajectory:
    """The way of the reference point, where the track leads."""
    return replace(trajectory, offset=np.zeros(3))
