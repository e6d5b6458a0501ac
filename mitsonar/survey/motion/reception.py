"""How the echoes of one ping come back to an array that moves, turns, and is mounted off the body's origin.

Legs are known from the body's origin O at the transmission. From a place r to a point D n away from O the way is

    |D n - r| - D = (|r|² - 2 D n·r) / (|D n - r| + D)                                                            (1)

longer. For the way out r is where the transmit array's centre stands, for the way back where the receive array's centre
is at the echo's own reception, r(t) = d(t) + R(t) r_c; the time t follows by iteration. The echo's sine on the line is

    s = n'·a c / (c + n'·v)                                                                                       (2)

n' towards the echo in the body's frame then, v the receiver's velocity: the waves meet the line at a slant as it moves.
Beams look from O, in the plane of a and the normal b. Seen from the array's centre the point of a beam of sine s at the
distance D lies beside that by

    (a·r_c - s û·r_c) / D,     û = s a + √(1 - s²) b                                                              (3)

which is added to the echo's sine instead; beams that look from the array's centre do without.
In bent rays waves are not round. Arrays far off O see a wave of curvatures κ_a, across the ray's plane, and κ_e in it
(`eigenray_table`): with u = n·r, and r_a and r_e across n, the way is longer, and comes along n', by

    -u + (r_a t_a + r_e t_e) / (1 + √(1 + t_a² + t_e²)),     t = κ r / (1 - κ u),     n' ~ n - t_a â - t_e ê         (4)

and the wave is spread over (1 - κ_a u) (1 - κ_e u) (1 + t_a² + t_e²) times the area. All of it is (1) where κ is 1 / D.
Its Doppler factor is (c + v_back·n') / (c - v_out·n), v_out the transmitter's velocity.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import opaque_vector
from mitsonar.propagation.returns.travel import Travel, detour, rotated
from mitsonar.signal.doppler import two_way_doppler

from ..pressure.array_survey import ArraySurvey

STEPS = 3                          # of iteration: each reduces the error by the platform's speed over that of sound
NEAREST = 0.1                      # [m]: no division by zero
SMALL = 1e-9                       # [m], [m/s]: nothing at all
Curvatures = tuple["mi.Float", "mi.Float"]


@dataclass(frozen=True, kw_only=True)
class EndArrival:
    """Hold echoes as the array receives them, one each."""

    delay: mi.Float64  # (R,) [s]: from the transmission on
    sent: mi.Vector3f  # (R,): unit, scene, where they left for as seen from the transmit array
    towards: mi.Vector3f  # (R,): unit, in a frame that turns with the body and is the scene's at the transmission
    sine: mi.Float  # (R,): s of (2)
    doppler: mi.Float  # (R,): factor minus 1
    spread: mi.Float | None = None  # (R,): area of both legs' waves where the arrays are, over that at O


class Reception:
    """Receive the echoes of one ping."""
    # axis (3,); normal (3,); transmit_centre (3,) [m]; receive_centre (3,) [m]

    def __init__(self, survey: ArraySurvey, ping: int, *, axis: np.ndarray, normal: np.ndarray,
                 transmit_centre: np.ndarray, receive_centre: np.ndarray, beams_from_origin: bool = True):
        rotation = survey.track.rotation()[ping]
        self.ping = ping
        self.rotation, self.speed = rotation, survey.sound_speed(ping)
        self.steering = None if survey.steering is None else survey.steering[ping]
        travel = survey.travel(ping, receive_centre)
        self._sender, self._receiver = rotation @ transmit_centre, rotation @ receive_centre
        d, r = travel.displacement[0], travel.turn[0]
        self._moves, self._turns = (bool(len(powers)) and bool((travel.reach(powers[None]) > SMALL).any())
                                    for powers in (d, r))
        self._travel = Travel.within(d, r, travel.duration, lambda number: dr.opaque(mi.Float64, float(number)))
        together = np.array_equal(transmit_centre, receive_centre)
        sender_travel = travel if together else survey.travel(ping, transmit_centre)
        self._sent_velocity = sender_travel.displacement[0][0] if len(sender_travel.displacement[0]) else np.zeros(3)
        self._axis, self._normal = rotation @ axis, rotation @ normal
        self._from_origin = beams_from_origin
        self._off = float(axis @ receive_centre), float(normal @ receive_centre)
        self._velocity = d[0] if len(d) else np.zeros(3)

    @property
    def off_the_origin(self) -> bool:
        """Return True if an array lies off O."""
        return bool(max(np.linalg.norm(self._sender), np.linalg.norm(self._receiver)) > SMALL)

    @property
    def still(self) -> bool:
        """Return True if the platform neither moves nor turns."""
        return not (self._moves or self._turns)

    def receive(self, *, sent: mi.Vector3f, out_distance: mi.Float, out_time: mi.Float64, towards: mi.Vector3f,
                back_distance: mi.Float, back_time: mi.Float64, out_bent: Curvatures | None = None,
                back_bent: Curvatures | None = None) -> EndArrival:
        """Return when and from where echoes arrive."""
        # sent, towards (R,); out_distance, back_distance (R,) [m]; out_time (R,) [s]; back_time (R,) [s]; out_bent,
        # back_bent (Float, Float) [1/m]
        per_speed = dr.opaque(mi.Float, 1 / self.speed)
        spread = None
        if np.linalg.norm(self._sender) > SMALL:
            later, sent, spread = _from(sent, out_distance, opaque_vector(mi.Vector3f, self._sender), out_bent)
            out_time = out_time + mi.Float64(later * per_speed)
        delay, towards = out_time + back_time, mi.Vector3f(towards)
        heard = towards
        if self._moves or np.linalg.norm(self._receiver) > SMALL:
            start, time = opaque_vector(mi.Vector3f, self._receiver), mi.Float(delay)
            for _ in range(STEPS if self._moves else 1):
                r = start
                if self._moves:
                    r = start + mi.Vector3f(*(mi.Float(part) for part in self._travel.moved(mi.Float64(time))))
                later, heard, nearer = _from(towards, back_distance, r, back_bent)
                time = mi.Float(delay) + later * per_speed
            delay = delay + mi.Float64(later * per_speed)
            if nearer is not None:
                spread = nearer if spread is None else spread * nearer
        closing = mi.Float(0)
        if self._moves:
            velocity = mi.Vector3f(*(mi.Float(part) for part in self._travel.velocity(delay)))
            closing = dr.dot(heard, velocity)
        sent_closing = dr.dot(sent, opaque_vector(mi.Vector3f, self._sent_velocity)) if self._moves else mi.Float(0)
        if self._turns:
            turned = self._travel.turned(delay)
            heard = mi.Vector3f(*rotated(list(heard), [mi.Float(part) for part in turned], back=True))
        c = dr.opaque(mi.Float, self.speed)
        sine = dr.dot(heard, opaque_vector(mi.Vector3f, self._axis)) * c / (c + closing)
        if self._from_origin and np.linalg.norm(self._receiver) > SMALL:
            along, ahead = (dr.opaque(mi.Float, part) for part in self._off)
            seen = sine * along + dr.sqrt(dr.maximum(1 - sine * sine, 0)) * ahead
            sine = sine + (along - sine * seen) / dr.maximum(back_distance, NEAREST)                     # (3)
        return EndArrival(delay=delay, sent=sent, towards=heard, sine=sine,
                       doppler=(closing + sent_closing) / (c - sent_closing), spread=spread)

    def doppler_of_sines(self, sines: np.ndarray, sink: float) -> np.ndarray:
        """Return the Doppler factors of echoes from sines (K,) along the axis, a sine `sink` below the level."""
        axis, ahead = self._axis, self._normal
        down = np.array([0.0, 0.0, -1.0])
        across = down - (down @ axis) * axis - (down @ ahead) * ahead
        rest = np.sqrt(np.maximum(1 - sines ** 2, 0.0))
        aside = np.minimum(sink, rest)
        forward = np.sqrt(np.maximum(rest ** 2 - aside ** 2 * (across @ across), 0.0))
        sight = sines[:, None] * axis + aside[:, None] * across + forward[:, None] * ahead
        return two_way_doppler(sight @ self._sent_velocity, self.speed, sight @ self._velocity)


def _from(towards: mi.Vector3f, distance: mi.Float, place: mi.Vector3f,
          bent: Curvatures | None) -> tuple[mi.Float, mi.Vector3f, mi.Float | None]:
    """Return how much longer the way is from a place, by (1) or (4), the unit vector along it, and the spread."""
    if bent is not None:
        return _from_bent(towards, place, bent)
    way, length, longer, whole = detour(towards, distance, place)
    return longer / whole, way / dr.maximum(length, 1e-6), None


def _from_bent(towards: mi.Vector3f, place: mi.Vector3f,
               bent: Curvatures) -> tuple[mi.Float, mi.Vector3f, mi.Float]:
    level = dr.sqrt(towards.x * towards.x + towards.y * towards.y)
    there = level > 1e-6
    a = mi.Vector3f(dr.select(there, -towards.y / level, 1), dr.select(there, towards.x / level, 0), 0)
    e = dr.cross(towards, a)
    u, across, within = dr.dot(place, towards), dr.dot(place, a), dr.dot(place, e)
    left = [dr.maximum(1 - curvature * u, 0.05) for curvature in bent]
    t_a, t_e = bent[0] * across / left[0], bent[1] * within / left[1]
    square = 1 + t_a * t_a + t_e * t_e
    length = dr.sqrt(square)
    later = (across * t_a + within * t_e) / (1 + length) - u
    return later, (towards - t_a * a - t_e * e) / length, left[0] * left[1] * square
