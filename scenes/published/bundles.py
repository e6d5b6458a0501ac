"""Bundles of rays over a scene that comes with mitsonar, each ray with what it brings back.

    i = σ(θ) / (sin θ A)        returned intensity per steradian of the ray, over that 1 m from the source [1/m²]

σ scattering strength of the bed, θ grazing angle, A spreading area on the way out; spreading on the way back is that of
the way out and is the other half of the sonar equation: i / A of a ray is what a receiver of unit pressure hears.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from mitsonar.survey.pressure.array_survey import ArraySurvey

__all__ = ["Bundle", "send", "shipped_survey"]


@dataclass(frozen=True, kw_only=True)
class Bundle:
    """Rays that have met the scene; NaN where a ray met nothing.

    Attributes
    ----------
    point : (R, 3) [m]
        Of the hit, scene frame.
    travel_time : (R,) [s]
        One way.
    intensity : (R,) [1/(m⁴ sr)]
        Echo per solid angle of the ray at the place it was sent from, over the intensity 1 m from the source.
    """

    point: np.ndarray
    travel_time: np.ndarray
    intensity: np.ndarray


def shipped_survey(name: str, **parameters: object) -> ArraySurvey:
    """Plan the run of a scene that comes with mitsonar, with values for its ``$parameters``."""
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.images import opened

    scene, sensor, integrator = opened(load_file(name, **parameters))
    return integrator.array_survey(scene, sensor)


def send(survey: ArraySurvey, offset: npt.ArrayLike, launch_angle: np.ndarray) -> Bundle:
    """Send rays to starboard, in vertical planes athwart the track, at the first ping.

    They start at `offset` (R, 3) [m] in the body frame, at `launch_angle` (R,) [rad] below the horizontal.
    """
    import drjit as dr
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of, upload
    from mitsonar.scene.materials import scattering_strength
    from mitsonar.scene.tracing.tracer import Tracer

    lib = arrays_of(mi.Float)
    rotation = survey.track.rotation()[0]
    origin = survey.track.position[0] + np.asarray(offset, float) @ rotation.T
    direction = np.stack([np.zeros_like(launch_angle), np.cos(launch_angle), np.sin(launch_angle)], -1) @ rotation.T
    reach = 0.55 * survey.time[-1] * float(np.max(survey.waters.only.profile.sound_speed))
    tracer = Tracer(*survey.surroundings, max_range=reach)
    depth, source = np.unique(-origin[:, 2], return_inverse=True)
    start = lib.Array3f64(*(upload(lib.Float64, column) for column in origin.T))
    hits = tracer.trace(tracer.sources(depth), start, upload(mi.UInt32, source.astype(np.uint32)),
                        mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in direction.T)))
    strength, sin_grazing = scattering_strength(hits, hits.valid, survey.frequency)
    intensity = strength / (dr.maximum(sin_grazing, 1e-6) * hits.spreading_area)
    met = hits.valid.numpy()
    return Bundle(point=np.where(met[:, None], hits.point.numpy().T, np.nan),
                  travel_time=np.where(met, hits.travel_time.numpy(), np.nan),
                  intensity=np.where(met, intensity.numpy(), np.nan))
