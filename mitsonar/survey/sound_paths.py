"""What finds the ways of sound through a survey's scene, made once for a run."""
from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi

from ..echoes.sights import Sights
from ..tracing.connection import Connector
from ..tracing.free_rays import FreeRays
from ..tracing.tracer import Tracer
from ..water.absorption_table import Absorption
from .survey import Survey

__all__ = ["SoundPaths"]


@dataclass(frozen=True, kw_only=True)
class SoundPaths:
    """Ways of sound from a sonar and back.

    Attributes
    ----------
    tracer : Tracer
        To what rays meet first.
    connector : Connector
        To given points.
    free_rays : FreeRays
        From any point to any other.
    loss_db : Absorption
        Two-way absorption along a way [dB].
    folded_db : Absorption or None
        The same in water unfolded about a flat surface; None where nothing mirrors.
    sights : Sights
        To given points, straight and by way of a flat surface.
    """

    tracer: Tracer
    connector: Connector
    free_rays: FreeRays
    loss_db: Absorption
    folded_db: Absorption | None
    sights: Sights

    @classmethod
    def of(cls, survey: Survey, farthest: float) -> SoundPaths:
        """The ways of a survey out to a range [m]."""
        geometry, absorption, profile = survey.geometry, survey.absorption, survey.profile
        tracer = Tracer(geometry, profile, max_range=farthest)
        deepest = max(geometry.depth_range[1], -float(survey.track.position[:, 2].min()))
        connector, free_rays = Connector(tracer), FreeRays(tracer)
        loss_db, folded_db = Absorption(absorption, profile, deepest, mi.Float), None
        if geometry.surface_mirrors:
            folded_db = Absorption(absorption.mirrored(), profile.mirrored(), deepest, mi.Float, top=-deepest)
        return cls(tracer=tracer, connector=connector, free_rays=free_rays, loss_db=loss_db, folded_db=folded_db,
                   sights=Sights(connector, free_rays, loss_db, folded_db, max_depth=survey.max_depth))
