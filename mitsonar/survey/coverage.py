"""Warnings about a window of range that does not fit the bed: too short to reach it, or longer than it.

Either record is empty where bed is expected, and looks like a result. The warning comes before rendering.
"""
from __future__ import annotations

import warnings
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.imaging import fan
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.tracer import registry_index

from . import placement
from .sensor import Sensor, slowest_speed
from .survey import Survey

PINGS = 8                          # that are looked at, from the first to the last
PROBES = 512                       # directions all around in which anything within the range is looked for
STEPS = 64                         # along a look, in which the bed's edge is found
SLACK = 0.97                       # of the reach that the bed must cover
TWO_SIDED = "sidescan", "interferometric", "multibeam"
STEEP = np.radians(45)             # below the horizon: a fan that looks down ends at its outermost beams


def warn_of_window(survey: Survey, sensor: Sensor) -> None:
    """Warn where a record ends above the seabed, and where it reaches beyond the seabed's edge."""
    speed = slowest_speed(sensor)
    farthest = 0.5 * speed * sensor.film().window(speed)[0][1]
    short = survey.depth_below >= farthest
    if short.any():
        _warn_of_short(survey, farthest, np.flatnonzero(short))
    if (survey.depth_below < farthest).any():
        _warn_of_edge(survey, sensor, farthest)


def _warn_of_short(survey: Survey, farthest: float, pings: np.ndarray) -> None:
    """Warn that these pings are over before the seabed answers, unless something else does."""
    some = _some(pings)
    places, below = survey.track.position[some], survey.depth_below
    number = np.arange(PROBES) + 0.5
    height, around = 1 - 2 * number / PROBES, np.pi * (1 + np.sqrt(5)) * number
    probes = np.stack([*(np.sqrt(1 - height ** 2) * trig(around) for trig in (np.cos, np.sin)), height], -1)
    points = [np.asarray(target.position) for target in survey.geometry.targets()]
    near = any(np.linalg.norm(places - point, axis=1).min() < farthest for point in points)
    if near or _hit(survey.geometry, np.repeat(places, PROBES, 0), np.tile(probes, (len(places), 1)), farthest).any():
        return
    which = "of every ping" if len(pings) == len(below) else f"of {len(pings)} of {len(below)} pings"
    warnings.warn(f"the range of {farthest:g} m ends above the seabed, which lies {below[pings].min():.3g} m or more "
                  f"below the sonar: the record {which} holds no echo of it. Make the film's range longer, or the "
                  "altitude lower", stacklevel=3)


def _warn_of_edge(survey: Survey, sensor: Sensor, farthest: float) -> None:
    """Warn that the bed ends before the range does, where the sonar looks."""
    track, below = survey.track, survey.depth_below
    some = _some(np.flatnonzero(below < farthest))
    looks, down = _looks(survey, sensor)
    ahead = np.einsum("pij,aj->pai", track.rotation()[some], looks)
    ahead = ahead[..., :2] / np.maximum(np.linalg.norm(ahead[..., :2], axis=-1, keepdims=True), 1e-9)   # (pings, looks)
    reach = np.sqrt(farthest ** 2 - below[some] ** 2)[:, None] * np.ones(len(looks))
    reach = np.minimum(reach, below[some][:, None] / np.tan(np.maximum(down, 1e-6)))
    share = SLACK * np.linspace(0, 1, STEPS)[1:]
    here = track.position[some, None, None, :2] + (share * reach[..., None])[..., None] * ahead[:, :, None]
    bare = np.isnan(placement.soundings(survey.geometry, here[..., 0], here[..., 1]))
    edge = np.where(bare[..., -1], np.argmax(bare, -1), STEPS) / (STEPS - 1)                # shares of the reach
    # what stands at the edge, such as a quay, hides that nothing lies behind
    drop = np.broadcast_to(-below[some][:, None, None], reach[..., None].shape)
    out = np.concatenate([ahead * reach[..., None], drop], -1)
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    start = np.broadcast_to(track.position[some, None], out.shape)
    blocked = _hit(survey.geometry, start.reshape(-1, 3), (out / length).reshape(-1, 3), farthest).reshape(edge.shape)
    edge = np.median(np.where(blocked, 1.0, edge), 0)
    # a line along the edge of a survey has bed on one side, which is as it should be
    look = int(np.argmax(edge) if sensor.kind in TWO_SIDED else np.argmin(edge))
    if edge[look] < 1:
        bearing, there = np.degrees(np.arctan2(looks[look, 1], looks[look, 0])), float(np.median(reach[:, look]))
        side = "to either side of" if sensor.kind in TWO_SIDED else f"at a bearing of {bearing:.0f} degrees from"
        warnings.warn(f"the seabed ends about {edge[look] * there:.3g} m {side} the sonar, and the range of "
                      f"{farthest:g} m reaches {round(there, 1):g} m over the bed: the record is empty beyond, "
                      "which is no shadow. Make the bed wider, or the film's range shorter", stacklevel=3)


def _looks(survey: Survey, sensor: Any) -> tuple[np.ndarray, np.ndarray]:
    """Directions that a sonar looks into, (A, 3), body frame, and how far below the horizon each ends, (A,) [rad]."""
    sides = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    if sensor.kind == "multibeam":
        widest = max(float(np.abs(sector.beams).max()) for sector in sensor.sectors)
        return sides, np.full(2, max(np.pi / 2 - widest, 0.0))
    if sensor.kind in TWO_SIDED:
        return sides, np.zeros(2)
    if sensor.kind == "sector_scan":                     # whose track has the beam's attitude
        return np.array([[1.0, 0.0, 0.0]]), np.zeros(1)
    looks = sensor.receive.normal[:1]
    if sensor.kind != "synthetic_aperture":
        looks = fan.fan_directions(sensor.receive, 3, sensor.fan_width)[1]
    down = np.arcsin(np.clip(looks[:, 2], -1, 1))
    # a face that looks ahead sees the bed out to the horizon, one that looks down as far as its fan is wide
    return looks, np.where(np.median(down) > STEEP, down, 0.0)


def _hit(geometry: Geometry, origin: np.ndarray, direction: np.ndarray, farthest: float) -> np.ndarray:
    """Return which straight rays (R, 3) meet anything but the sea surface within a distance [m]."""
    points, ways = ((upload(mi.Float, column.astype(np.float32)) for column in np.asarray(rows, float).T)
                    for rows in (origin, direction))
    ray: Any = mi.Ray3f(mi.Point3f(*points), mi.Vector3f(*ways))
    ray.maxt = dr.opaque(mi.Float, float(farthest))
    found = geometry.scene.ray_intersect_preliminary(ray, coherent=mi.Bool(False))
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(found), found.is_valid())
    return (found.is_valid() & (label != geometry.surface_label)).numpy()


def _some(pings: np.ndarray) -> np.ndarray:
    """Choose a few of some pings, from the first to the last."""
    return pings[np.unique(np.linspace(0, len(pings) - 1, PINGS).astype(int))]
