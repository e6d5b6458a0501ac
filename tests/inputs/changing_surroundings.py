"""Surveys whose water, or whose geometry, changes from one ping to the next."""
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.scene.geometry import Geometry
from mitsonar.scene.world import World
from mitsonar.water.volume import VolumeScattering
from mitsonar.water.waters import Waters

STRONG = VolumeScattering([0.0], [-40.0])


def two_waters(column, other, change, pings):
    """Return one column before the ping `change`, another from it on."""
    return Waters(columns=[column, other], numbers=(np.arange(pings) >= change).astype(int))


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoWorlds(World):
    """One geometry before the ping `change`, another from it on."""

    other: Geometry
    change: int

    @property
    def geometries(self) -> list[Geometry]:
        """Return both geometries."""
        return [self.still, self.other]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return 0 before the change, 1 from it on."""
        return np.asarray(np.asarray(ping) >= self.change, int)


def in_waters(survey, profile, change):
    """Return a planned survey whose water has another profile, and scatters more, from the ping `change` on."""
    def changed(waters, pings):
        other = replace(waters.only, profile=profile, volume=waters.only.volume and STRONG)
        return two_waters(waters.only, other, change, pings) if change else Waters.constant(other)

    return with_all(survey, lambda part: replace(part, waters=changed(part.waters, part.track.pings)))


def in_worlds(survey, other, change):
    """Return a planned survey whose shapes are those of another geometry from the ping `change` on."""
    world = TwoWorlds(still=survey.world.only, other=other, change=change) if change else World(still=other)
    return with_all(survey, lambda part: replace(part, world=world))


def with_all(survey, changed):
    """Return a changed survey; a survey of a swath has surveys of its own, which change with it."""
    if hasattr(survey, "sectors"):
        survey = replace(survey, sectors=[replace(run, survey=changed(run.survey)) for run in survey.sectors])
    if hasattr(survey, "sides"):
        survey = replace(survey, sides=tuple(changed(side) for side in survey.sides))
    return changed(survey)
