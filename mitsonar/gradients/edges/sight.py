"""Compute launch and arrival directions of bent rays to points, and the weight of lines there.

    cos θ = cos θ_0 c / c_0                     Snell: the view at a point
    w = ℓ b                                     of a piece of a line: its length across the view [rad], and beam
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import hashed, row_keys, seeded, uniform
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.survey.energy.rows import Rows
from mitsonar.survey.motion.places import Place

FAINT = 1e-3                       # of the strongest beam: what directions outside are drawn by


class EdgeSight:
    """Compute views and weights of points from pings, up to a reach [m]."""

    def __init__(self, tracer: Tracer, rows: Rows, reach: float):
        self._rows, self._water = rows, tracer.water
        self._connector = Connector(tracer.geometry, tracer.water)
        self._reach = dr.opaque(mi.Float, reach)

    def ray(self, place: Place, ping: mi.UInt32, point: mi.Vector3f) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Return approximate launch and arrival directions of the bent rays to points."""
        lib = arrays_of(mi.Float)
        wide, origin, source = lib.Array3f64(point), place.origin(ping), place.source(ping)
        launch = self._connector.launch_direction(place.sources, origin, source, wide)
        _, speed, _ = place.sources.state.gather(lib, source)
        level = dr.sqrt(dr.maximum(1 - dr.square(launch.z), 0))
        cosine = dr.minimum(level * mi.Float(self._water.layers().at(-wide.z)[0] / speed), 1)
        scale = cosine / dr.maximum(level, 1e-6)
        upwards = dr.copysign(dr.sqrt(1 - cosine * cosine), mi.Float(wide.z - origin.z))
        return launch, mi.Vector3f(launch.x * scale, launch.y * scale, upwards)

    def weight(self, place: Place, ping: mi.UInt32, middle: mi.Vector3f, along: mi.Vector3f,
               jump: mi.Float | None = None) -> mi.Float:
        """Return w of pieces with ends `along`, times the share of energy that jumps there."""
        distance = dr.maximum(dr.norm(middle - mi.Vector3f(place.origin(ping))), 1e-6)
        launch, view = self.ray(place, ping, middle)
        length = dr.norm(dr.cross(along, view)) / distance
        rays = self._rows.aimed(place, ping, launch, mi.Float(1))
        response = self._rows.response(place, rays, launch)
        beam = dr.select(response.active, response.pattern, 0)
        near = (distance < self._reach) & dr.isfinite(length) & dr.isfinite(beam)
        weight = dr.select(near, length if jump is None else length * jump, 0)
        return weight * (beam + FAINT * dr.max(beam))


def drawn_pieces(weights: np.ndarray, count: int, number: int, seed: int,
                 salt: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw `count` points, stratified through the sums of weights (n,) that are not all 0, for a ping number."""
    sums = np.cumsum(weights)
    lib = arrays_of(mi.Float)
    key = seeded(upload(mi.UInt32, row_keys(np.array([number], np.uint64))), seed, salt)
    chance = uniform(lib, hashed(lib, key, dr.arange(mi.UInt32, count))).numpy().astype(float)
    wanted = (np.arange(count) + chance) / count * sums[-1]
    piece = np.minimum(np.searchsorted(sums, wanted, side="right"), len(sums) - 1)
    within = np.clip((wanted - sums[piece]) / weights[piece] + 1, 0, 1)
    return piece, within, sums[-1] / (count * weights[piece])
