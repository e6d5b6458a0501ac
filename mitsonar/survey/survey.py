"""Data of any run of a sonar over a scene, and the parts of a run that share their surroundings.

Pings that share a water and a geometry share their surroundings, and with them everything that is made once and used
for many pings: tracers, tables of eigenrays, scatterers. `Survey.within` is the survey of one ping's surroundings, in
which all pings share them; `PerSurroundings` makes things of it. What all pings share whatever their water, such as
windows, sampling and units, is planned with the extremes of `Survey.waters`, or at `Survey.planned_speed`.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, NamedTuple, TypeAlias, TypeVar

import numpy as np

from mitsonar.echoes.paths import Paths
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.scene.world import World
from mitsonar.sonar.motion.stepping import Stepping
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.motion.trajectory import Voyage
from mitsonar.water.waters import WaterColumn, Waters

from .voyage import Passage


class Surroundings(NamedTuple):
    """Geometry and water of a ping, as rays need them."""

    geometry: Geometry
    water: DeviceWater


SurveyOf = TypeVar("SurveyOf", bound="Survey")
_Made = TypeVar("_Made")
_Part = TypeVar("_Part", int, np.ndarray)
# computes the parts of a record: yields work(part) of every part, in order, here or in other processes
RunParts: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[Any]]


@dataclass(frozen=True, kw_only=True)
class Survey:
    """Scene, its water, and pings along a track."""

    world: World
    waters: Waters  # at the sonar's frequency
    passage: Passage  # pings and their track
    rays: int  # per ping
    max_depth: int = 1  # largest number of bounces of an echo
    run_parts: RunParts = map  # here, unless a command shares them among processes

    @property
    def voyage(self) -> Voyage:
        """Return the pings' track, and the trajectory it lies on; of a sonar that is stepped, its latest ping's."""
        return self.passage.now

    @property
    def planned(self) -> Voyage:
        """Return the planned voyage, for what is made for all pings, whenever it is made."""
        return self.passage.voyage

    @property
    def depth_below(self) -> np.ndarray:
        """Return the depth of the seabed below the sonar (P,) [m]."""
        return self.passage.below

    @cached_property
    def planned_depth(self) -> float:
        """Return the mean depth of the sonar on the planned track [m], for what all pings share."""
        return float(np.mean(-self.planned.track.position[:, 2]))

    @cached_property
    def planned_rates(self) -> tuple[float, float]:
        """Return the greatest speed [m/s] and turn rate [rad/s] at the planned transmissions."""
        speed, turn = (float(np.linalg.norm(rate, axis=1).max())
                       for rate in (self.planned.velocity, self.planned.turn_rate))
        return speed, turn

    @property
    def turn_rate(self) -> float:
        """Return the greatest turn rate [rad/s] at the planned transmissions and at the latest stepped ping."""
        latest, planned = self.passage.latest, self.planned_rates[1]
        if latest is None or latest.row is not None:
            return planned
        # a head turns on its platform
        return max(planned, latest.turn_rate + (0.0 if self.passage.platform is None else planned))

    def stepped(self: SurveyOf, stepping: Stepping) -> SurveyOf:
        """Return the survey of a sonar that is stepped, with this one as its plan."""
        return replace(self, passage=replace(self.passage, stepping=stepping), world=self.world.stepped(stepping))

    def each_part(self, work: Callable[[_Part], _Made], parts: Sequence[_Part],
                  progress: Callable[[int, int], None] | None) -> Iterator[_Made]:
        """Yield ``work(part)`` of each part of a record, which is a ping or consecutive pings (P,)."""
        made = self.run_parts(work, parts)
        for part in parts:
            yield next(made)
            if progress is not None:
                progress(int(np.max(part)) + 1, self.track.pings)
        if self.world.moves:
            self.world.at(int(np.max(parts[-1])))      # as after work that is done here

    @property
    def track(self) -> Track:
        """Return the pings' track."""
        return self.voyage.track

    @cached_property
    def surroundings_number(self) -> np.ndarray:
        """Return the numbers (P,) of the pings' surroundings; pings with one number share them."""
        ping = np.arange(self.planned.track.pings)
        pairs = np.stack([self.waters.number(ping), self.world.number(ping)])
        return np.unique(pairs, axis=1, return_inverse=True)[1].reshape(-1)

    def surroundings_of(self, ping: int) -> int:
        """Return the number of a ping's surroundings; a stepped ping has those of its own time and place."""
        latest = self.passage.latest
        if latest is None or (latest.row is not None and self.changes):
            return int(self.surroundings_number[ping if latest is None else latest.row or 0])
        return self.waters.of_step(latest).number

    def water_at(self, ping: int) -> WaterColumn:
        """Return the water of a ping; of a sonar that is stepped, its latest ping's."""
        latest = self.passage.latest
        return self.waters.at(ping) if latest is None else self.waters.of_step(latest).column

    @property
    def changes(self) -> bool:
        """Return True if pings have different surroundings."""
        return bool(self.surroundings_number.any())

    def within(self: SurveyOf, ping: int) -> SurveyOf:
        """Return the survey in which all pings have the surroundings of one; the same survey if they have them."""
        stepped = self.passage.latest is not None and self.waters.elsewhere is not None
        if not (self.changes or stepped):
            return self
        number = self.surroundings_of(ping)
        if number not in self._part:
            self._part.clear()
            self._part[number] = self._made_within(ping)
        return self._part[number]

    def _made_within(self: SurveyOf, ping: int) -> SurveyOf:
        """Return a new survey in which all pings have the surroundings of one."""
        if self.passage.latest is None:
            return replace(self, waters=self.waters.within(ping), world=self.world.within(ping))
        return replace(self, waters=Waters.constant(self.water_at(ping)))

    @cached_property
    def _part(self) -> dict:
        """Return the latest part of `within` by its number, so that all who ask share its tables."""
        return {}

    def stretches(self) -> list[np.ndarray]:
        """Return the numbers of the pings, in parts in which consecutive pings share their surroundings."""
        changes = np.flatnonzero(np.diff(self.surroundings_number)) + 1
        if self.world.moves:
            changes = np.arange(1, self.planned.track.pings)
        return np.split(np.arange(self.planned.track.pings), changes)

    @cached_property
    def surroundings(self) -> Surroundings:
        """Return the surroundings that all pings share; raise `ValueError` if they differ: see `within`."""
        return Surroundings(geometry=self.world.only, water=self.device_water())

    def device_water(self, below: float = 0.0) -> DeviceWater:
        """Return the water of all pings on the device, with tables that end `below` [m] under the lowest bed."""
        column = self.waters.only
        if column.field is not None and (self.max_depth > 1 or column.volume is not None
                                         or self.world.surface_mirrors):
            raise ValueError("the water has a field, which paths of several bounces, mirrored paths and echoes of the "
                             "water itself do not see yet; write max_depth 1, leave out volume_strength_db and layers, "
                             "and give the sea surface a rough material")
        deepest = max(self.world.depth_range[1], -float(self.planned.track.position[:, 2].min())) + below
        return DeviceWater(column.profile, column.absorption, column.volume, deepest=deepest, field=column.field,
                           level=column.level)

    def refuse_field(self, what: str) -> None:
        """Raise `ValueError` if the water has a field, which `what` do not see."""
        if any(column.field is not None for column in self.waters.columns):
            raise ValueError(f"the water has a field, which {what} do not see yet; write field none")

    @cached_property
    def paths(self) -> Paths:
        """Return the paths with sums of their own."""
        return Paths(self.max_depth, surface=self.world.surface_label > 0, volume=self.waters.scatter)

    @property
    def labels(self) -> dict[int, str]:
        """Return the names of labels by number: the scene's shapes."""
        return self.world.labels

    def sound_speed(self, ping: int) -> float:
        """Return the sound speed at the sonar [m/s]."""
        return float(self.water_at(ping).profile.at(-self.track.position[ping, 2]))

    @property
    def sound_speeds(self) -> np.ndarray:
        """Return the sound speeds at the sonar at all planned pings, (P,) [m/s]."""
        depth = -self.planned.track.position[:, 2]
        return np.concatenate([self.waters.at(part[0]).profile.at(depth[part]) for part in self.stretches()])

    @property
    def planned_speed(self) -> float:
        """Return the sound speed at the sonar at the first planned ping [m/s], for what all pings share."""
        return self.waters.sound_speed(0, -self.planned.track.position[0, 2])


class PerSurroundings(Generic[SurveyOf, _Made]):
    """Make something of the survey within the surroundings of a ping; the latest is kept, since pings come in order."""

    def __init__(self, survey: SurveyOf, make: Callable[[SurveyOf], _Made]):
        self._survey, self._make = survey, make
        self._latest: tuple[int, _Made] | None = None

    def at(self, ping: int) -> _Made:
        """Return what is made for the surroundings of a ping, in which moving objects stand as at that ping."""
        number = self._survey.surroundings_of(ping)
        if self._survey.world.moves:
            self._survey.world.at(ping)
        if self._latest is None or self._latest[0] != number:
            self._latest = number, self._make(self._survey.within(ping))
        return self._latest[1]
