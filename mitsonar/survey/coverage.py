"""Warnings about a range that ends above the seabed, or that reaches beyond the seabed's edge.

In both cases the record is empty where an echo of the bed is expected, and looks like a result. The warning comes
before rendering.
"""
from __future__ import annotations

import warnings

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.tracer import registry_index

from . import placement
from .sensor import Sensor, slowest_speed
from .survey import Survey

PINGS = 8                          # pings that are checked, from the first to the last
PROBES = 512                       # directions, all around, of the search for objects within the range
STEPS = 64                         # steps along a look, in which the bed's edge is found
SLACK = 0.97                       # share of the reach that the bed must cover
STEEP = np.radians(45)             # below the horizon: a fan that looks down ends at its outermost beams


def warn_of_window(survey: Survey, sensor: Sensor) -> None:
    """Warn if a record ends above the seabed, and if it reaches beyond the seabed's edge."""
    speed = slowest_speed(sensor)
    farthest = 0.5 * speed * sensor.film().window(speed)[0][1]
    short = survey.depth_below >= farthest
    if short.any():
        _warn_of_short(survey, farthest, np.flatnonzero(short))
    if (survey.depth_below < farthest).any():
        _warn_of_edge(survey, sensor, farthest)


def _warn_of_short(survey: Survey, farthest: float, pings: np.ndarray) -> None:
    """Warn that the record of these pings ends before the echo of the seabed, unless an object is within the range."""
    places, below = survey.track.position[few(pings)], survey.depth_below
    number = np.arange(PROBES) + 0.5
    height, around = 1 - 2 * number / PROBES, np.pi * (1 + np.sqrt(5)) * number
    probes = np.stack([*(np.sqrt(1 - height ** 2) * trig(around) for trig in (np.cos, np.sin)), height], -1)
    geometry = survey.world.still
    points = [np.asarray(target.position) for target in geometry.targets()]
    near = any(np.linalg.norm(places - point, axis=1).min() < farthest for point in points)
    if near or _hit(geometry, np.repeat(places, PROBES, 0), np.tile(probes, (len(places), 1)), farthest).any():
        return
    which = "of every ping" if len(pings) == len(below) else f"of {len(pings)} of {len(below)} pings"
    warnings.warn(f"the range of {farthest:g} m ends above the seabed, which lies {below[pings].min():.3g} m or more "
                  f"below the sonar: the record {which} holds no echo of it. Make the film's range longer, or the "
                  "altitude lower", stacklevel=3)


def _warn_of_edge(survey: Survey, sensor: Sensor, farthest: float) -> None:
    """Warn that the bed ends within the range, in the directions that the sonar looks into."""
    track, geometry = survey.track, survey.world.still
    pings = few(np.flatnonzero(survey.depth_below < farthest))
    position, below = track.position[pings], survey.depth_below[pings]
    looks, down = sensor.look_directions()
    if down is None:
        down = np.arcsin(np.clip(looks[:, 2], -1, 1))
        # a face that looks ahead sees the bed out to the horizon, a face that looks down as far as its beam is wide
        down = np.where(np.median(down) > STEEP, down, 0.0)
    ahead = np.einsum("pij,aj->pai", track.rotation()[pings], looks)
    ahead = ahead[..., :2] / np.maximum(np.linalg.norm(ahead[..., :2], axis=-1, keepdims=True), 1e-9)   # (pings, looks)
    reach = np.sqrt(farthest ** 2 - below ** 2)[:, None] * np.ones(len(looks))
    reach = np.minimum(reach, below[:, None] / np.tan(np.maximum(down, 1e-6)))
    share = SLACK * np.linspace(0, 1, STEPS)[1:]
    places = position[:, None, None, :2] + (share * reach[..., None])[..., None] * ahead[:, :, None]
    bare = np.isnan(placement.soundings(geometry, places[..., 0], places[..., 1]))
    edge = np.where(bare[..., -1], np.argmax(bare, -1), STEPS) / (STEPS - 1)                # shares of the reach
    # an object at the edge, such as a quay, hides the lack of bed behind it
    drop = np.broadcast_to(-below[:, None, None], reach[..., None].shape)
    out = np.concatenate([ahead * reach[..., None], drop], -1)
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    start = np.broadcast_to(position[:, None], out.shape)
    blocked = _hit(geometry, start.reshape(-1, 3), (out / length).reshape(-1, 3), farthest).reshape(edge.shape)
    edge = np.median(np.where(blocked, 1.0, edge), 0)
    # a line along the edge of a survey rightly has bed on one side only
    look = int(np.argmax(edge) if sensor.two_sided else np.argmin(edge))
    if edge[look] < 1:
        bearing, ground = np.degrees(np.arctan2(looks[look, 1], looks[look, 0])), float(np.median(reach[:, look]))
        side = "to either side of" if sensor.two_sided else f"at a bearing of {bearing:.0f} degrees from"
        warnings.warn(f"the seabed ends about {edge[look] * ground:.3g} m {side} the sonar, and the range of "
                      f"{farthest:g} m reaches {round(ground, 1):g} m over the bed: the record is empty beyond, "
                      "and this is no shadow. Make the bed wider, or the film's range shorter", stacklevel=3)


def _hit(geometry: Geometry, origin: np.ndarray, direction: np.ndarray, farthest: float) -> np.ndarray:
    """Return True for straight rays (R, 3) that hit anything but the sea surface within a distance [m]."""
    points, ways = ((upload(mi.Float, column.astype(np.float32)) for column in np.asarray(rows, float).T)
                    for rows in (origin, direction))
    ray = mi.Ray3f(mi.Point3f(*points), mi.Vector3f(*ways))
    ray.maxt = dr.opaque(mi.Float, float(farthest))
    pi = geometry.scene.ray_intersect_preliminary(ray, coherent=mi.Bool(False))
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), pi.is_valid())
    return (pi.is_valid() & (label != geometry.surface_label)).numpy()


def few(pings: np.ndarray) -> np.ndarray:
    """Return a few of the pings, from the first to the last."""
    return pings[np.unique(np.linspace(0, len(pings) - 1, PINGS).astype(int))]
