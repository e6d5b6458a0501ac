"""Overview of a scene before it is rendered: bed, objects, track, and what of the bed every ping sees.

A point of the bed is seen where the earliest bent ray to it arrives within the record and leaves the sonar within the
main lobe (`EDGE_DB`), and where nothing stands in its way, which is asked of straight rays. Nothing is rendered.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.files import FilePath
from mitsonar.device.turns import one_at_a_time
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.device_rays.ray_fans import build_ray_fans
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.scene.errors import as_exception
from mitsonar.scene.geometry import Geometry
from mitsonar.sonar.motion.track import Track
from mitsonar.survey.placement import soundings
from mitsonar.survey.sensor import Sensor, head_speed
from mitsonar.survey.survey import Survey
from mitsonar.survey.views import Views, views_of
from mitsonar.water.profile import SoundSpeedProfile

from .opening import opened

SceneOrPath: TypeAlias = "mi.Scene | FilePath"
EDGE_DB = -20.0                    # two-way level, relative to the axis, down to which a beam counts
SIDE = 260                         # nodes of the bed along the longer side of the scene
CELLS, SECTION_CELLS = 96, 400     # points of the bed along a view, and along one of the section
PINGS, FANS, CONES = 160, 3, 24    # most pings whose swaths are found: of few views, of fans, of beams that look down
PATHS = 12                         # places along the path of a moving object
RAYS, FINEST, STEPS = 15, 720, 400     # rays of a view in the section, rows of the fan they are chosen from, points
MOST_POINTS = 4000                 # of an object
LIFT, LIFT_SHARE = 0.1, 0.01       # [m] and share of the way by which rays end in front of the bed
UNSEEN, SEEN, SHADOW = 0, 1, 2     # states of a point of the bed


@dataclass(frozen=True, kw_only=True)
class PlacedObject:
    """An object of the scene."""

    name: str
    points: np.ndarray  # (K, 3) [m]: of its surface, z up
    path: np.ndarray | None = None  # (P, 3) [m]: places of its middle if it moves


@dataclass(frozen=True, kw_only=True)
class Section:
    """Vertical section through the sonar at one ping, along its views."""

    ping: int
    direction: np.ndarray  # (2,): horizontal unit vector along which `along` grows
    sides: bool  # True if `along` is negative to port and positive to starboard
    along: np.ndarray  # (S,) [m]: rising
    depth: np.ndarray  # (S,) [m]: of the bed, NaN where there is none
    state: np.ndarray  # (S,): `UNSEEN`, `SEEN` or `SHADOW`
    rays: tuple[np.ndarray, ...]  # (N, 2) [m] each: along and depth
    ranges: tuple[float, float]  # [m]: slant ranges of the record


@dataclass(frozen=True, kw_only=True)
class Overview:
    """Hold the contents of a scene, and what its sonar sees of them."""

    kind: str
    frequency: float  # [Hz]
    x: np.ndarray  # (N,) [m]
    y: np.ndarray  # (M,) [m]
    depth: np.ndarray  # (M, N) [m]: of the bed, NaN where there is none
    objects: tuple[PlacedObject, ...]
    track: Track
    below: np.ndarray  # (P,) [m]: the bed below the sonar
    views: Views
    pings: np.ndarray  # (Q,): those whose swaths follow
    place: np.ndarray  # (Q, A, J, 2) [m]: points of the bed along the views
    state: np.ndarray  # (Q, A, J): `UNSEEN`, `SEEN` or `SHADOW`
    section: Section
    profile: SoundSpeedProfile  # at the middle ping


@one_at_a_time
def overview(scene: SceneOrPath, sensor: int | str = 0, ping: int | None = None,
             parameters: Mapping[str, object] | None = None) -> Overview:
    """Return the overview of a scene, with the section at a ping; None: the middle one."""
    scene, sonar, integrator = opened(scene, sensor, parameters)
    try:
        survey = integrator.survey(scene, sonar, 0)
    except RuntimeError as error:
        raise as_exception(error) from error
    pings = survey.track.pings
    ping = pings // 2 if ping is None else ping
    if not 0 <= ping < pings:
        raise ValueError(f"a section at ping {ping} is asked for, and the scene has {pings}; the first is 0.")
    views = views_of(survey, sonar)
    x, y, depth = _bed(survey.world.still)
    most = CONES if views.round else FANS if views.fan else PINGS
    chosen = np.unique(np.linspace(0, pings - 1, min(most, pings)).round().astype(int))
    sight = _BedInView(survey, sonar, views)
    place, _, state = sight.along(chosen, np.linspace(0, sight.reach, CELLS))
    return Overview(kind=sonar.kind, frequency=views.frequency, x=x, y=y, depth=depth, objects=_objects(survey, ping),
                    track=survey.track, below=survey.depth_below, views=views, pings=chosen, place=place, state=state,
                    section=sight.section(ping), profile=sight.profile)


class _BedInView:
    """Hold what a sonar sees of the bed at its pings, through the water of one ping."""

    def __init__(self, survey: Survey, sonar: Sensor, views: Views):
        self.track, self.geometry, self.views = survey.track, survey.world.still, views
        self.profile = survey.waters.at(survey.track.pings // 2).profile
        self.speed = head_speed(sonar, survey.passage.depth)
        self.window = sonar.film().window(self.speed)[0]
        self.reach = 0.5 * self.speed * self.window[1]

    def along(self, pings: np.ndarray, distance: np.ndarray,
              views: slice = slice(None)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return places (Q, A, J, 2), depths and states (Q, A, J) of the bed at horizontal distances (J,) [m]."""
        azimuth = self.views.azimuth[views]
        level = np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros(azimuth.size)], -1)
        level = np.einsum("qij,aj->qai", self.track.rotation(pings), level)
        tilt = -np.arcsin(np.clip(level[..., 2], -1, 1))[..., None]                     # depression of the view's zero
        tilt = 0.0 * tilt if self.views.stabilised else tilt
        ahead = level[..., :2] / np.maximum(np.linalg.norm(level[..., :2], axis=-1, keepdims=True), 1e-9)
        sonar = self.track.position[pings][:, None, None]                               # (Q, 1, 1, 3)
        place = sonar[..., :2] + distance[:, None] * ahead[:, :, None]
        depth = soundings(self.geometry, place[..., 0], place[..., 1])
        there = np.isfinite(depth)
        launch, time = (np.full(depth.shape, np.nan) for _ in range(2))
        source, away = (np.broadcast_to(part, depth.shape)[there] for part in (-sonar[..., 2], distance))
        ray = eigenray(self.profile, source, depth[there], away)
        launch[there], time[there] = np.where(ray.exists, ray.launch_angle, np.nan), 2 * ray.travel_time
        off = launch - tilt
        shown = np.stack([np.interp(off[:, number], self.views.depression, row, left=-np.inf, right=-np.inf)
                          for number, row in enumerate(self.views.level_db[views])], 1)
        looked = (shown > EDGE_DB) & (time >= self.window[0]) & (time <= self.window[1])
        state = np.where(looked, SEEN, UNSEEN).astype(np.uint8)
        end = np.concatenate([place, -depth[..., None]], -1)[looked]
        start = np.broadcast_to(sonar, (*depth.shape, 3))[looked]
        state[looked] = np.where(_blocked(self.geometry, start, end), SHADOW, SEEN)
        return place, depth, state

    def section(self, ping: int) -> Section:
        """Return the section at a ping: along both views of a swath, or along the middle view."""
        count = len(self.views.azimuth)
        sides = self.views.round or count == 2
        chosen = [count // 4, 3 * (count - 1) // 4] if self.views.round else [0, 1] if count == 2 else [count // 2]
        distance = np.linspace(0, self.reach, SECTION_CELLS)
        where, depths, states, rays = [], [], [], []
        one = np.array([ping])
        for number in chosen:
            sign = -1 if sides and number == chosen[0] else 1
            place, depth, state = self.along(one, distance, slice(number, number + 1))
            where.append(sign * distance[::sign])
            depths.append(depth[0, 0, ::sign])
            states.append(state[0, 0, ::sign])
            rays += [path * (sign, 1) for path in self._rays(ping, number, place[0, 0, -1])]
            away = place[0, 0, -1] - self.track.position[ping, :2]
        return Section(ping=ping, direction=away / np.linalg.norm(away), sides=sides, along=np.concatenate(where),
                       depth=np.concatenate(depths), state=np.concatenate(states), rays=tuple(rays),
                       ranges=(0.5 * self.speed * self.window[0], self.reach))

    def _rays(self, ping: int, view: int, end: np.ndarray) -> list[np.ndarray]:
        """Return rays (N, 2) of a view, distance and depth [m], to where they meet anything or the record ends.

        ``end`` (2,) [m] is a place ahead in the view.
        """
        sonar = self.track.position[ping]
        ahead = (end - sonar[:2]) / np.linalg.norm(end - sonar[:2])
        deepest = max(self.geometry.depth_range[1], 1.0 - sonar[2])
        fan = build_ray_fans(layer_table(self.profile, mi.Float), self.profile, [-sonar[2]], slab=(0.0, deepest),
                             max_range=self.reach, rows=FINEST)
        launch, size, stride = fan.middle.numpy(), fan.size.numpy(), int(fan.stride.numpy()[0])
        vertices = fan.vertex.numpy().reshape(len(launch), stride, 4)
        level = self.track.rotation(np.array([ping]))[0] @ [np.cos(self.views.azimuth[view]),
                                                            np.sin(self.views.azimuth[view]), 0.0]
        off = launch + (0.0 if self.views.stabilised else np.arcsin(np.clip(level[2], -1, 1)))
        shown = np.interp(off, self.views.depression, self.views.level_db[view], left=-np.inf, right=-np.inf)
        within = np.flatnonzero((shown > EDGE_DB) & (size > 1))
        chosen = within[np.unique(np.linspace(0, max(len(within) - 1, 0), min(RAYS, len(within))).astype(int))]
        return [self._ended(vertices[row, :size[row], :2], sonar, ahead) for row in chosen]

    def _ended(self, path: np.ndarray, sonar: np.ndarray, ahead: np.ndarray) -> np.ndarray:
        """Return a ray (N, 2) up to the first point behind a surface, above the water or beyond the record [m]."""
        length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
        at = np.linspace(0, length[-1], STEPS)
        away, depth = (np.interp(at, length, column) for column in path.T)
        points = np.column_stack([sonar[:2] + away[:, None] * ahead, -depth])
        gone = (depth < 0) | (np.hypot(away, depth + sonar[2]) > self.reach)
        gone[1:] |= _blocked(self.geometry, points[:-1], points[1:], lift=0.0, share=0.0)
        end = int(np.argmax(gone)) if gone.any() else len(at)
        return np.stack([away, depth], -1)[:end + 1]


def _blocked(geometry: Geometry, start: np.ndarray, end: np.ndarray, *, lift: float = LIFT,
             share: float = LIFT_SHARE) -> np.ndarray:
    """Return True where something lies between points (R, 3) [m], but for the last part of the way."""
    if not len(start):
        return np.zeros(0, bool)
    way = end - start
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
    origin, direction = ((upload(mi.Float, column.astype(np.float32)) for column in rows.T)
                         for rows in (start, way / length[:, None]))
    ray = mi.Ray3f(mi.Point3f(*origin), mi.Vector3f(*direction))
    ray.maxt = upload(mi.Float, np.maximum(length * (1 - share) - lift, 0).astype(np.float32))
    return np.asarray(geometry.scene.ray_test(ray).numpy(), bool)


def _bed(geometry: Geometry) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a grid of the bed over all of the scene: x (N,), y (M,) and depth (M, N) [m]."""
    low, high = (np.array(corner) for corner in geometry.horizontal_bounds)
    step = max(float((high - low).max()), 1e-3) / SIDE
    x, y = (a + step * (np.arange(max(1, int(np.ceil((b - a) / step)))) + 0.5) for a, b in zip(low, high))
    return x, y, soundings(geometry, *np.meshgrid(x, y))


def _objects(survey: Survey, ping: int) -> tuple[PlacedObject, ...]:
    """Return the objects of the scene, where moving ones stand at a ping."""
    world = survey.world
    paths: dict[int, list[np.ndarray]] = {}
    if world.moves:
        for number in np.unique(np.linspace(0, survey.track.pings - 1, PATHS).round().astype(int)):
            for body, _, low, high in world.at(int(number)).body_boxes():
                paths.setdefault(body.label, []).append(0.5 * (low + high))
    geometry = world.at(ping)
    points: dict[int, list[np.ndarray]] = {}
    faces, vertices = geometry.faces.numpy().reshape(-1, 4), geometry.vertices.numpy().reshape(-1, 4)[:, :3]
    order = np.argsort(faces[:, 3], kind="stable")
    labels, first = np.unique(faces[order, 3], return_index=True)
    for label, rows in zip(labels, np.split(order, first[1:])):
        if label in geometry.named.objects:
            used = np.unique(faces[rows, :3])
            points.setdefault(int(label), []).append(vertices[used[::max(1, len(used) // MOST_POINTS)]])
    for _, shape in geometry.others:
        box = shape.bbox()
        points.setdefault(geometry.named.of(shape), []).append(
            np.stack(np.meshgrid(*zip(np.array(box.min), np.array(box.max))), -1).reshape(-1, 3))
    for target in geometry.targets():
        points[target.label] = [np.asarray(target.position, float)[None]]
    return tuple(PlacedObject(name=geometry.labels[label], points=np.concatenate(parts).astype(float),
                              path=np.array(paths[label]) if label in paths else None)
                 for label, parts in sorted(points.items()) if label in geometry.named.objects)
