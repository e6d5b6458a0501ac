"""Tracers and connectors of a survey's scene, made once for a run."""
from __future__ import annotations

from dataclasses import dataclass

from mitsonar.echoes.sights.sights import Sights
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater

from ..survey import Survey


@dataclass(frozen=True, kw_only=True)
class SoundPaths:
    """Tracers and connectors of sound between a sonar and the scene."""

    geometry: Geometry
    water: DeviceWater
    tracer: Tracer  # from the sonar to the first hits of rays
    connector: Connector  # between given points, one of which may be the sonar
    free_rays: FreeRays  # from any point to the first hits of rays
    sights: Sights  # to given points, straight and by way of a flat surface

    @classmethod
    def of(cls, survey: Survey, farthest: float, frequency: float | None = None) -> SoundPaths:
        """Return the paths of a survey with the same surroundings at all pings, out to a range [m].

        Paths by way of the bed need a frequency [Hz].
        """
        geometry, water = survey.surroundings
        tracer, connector = Tracer(geometry, water, max_range=farthest), Connector(geometry, water)
        return cls(geometry=geometry, water=water, tracer=tracer, connector=connector, free_rays=FreeRays(tracer),
                   sights=Sights(connector, max_depth=survey.max_depth, frequency=frequency))
