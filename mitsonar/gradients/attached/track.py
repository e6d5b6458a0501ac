"""Attach place and attitude of the sonar to offsets from its track, ping by ping.

    o = o_0 + Δo,    R = R(heading + Δψ, pitch + Δθ, roll + Δφ)

Δo -> ``position_offset`` [m], scene coordinates, and (Δψ, Δθ, Δφ) -> ``attitude_offset`` [rad]: an offset holds while
the echoes of its ping are under way. Rays are fixed in the sonar's frame, so they turn with it: d = R R_0ᵀ d_0.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.rotations import rotation_slopes
from mitsonar.device.types import ArrayTypes, Float64, Record, UInt32
from mitsonar.propagation.device_rays.layer_table import LayerTable
from mitsonar.scene.tracing.tracer import Sources
from mitsonar.sonar.motion.track import Track
from mitsonar.survey.energy.rows import Rays
from mitsonar.survey.motion.places import Place

from .ray_shift import tangent


@dataclass(frozen=True, kw_only=True)
class Offsets:
    """Hold offsets from a track; None without gradients."""

    position: mi.Float64 | None
    attitude: mi.Float64 | None
    rows: int


class PingStates(Record):
    """Hold the medium at the sonar, a row a ping: depth, sound speed and moments, Float64 (B,)."""

    depth: Float64
    speed: Float64
    moments: list[Float64]

    def gather(self, lib: ArrayTypes, index: UInt32) -> tuple[Float64, Float64, list[Float64]]:
        """Return depth, sound speed and moments at the sources of rays, as `SourceState` does."""
        return (dr.gather(lib.Float64, self.depth, index), dr.gather(lib.Float64, self.speed, index),
                [dr.gather(lib.Float64, moment, index) for moment in self.moments])


class AttachedTrack:
    """Compute places of pings with gradients."""

    def __init__(self, drawn: Track, track: Track, offsets: Offsets, layers: LayerTable):
        self._offsets, self._layers = offsets, layers
        start, now = drawn.rotation(), track.rotation()
        self._rotation, self._relative = now, np.einsum("pij,pkj->pik", now, start)
        self._start = start
        self._turns = offsets.attitude is not None or not np.array_equal(now, start)
        self._slopes = rotation_slopes(track.roll, track.pitch, track.heading)                        # (3, P, 3, 3)

    def place(self, place: Place) -> Place:
        """Return the same place with gradients."""
        count = len(place.ping)
        position = self._position(place)
        z = -dr.gather(mi.Float64, upload(mi.Float64, np.ascontiguousarray(place.position[:, 2])),
                       dr.arange(mi.UInt32, count))
        if position is not None:
            z = z - dr.gather(mi.Float64, tangent(position), 4 * dr.arange(mi.UInt32, count) + 2)
        speed, moments = self._layers.at(z)
        state: Any = PingStates(depth=z, speed=speed, moments=moments)
        sources = Sources(ray_fans=place.sources.ray_fans, state=state)
        return place.attached(position, self._rotations(place, self._rotation, self._slopes, 4), sources)

    def _position(self, place: Place) -> mi.Float64 | None:
        """Return offsets of a block's pings as increments, four wide."""
        if self._offsets.position is None:
            return None
        index = dr.arange(mi.UInt32, 4 * len(place.ping))
        ping = dr.gather(mi.UInt32, self._row_of(place), index // 4)
        axis = index % 4
        return dr.gather(mi.Float64, self._offsets.position, 3 * ping + axis, axis < 3)

    def _row_of(self, place: Place) -> mi.UInt32:
        """Return the row of the offsets of a block's pings."""
        rows = place.ping if self._offsets.rows > 1 else np.zeros_like(place.ping)
        return upload(mi.UInt32, rows.astype(np.uint32))

    def _rotations(self, place: Place, rotation: np.ndarray, slopes: np.ndarray, wide: int) -> mi.Float | None:
        """Return rotations of a block's pings, (B, 3, wide), with gradients by the slopes."""
        if self._offsets.attitude is None:
            return None
        ping = place.ping
        values = np.zeros((len(ping), 3, wide), np.float32)
        values[..., :3] = rotation[ping]
        total = upload(mi.Float, values)
        index = dr.arange(mi.UInt32, values.size)
        number = dr.gather(mi.UInt32, self._row_of(place), index // (3 * wide))
        for k in range(3):
            values[..., :3] = slopes[k, ping]
            angle = dr.gather(mi.Float64, self._offsets.attitude, 3 * number + k)
            total = total + upload(mi.Float, values) * mi.Float(tangent(angle))
        return total

    def turned(self, place: Place, rays: Rays) -> Rays:
        """Return rays turned with the sonar."""
        if not self._turns:
            return rays
        lib = arrays_of(mi.Float)
        slopes = np.einsum("kpij,pmj->kpim", self._slopes, self._start)
        table = self._rotations(place, self._relative, slopes, 4)
        if table is None:
            values = np.zeros((len(place.ping), 3, 4), np.float32)
            values[..., :3] = self._relative[place.ping]
            table = upload(mi.Float, values)
        rows = [dr.gather(lib.Array4f, table, 3 * rays.ping + i) for i in range(3)]
        d = rays.direction
        turned = mi.Vector3f(*(row[0] * d.x + row[1] * d.y + row[2] * d.z for row in rows))
        return replace(rays, direction=dr.normalize(turned))

    def drawn(self, place: Place, rays: Rays) -> Rays:
        """Return detached rays as they were drawn: the inverse of `turned`."""
        if not self._turns:
            return rays
        lib = arrays_of(mi.Float)
        values = np.zeros((len(place.ping), 3, 4), np.float32)
        values[..., :3] = self._relative[place.ping].transpose(0, 2, 1)
        table = upload(mi.Float, values)
        rows = [dr.gather(lib.Array4f, table, 3 * rays.ping + i) for i in range(3)]
        d = rays.direction
        return replace(rays, direction=dr.normalize(
            mi.Vector3f(*(row[0] * d.x + row[1] * d.y + row[2] * d.z for row in rows))))
