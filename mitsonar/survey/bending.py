"""A warning where the field of the water bends rays more than the frozen ray is good for."""
import warnings
from functools import partial

import numpy as np

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, frozen_ray
from mitsonar.water.profile import SoundSpeedProfile

from .coverage import few
from .sensor import Sensor, slowest_speed
from .survey import Survey

BEARINGS, RANGES = 16, 8           # of the legs that are tried at each of a few pings


def warn_of_bending(survey: Survey, sensor: Sensor) -> None:
    """Warn if the field of the water bends rays to the bed by more than `Water.field_bending`."""
    if all(column.field is None for column in survey.waters.columns):
        return
    speed = slowest_speed(sensor)
    farthest, worst = 0.5 * speed * sensor.film().window(speed)[0][1], (0.0, 0.0)
    for ping in few(np.arange(survey.track.pings)):
        x, y, z = survey.track.position[ping]
        column, bed = survey.waters.at(ping), -z + survey.depth_below[ping]
        profile, field = column.profile, column.field
        if field is None:
            continue
        reach = np.sqrt(max(farthest**2 - survey.depth_below[ping]**2, 1.0))
        away, bearing = (part.ravel() for part in np.meshgrid(
            reach * np.linspace(0, 1, RANGES + 1)[1:], 2 * np.pi * np.arange(BEARINGS) / BEARINGS))
        ray = eigenray(profile, -z, bed, away)
        here = np.ones(away.size)
        leg = FrozenLeg((x * here, y * here, -z * here), (np.sin(bearing), np.cos(bearing)), away, bed * here,
                        ray.arc_length, ray.ray_parameter, np.sin(ray.launch_angle))
        bending = frozen_ray(leg, field, partial(_speed, profile)).bending
        most = int(np.argmax(np.nan_to_num(bending)))
        worst = max(worst, (float(np.nan_to_num(bending)[most]), float(away[most])))
    if worst[0] > sensor.water.field_bending:
        warnings.warn(f"the field of the water bends rays to the bed at {worst[1]:.0f} m so that they arrive "
                      f"{1e9 * worst[0]:.0f} ns earlier, more than field_bending_ns, "
                      f"{1e9 * sensor.water.field_bending:g}: times there may be off by half of it. Shorten the "
                      "film's range, or raise field_bending_ns", stacklevel=3)


def _speed(profile: SoundSpeedProfile, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sound speed [m/s] and its gradient [1/s] at depths."""
    return profile.at(depth), profile.gradient(depth)
