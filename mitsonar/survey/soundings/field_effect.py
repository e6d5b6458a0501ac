"""Effect of a field of the water on soundings: times and angles without the field, and their differences.

The field adds F to the time of each leg, and turns the waves at an array by its change with the array's place, ∇F
(`propagation.returns.frozen_ray`). Along an axis a, the slowness a·q of the ray in layered water is that measured plus
a·∇F. Reduced in layered water, soundings are then where they were, but for second order; what the field costs the
soundings as measured counts as an error by refraction.
"""
from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.reduction import Installation, Located, Measured
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, frozen_ray
from mitsonar.water.fields import SoundSpeedField
from mitsonar.water.profile import SoundSpeedProfile

NEAREST = 1e-6                     # [m] of horizontal range, for a heading


def without_field(measured: Measured, places: Located, profile: SoundSpeedProfile, field: SoundSpeedField,
                  motion: PlatformMotion, installation: Installation) -> Measured:
    """Return a measurement (B,) as it was without the field; `places` are its soundings, reduced in the profile."""
    some = np.flatnonzero(places.found & np.isfinite(measured.travel_time))
    part, time = measured[some], measured.travel_time.copy()
    angles = {}
    for name, share, arm, axis in (("transmit_angle", 0.0, installation.transmit_offset, installation.transmit_axis),
                                   ("angle", 1.0, installation.receive_offset, installation.receive_axis)):
        pose = motion.at(part.transmit_time + share * part.travel_time)
        start = pose.carried(np.asarray(arm))
        away = np.stack([places.x[some], places.y[some]], -1) - start[:, :2]
        across = np.maximum(np.hypot(*away.T), NEAREST)
        ray = eigenray(profile, start[:, 2], places.depth[some], across)
        added = frozen_ray(FrozenLeg((start[:, 0], start[:, 1], start[:, 2]),
                                     (away[:, 0] / across, away[:, 1] / across), across, places.depth[some],
                                     ray.arc_length, ray.ray_parameter, np.sin(ray.launch_angle)),
                           field, partial(_speed, profile))
        time[some] -= np.nan_to_num(added.later)
        turned = np.nan_to_num(np.sum(pose.turned(axis) * np.stack(added.slope, -1), -1))
        angles[name] = getattr(measured, name).copy()
        angles[name][some] = np.arcsin(np.clip(np.sin(getattr(part, name)) + part.head_sound_speed * turned, -1, 1))
    return replace(measured, travel_time=time, **angles)


def _speed(profile: SoundSpeedProfile, depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sound speed [m/s] and its gradient [1/s] at depths."""
    return profile.at(depth), profile.gradient(depth)
