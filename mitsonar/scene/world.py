"""Scene of a survey: its geometry at every ping, and what holds for all pings.

Nothing but this module knows which pings share a geometry. Echoes ask for the geometry of their ping; labels, extents,
origins and the bed below a track are the same for all pings and are asked of the world.
"""
from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.sonar.motion.stepping import Stepping
from mitsonar.sonar.motion.track import Track
from mitsonar.water.waters import Waters

from .geometry import Geometry
from .labels import ShapeLabels
from .moving import Movements
from .shadows.bed_cover import bed_height


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """Scene of a survey's pings: one geometry for all of them."""

    still: Geometry  # the bed, the surface and all objects; moving ones stand as at the ping that `at` was asked for
    seed: int = 0  # of the scatterers of all surfaces, the same for all pings, passes and kinds of sonar
    movements: Movements | None = None  # of the moving objects; None: nothing moves

    @classmethod
    def of(cls, geometry: Geometry, seed: int, track: Track, waters: Waters) -> World:
        """Return the scene of the pings of a track; raise `ValueError` if an object cannot move as it should."""
        if not geometry.moves:
            return cls(still=geometry, seed=seed)
        movements = Movements(shapes=tuple(body.part for body in geometry.bodies), track=track, waters=waters,
                              sea=geometry.sea)
        movements.check()
        least, greatest = movements.depth_range()
        geometry.widen((min(least, 0.0), greatest))           # a sonar that is stepped may move objects anywhere
        geometry.stand(movements.at(0))
        _check_above(geometry, movements)
        return cls(still=geometry, seed=seed, movements=movements)

    @property
    def moves(self) -> bool:
        """Return True if anything in the scene moves."""
        return self.movements is not None

    @property
    def geometries(self) -> list[Geometry]:
        """Return the different geometries."""
        return [self.still]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return the numbers of the geometries of pings, of any shape."""
        return np.zeros(np.shape(ping), int)

    def at(self, ping: int) -> Geometry:
        """Return the geometry of a ping, in which moving objects stand as its sound meets them."""
        geometry = self.geometries[int(self.number(ping))]
        if self.movements is not None:
            moment = self.movements, self.movements.key(int(ping))
            if geometry.moment != moment:
                geometry.stand(self.movements.at(ping))
                if self.movements.stepping is not None:
                    _check_drift(geometry, self.movements.stepping.moved)
                geometry.moment = moment
        return geometry

    def stepped(self, stepping: Stepping) -> World:
        """Return the scene of a sonar that is stepped."""
        return self if self.movements is None else replace(self, movements=replace(self.movements, stepping=stepping))

    def check_move(self, name: str, position: np.ndarray) -> None:
        """Raise `ValueError` unless an object of a name moves, and can stand at a position (3,) [m]."""
        names = [] if self.movements is None else list(dict.fromkeys(shape.id() for shape in self.movements.shapes))
        if name not in names:
            raise ValueError(f'"{name}" was to be moved, and the scene has '
                             + (f"the moving shapes {', '.join(names)}" if names else "no moving shapes")
                             + '; give one of them, or put <shape type="moving"> around the shape in the scene')
        x, y, z = position
        bed = float(bed_height(self.still, np.array([x]), np.array([y]))[0])
        if np.isnan(bed):
            raise ValueError(f'"{name}" was to be moved to x = {x:.4g} m, y = {y:.4g} m, beyond the bed; give a '
                             "place over it")
        if not bed <= z <= 0:
            raise ValueError(f'"{name}" was to be moved to z = {z:.4g} m, and the water there lies between z = '
                             f"{bed:.4g} m and 0; give a place within it")

    def fastest(self, ping: int) -> float:
        """Return the largest speed of any point that moves, at a ping [m/s]; 0 if nothing moves."""
        if self.movements is None:
            return 0.0
        geometry = self.at(ping)
        return max((stand.fastest(body.part.rest) for body, stand in zip(geometry.movers, geometry.stands)),
                   default=0.0)

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
        geometry = Geometry(self.still.loaded, smooth_beds=True)
        return replace(self, still=geometry)

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


def _check_above(geometry: Geometry, movements: Movements) -> None:
    """Raise `ValueError` if an object lies under the bed at any ping, as its sound leaves."""
    for shape in movements.shapes:
        if shape.first:                    # further parts of an object
            continue
        place = shape.shape.mover.pose(movements.time(shape))[0]
        bed = bed_height(geometry, place[:, 0], place[:, 1])
        if (under := np.flatnonzero(place[:, 2] < bed)).size:
            ping, z = int(under[0]), place[under[0], 2]
            when = f"is at z = {z:.4g} m at ping {ping}" if ping else f"starts at z = {z:.4g} m"
            raise ValueError(f'the moving shape "{shape.id()}" {when}, under the bed, which lies at z = '
                             f"{bed[ping]:.4g} m there; let it swim higher or elsewhere")


def _check_drift(geometry: Geometry, moved: Collection[str]) -> None:
    """Raise `ValueError` if an object of these names, which goes on from where it was moved to, is under the bed."""
    for body, stand in zip(geometry.bodies, geometry.body_stands):
        if body.part.id() in moved and not body.part.first:
            x, y, z = stand.position
            bed = float(bed_height(geometry, np.array([x]), np.array([y]))[0])
            if z < bed:
                raise ValueError(f'"{body.part.id()}" goes on from where it was moved to, and is at z = {z:.4g} m now, '
                                 f"under the bed, which lies at z = {bed:.4g} m there; move it again before this ping")
