"""Scene of a survey: its geometry at every ping, and what holds for all pings.

Nothing but this module knows which pings share a geometry. Echoes ask for the geometry of their ping; labels, extents,
origins and the bed below a track are the same for all pings and are asked of the world.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Geometry
from .labels import ShapeLabels


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Scene of a survey's pings: one geometry for all of them."""

    still: Geometry  # what no ping moves: the bed, the surface, and today everything else
    seed: int = 0  # of the scatterers of all surfaces, the same for all pings, passes and kinds of sonar

    @property
    def geometries(self) -> list[Geometry]:
        """Return the different geometries."""
        return [self.still]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return the numbers of the geometries of pings, of any shape."""
        return np.zeros(np.shape(ping), int)

    def at(self, ping: int) -> Geometry:
        """Return the geometry of a ping."""
        return self.geometries[int(self.number(ping))]

    def within(self, ping: int) -> World:
        """Return the geometry of a ping as that of all pings."""
        return self if len(self.geometries) == 1 else World(still=self.at(ping), seed=self.seed)

    @property
    def only(self) -> Geometry:
        """Return the geometry that all pings share; raise `ValueError` if they differ."""
        if len(self.geometries) > 1:
            raise ValueError(f"one geometry was asked for, but the survey's pings have {len(self.geometries)}; ask for "
                             "that of a ping, or go through the survey in parts that share one")
        return self.geometries[0]

    def smoothed(self) -> World:
        """Return the world with beds that scatter by normals interpolated between their nodes."""
        return World(still=Geometry(self.still.scene, smooth_beds=True), seed=self.seed)

    @property
    def named(self) -> ShapeLabels:
        """Return the labels of the shapes."""
        return self.still.named

    @property
    def labels(self) -> dict[int, str]:
        """Return the names of labels by number."""
        return self.still.labels

    @property
    def depth_range(self) -> tuple[float, float]:
        """Return the least and the greatest depth of any shape [m]."""
        return self.still.depth_range

    @property
    def surface_label(self) -> int:
        """Return the label of the sea surface, 0 without one."""
        return self.still.surface_label

    @property
    def surface_mirrors(self) -> bool:
        """Return True if the sea surface is a flat mirror."""
        return self.still.surface_mirrors

    @property
    def local_origin(self) -> np.ndarray | None:
        """Return the place on Earth of x = y = 0, (3,) [m]; None if the scene has none."""
        return self.still.local_origin

    @property
    def crs(self) -> str | None:
        """Return the name of the coordinates that the local origin is in; None if the scene has none."""
        return self.still.crs
