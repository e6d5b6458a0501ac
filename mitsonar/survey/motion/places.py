"""Positions, attitudes and receptions of a block of pings, looked up on the device."""
from __future__ import annotations

import copy
from collections.abc import Callable
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import row_keys
from mitsonar.device.types import DrJitArray, UInt32, Vector
from mitsonar.scene.tracing.tracer import Sources, Tracer
from mitsonar.water.profile import SoundSpeedProfile

from ..survey import Survey
from .underway import PingReception, Underway


class PingPoses:
    """Positions and attitudes of a block of pings at the transmission, looked up by their numbers in the block."""

    def __init__(self, position: np.ndarray, rotation: np.ndarray):
        # position (B, 3) [m]; rotation (B, 3, 3)
        self._lib = arrays_of(mi.Float)
        self._position = upload(mi.Float64, np.concatenate([position, np.zeros((len(position), 1))], 1))
        rotation = np.concatenate([rotation, np.zeros((len(position), 3, 1))], 2)
        self._rotation = upload(mi.Float, rotation.astype(np.float32))
        dr.eval(self._position, self._rotation)

    def origin(self, ping: mi.UInt32) -> dr.ArrayBase:
        """Return the position of the sonar, Array3f64 [m]."""
        row = dr.gather(self._lib.Array4f64, self._position, ping)
        return self._lib.Array3f64(row[0], row[1], row[2])

    def body(self, ping: mi.UInt32, direction: Vector) -> mi.Vector3f:
        """Return body directions of scene directions."""
        rows = [dr.gather(self._lib.Array4f, self._rotation, 3 * ping + i) for i in range(3)]
        return mi.Vector3f(*(sum(row[k] * part for row, part in zip(rows, direction)) for k in range(3)))

    def scene(self, ping: mi.UInt32, body: mi.Vector3f) -> mi.Vector3f:
        """Return scene directions of body directions."""
        x, y, z = (dr.gather(self._lib.Array4f, self._rotation, 3 * ping + i) for i in range(3))
        return mi.Vector3f(*(r[0] * body.x + r[1] * body.y + r[2] * body.z for r in (x, y, z)))

    def axis(self, ping: mi.UInt32) -> mi.Vector3f:
        """Return the body's forward axis, scene coordinates."""
        return mi.Vector3f(*(dr.gather(self._lib.Array4f, self._rotation, 3 * ping + i)[0] for i in range(3)))


class Places:
    """Source of the places of blocks of pings."""

    def __init__(self, survey: Survey, tracer: Tracer, underway: Underway, per_ping: int):
        self._survey, self._tracer, self._underway, self._per_ping = survey, tracer, underway, per_ping

    def of(self, ping: np.ndarray) -> Place:
        """Return the place of pings, given by their numbers (B,)."""
        position = self._survey.track.position[ping]
        rotation = self._survey.track.rotation(ping)
        depths, source = np.unique(-position[:, 2], return_inverse=True)
        return Place(ping=ping, per_ping=self._per_ping, position=position, rotation=rotation,
                     source=source.astype(np.uint32), sources=self._tracer.sources(depths),
                     profile=self._tracer.water.profile, depth_below=self._survey.depth_below[ping],
                     underway=self._underway, others=self.of)


class Place(PingPoses):
    """Place of a block of pings, looked up by their numbers within the block.

    `others` returns the place of pings outside of the block.
    """

    def __init__(self, *, ping: np.ndarray, per_ping: int, position: np.ndarray, rotation: np.ndarray,
                 source: np.ndarray, sources: Sources, profile: SoundSpeedProfile, depth_below: np.ndarray,
                 underway: Underway, others: Callable[[np.ndarray], Place]):
        # ping (B,); position (B, 3) [m]; rotation (B, 3, 3); source (B,); depth_below (B,) [m]
        self.ping, self.rows, self.sources, self.profile = ping, per_ping * len(ping), sources, profile
        self.position, self.rotation, self.source_of = position, rotation, source
        self.depth_below_of, self.motion = np.asarray(depth_below, float), underway.motion(ping)
        self.still, self._underway, self._others = self.motion is None, underway, others
        super().__init__(position, rotation)
        # a random key for every row, by its number in the survey
        number = ping.astype(np.uint64)[:, None] * np.uint64(per_ping) + np.arange(per_ping, dtype=np.uint64)
        self._key = upload(mi.UInt32, row_keys(number.ravel()))
        self._source = upload(mi.UInt32, source)
        self._below = upload(mi.Float, self.depth_below_of.astype(np.float32))
        dr.eval(self._key, self._source, self._below)

    def of(self, ping: np.ndarray) -> Place:
        """Return the place of pings of the survey; pings within this block share its ray fans."""
        here = np.searchsorted(self.ping, ping)
        if not np.isin(ping, self.ping).all():
            return self._others(ping)
        return Place(ping=ping, per_ping=self.rows // len(self.ping), position=self.position[here],
                     rotation=self.rotation[here], source=self.source_of[here], sources=self.sources,
                     profile=self.profile, depth_below=self.depth_below_of[here], underway=self._underway,
                     others=self._others)

    def attached(self, position: mi.Float64 | None, rotation: mi.Float | None, sources: Sources) -> Place:
        """Return the place with positions (4 B,) and rotations (12 B,) that carry gradients, and a source per ping."""
        moved = copy.copy(self)
        moved.sources, moved._source = sources, dr.arange(mi.UInt32, len(self.ping))
        if position is not None:
            moved._position = dr.replace_grad(self._position, position)
        if rotation is not None:
            moved._rotation = dr.replace_grad(self._rotation, rotation)
        return moved

    def key(self, row: DrJitArray) -> mi.UInt32:
        """Return the random keys of rows."""
        return dr.gather(mi.UInt32, self._key, row)

    def source(self, ping: mi.UInt32) -> mi.UInt32:
        """Return the indices of pings in `sources`."""
        return dr.gather(mi.UInt32, self._source, ping)

    def depth_below(self, ping: mi.UInt32) -> mi.Float:
        """Return the depth of the seabed below the sonar [m]."""
        return dr.gather(mi.Float, self._below, ping)

    def medium(self, ping: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """Return the depth [m] and the sound speed [m/s] at the sonar."""
        depth, speed, _ = self.sources.state.gather(self._lib, cast(UInt32, self.source(ping)))
        return mi.Float(depth), mi.Float(speed)

    def receive(self, ping: mi.UInt32, towards: Vector, offset: dr.ArrayBase, delay: mi.Float64) -> PingReception:
        """Return the reception of echoes from points `offset` [m] away.

        `delay` [s] and `towards` are two-way time and direction of the return leg of a sonar that stands still.
        """
        if self.motion is None:
            return PingReception(delay=delay, towards=towards)
        return self.motion.receive(ping, towards, mi.Float(dr.norm(offset)), delay, self.medium(ping)[1])
