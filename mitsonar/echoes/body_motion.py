"""Doppler and delay of echoes from moving bodies, which stand where the sound of a ping meets them (`scene.moving`).

    η_t = (c - v·d) / (c + v·b)                 rate of time of the echo, per unit of the sound's (`signal.doppler`)
    Δτ = (1/η_t - 1) (T - t1)                   change of the delay of a point that sound reaches at T, not at t1

v -> velocity of the point, u + ω × (p - P), or of the water where the sea surface has waves (`scene.sea`);
d -> direction of the sound that arrives at the point, b -> that of sound that would arrive from the receiver;
c -> sound speed there. Sound that leaves a transmitter later by δ comes back later
by δ / η_t, which is the second line with δ = T - t1: exact for a point that keeps its velocity, but for the change of
directions meanwhile, (v δ)² / R c. Every point of the sea surface stands where sound meets it: δ = 0.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.sea import SeaStand


class BodyMotion:
    """Motion of a scene's labels, or of parts of a gait, at the ping that its objects stand as at; of still ones 0."""

    def __init__(self, geometry: Geometry):
        self._geometry, self._lib = geometry, arrays_of(mi.Float)
        self._rates, self._stands = mi.Float(), mi.Float64()           # rows of u and ω; of P and t1
        self._waves = mi.Float()                                       # rows of the velocity and D of the sea's nodes
        self._surface = dr.opaque(mi.UInt32, geometry.surface_label)
        self._nodes, self._border = np.zeros(0), 0
        geometry.follow(self._moved)

    @classmethod
    def of(cls, geometry: Geometry) -> BodyMotion | None:
        """Return the motion of a scene; None if nothing moves there."""
        return cls(geometry) if geometry.movers else None

    def _moved(self) -> None:
        """Take the motion of the objects as they stand."""
        labels = max([len(self._geometry.named), *(body.number for body in self._geometry.bodies)]) + 1
        rates, stands = np.zeros((labels, 8), np.float32), np.zeros((labels, 4))
        for body, stand in zip(self._geometry.movers, self._geometry.stands):
            if isinstance(stand, SeaStand):
                rows = np.zeros((*stand.velocity.shape[:2], 8), np.float32)
                rows[..., :3], rows[..., 4:7] = stand.velocity, stand.moved
                self._waves, self._nodes, self._border = upload(mi.Float, rows), stand.nodes, stand.border
                continue
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
        if len(self._nodes):
            at_surface = label == self._surface
            velocity = dr.select(at_surface, self._of_water(point, at_surface), velocity)
        behind = dr.dot(velocity, back)
        return -(dr.dot(velocity, out) + behind) / (sound_speed + behind)

    def later(self, label: mi.UInt32, shift: mi.Float, time: mi.Float64) -> mi.Float64:
        """Return Δτ [s] of points that sound reaches at times T [s]; 0 of labels that stand still."""
        met = dr.gather(self._lib.Array4f64, self._stands, label)[3]
        if len(self._nodes):
            met = dr.select(label == self._surface, time, met)
        return mi.Float64(-shift / (1 + shift)) * (time - met)

    def _of_water(self, point: dr.ArrayBase, active: mi.Bool) -> mi.Vector3f:
        """Return the velocities [m/s] of the water at points (R,) of the sea surface."""
        x, y = mi.Float(point.x), mi.Float(point.y)
        moved, _ = self._between_nodes(x, y, active)
        return self._between_nodes(x - moved.x, y - moved.y, active)[1]

    def _between_nodes(self, x: mi.Float, y: mi.Float, active: mi.Bool) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Return displacement and velocity between nodes, about level places; 0 beyond the waves."""
        count, border = len(self._nodes), self._border
        first, width = float(self._nodes[border]), float(self._nodes[border + 1] - self._nodes[border])
        (column, u), (row, v) = (_cell((place - first) / width, border, count) for place in (x, y))
        moved, velocity = dr.zeros(mi.Vector3f), dr.zeros(mi.Vector3f)
        corners = (0, 0, (1 - u) * (1 - v)), (0, 1, u * (1 - v)), (1, 0, (1 - u) * v), (1, 1, u * v)
        for down, across, weight in corners:
            node = 2 * ((row + down) * count + column + across)
            first_half, second_half = (dr.gather(self._lib.Array4f, self._waves, node + half, active)
                                       for half in (0, 1))
            velocity += weight * mi.Vector3f(first_half[0], first_half[1], first_half[2])
            moved += weight * mi.Vector3f(second_half[0], second_half[1], second_half[2])
        return moved, velocity


def _cell(place: mi.Float, border: int, count: int) -> tuple[mi.UInt32, mi.Float]:
    """Return the cells of places in units of nodes, and the shares of the way through them."""
    place = held(place, -1, count - 2 * border) + border
    cell = mi.UInt32(place)
    return cell, place - mi.Float(cell)
