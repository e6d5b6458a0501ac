"""A scene as a field sees it now: geometry, water and track, with gradients where its arrays carry them."""
from __future__ import annotations

from dataclasses import replace

import drjit as dr

from ..scene.geometry import Geometry
from ..survey.survey import Survey
from .energy_field import EnergyField, Scenery
from .pictures import Picture

__all__ = ["AttachedScene"]


class AttachedScene:
    """What a sonar's record is made of, whenever it is asked for.

    Parameters
    ----------
    picture : Picture
    survey : Survey
        At the start; sonar, bins and track are its own.
    """

    def __init__(self, picture: Picture, survey: Survey):
        self._picture, self._survey = picture, survey

    def scenery(self, field: EnergyField, *, attached: bool, like: Scenery | None = None) -> Scenery:
        """Give the scene as it is now.

        Parameters
        ----------
        field : EnergyField
        attached : bool
            Whether gradients are wanted.
        like : Scenery or None
            Of the same values: its tracer serves again.
        """
        if like is None:
            with dr.suspend_grad():
                survey = replace(self._survey, geometry=Geometry(self._survey.geometry.scene, smooth_beds=True))
                scenery = field.at(survey)
        else:
            scenery = like.again()
        return scenery
