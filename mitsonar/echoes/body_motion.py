"""Doppler and delay of echoes from moving bodies, which stand where the sound of a ping meets them (`scene.moving`).

    η_t = (c - v·d) / (c + v·b)                 rate of time of the echo, per unit of the sound's (`signal.doppler`)
    Δτ = (1/η_t - 1) (T - t1)                   change of the delay of a point that sound reaches at T, not at t1

v -> velocity of the point, u + ω × (p - P); d -> direction of the sound that arrives at the point, b -> that of sound
that would arrive from the receiver; c -> sound speed there. Sound that leaves a transmitter later by δ comes back later
by δ / η_t, which is the second line with δ = T - t1: exact for a point that keeps its velocity, but for the change of
directions meanwhile, (v δ)² / R c.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scene.geometry import Geometry


class BodyMotion:
    """Motion of a scene's labels, or of parts of a gait, at the ping that its objects stand as at; of still ones 0."""

    def __init__(self, geometry: Geometry):
        self._geometry, self._lib = geometry, arrays_of(mi.Float)
        self._rates, self._stands = mi.Float(), mi.Float64()           # rows of u and ω; of P and t1
        geometry.follow(self._moved)

    @classmethod
    def of(cls, geometry: Geometry) -> BodyMotion | None:
        """Return the motion of a scene; None if nothing moves there."""
        return cls(geometry) if geometry.bodies else None

    def _moved(self) -> None:
        """Take the motion of the objects as they stand."""
        labels = max([len(self._geometry.named), *(body.number for body in self._geometry.bodies)]) + 1
        rates, stands = np.zeros((labels, 8), np.float32), np.zeros((labels, 4))
        for body, stand in zip(self._geometry.bodies, self._geometry.stands):
            rates[body.number] = *stand.velocity, 0, *stand.turn_rate, 0
            stands[body.number] = *stand.position, stand.met
        self._rates, self._stands = upload(mi.Float, rates), upload(mi.Float64, stands)

    def shift(self, label: mi.UInt32, point: dr.ArrayBase, out: mi.Vector3f, back: mi.Vector3f,
              sound_speed: mi.Float) -> mi.Float:
        """Return η_t - 1 of points (R,) with labels, from directions d and b."""
        lib = self._lib
        velocity, turn = (dr.gather(lib.Array4f, self._rates, 2 * label + half) for half in (0, 1))
        stand = dr.gather(lib.Array4f64, self._stands, label)
        arm = mi.Vector3f(point - lib.Array3f64(stand[0], stand[1], stand[2]))
        velocity = mi.Vector3f(velocity[0], velocity[1], velocity[2]) + dr.cross(
            mi.Vector3f(turn[0], turn[1], turn[2]), arm)
        behind = dr.dot(velocity, back)
        return -(dr.dot(velocity, out) + behind) / (sound_speed + behind)

    def later(self, label: mi.UInt32, shift: mi.Float, time: mi.Float64) -> mi.Float64:
        """Return Δτ [s] of points that sound reaches at times T [s]; 0 of labels that stand still."""
        met = dr.gather(self._lib.Array4f64, self._stands, label)[3]
        return mi.Float64(-shift / (1 + shift)) * (time - met)
