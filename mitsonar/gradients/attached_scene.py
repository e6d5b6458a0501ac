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

    def scenery(self, field: EnergyField) -> Scenery:
        """Give the scene as it is now, without gradients."""
        with dr.suspend_grad():
            geometry = Geometry(self._survey.geometry.scene, smooth_beds=True)
            return field.at(replace(self._survey, geometry=geometry))

    def attached(self, scenery: Scenery) -> Scenery:
        """Give the same scenery with gradients of its own: those of a product are used up by it."""
        return scenery.again()
