"""Hold the tracers and connectors of a survey's scene, made once for a run."""
from __future__ import annotations

from dataclasses import dataclass

from mitsonar.echoes.sights.sights import Sights
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater

from ..survey import Survey


@dataclass(frozen=True, kw_only=True)
class SoundPaths:
    """Hold ways of sound from a sonar and back."""

    water: DeviceWater
    tracer: Tracer  # to what rays meet first
    connector: Connector  # to given points, from the sonar and from any other
    free_rays: FreeRays  # from any point to what rays meet there
    sights: Sights  # to given points, straight and by way of a flat surface

    @classmethod
    def of(cls, survey: Survey, farthest: float, frequency: float | None = None) -> SoundPaths:
        """Return the ways of a survey out to a range [m]; without a frequency [Hz], none by way of the bed."""
        tracer = Tracer(survey.geometry, survey.water, max_range=farthest)
        connector = Connector(survey.geometry, survey.water)
        return cls(water=survey.water, tracer=tracer, connector=connector, free_rays=FreeRays(tracer),
                   sights=Sights(connector, max_depth=survey.max_depth, frequency=frequency))
