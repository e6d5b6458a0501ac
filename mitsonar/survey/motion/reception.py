"""Reception of the echoes of one ping by an array that moves, turns, and is mounted off the body's origin.

Legs are known from the body's origin O at the transmission. The distance from a place r to a point at O + D n is longer
than D by

    |D n - r| - D = (|r|² - 2 D n·r) / (|D n - r| + D)                                                            (1)

On the way out, r is the transmit array's centre; on the way back, the receive array's centre at the reception of the
echo, r(t) = d(t) + R(t) r_c, with t found by iteration. The echo's sine on the line is

    s = n'·a c / (c + n'·v)                                                                                       (2)

with n' towards the echo in the body's frame at the reception and v the receiver's velocity: waves meet a moving line at
a slant. Beams look from O, in the plane of a and the normal b. The array's centre sees the point of a beam of sine s at
the distance D at a sine that differs by

    (a·r_c - s û·r_c) / D,     û = s a + √(1 - s²) b                                                              (3)

which is added to the echo's sine instead; beams that look from the array's centre do not need (3).
Waves of bent rays are not spherical. Arrays far off O see a wave of curvatures κ_a, across the ray's plane, and κ_e, in
it (`eigenray_table`). With u = n·r, and r_a and r_e across n, the extra distance and the direction n' are

    -u + (r_a t_a + r_e t_e) / (1 + √(1 + t_a² + t_e²)),     t = κ r / (1 - κ u),     n' ~ n - t_a â - t_e ê         (4)

and the wave is spread over (1 - κ_a u) (1 - κ_e u) (1 + t_a² + t_e²) times the area. (4) becomes (1) where κ is 1 / D.
The Doppler factor is that of `signal.doppler`, with the velocities of the transmitter and the receiver.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import opaque_vector
from mitsonar.device.rotations import rotated
from mitsonar.propagation.returns.moved_ends import detour
from mitsonar.propagation.returns.travel import Travel
from mitsonar.signal.doppler import two_way_doppler, two_way_shift

from ..pressure.array_survey import ArraySurvey

STEPS = 3                          # iterations; each multiplies the error by the ratio of platform speed to sound speed
NEAREST = 0.1                      # [m]: avoids division by zero
SMALL = 1e-9                       # [m], [m/s]: counts as zero
Curvatures = tuple["mi.Float", "mi.Float"]             # [1/m]


@dataclass(frozen=True, kw_only=True)
class EndArrival:
    """Echoes as the array receives them."""

    delay: mi.Float64  # (R,) [s]: since the transmission
    sent: mi.Vector3f  # (R,): unit, scene, departure as seen from the transmit array
    towards: mi.Vector3f  # (R,): unit, in a frame that turns with the body and is the scene's at the transmission
    sine: mi.Float  # (R,): s of (2)
    slant: mi.Float  # (R,): c / (c + n'·v) of (2)
    doppler: mi.Float  # (R,): factor minus 1
    spread: mi.Float | None = None  # (R,): area of both legs' waves at the arrays, over that at O


class Reception:
    """Reception of the echoes of one ping."""

    def __init__(self, survey: ArraySurvey, ping: int, *, axis: np.ndarray, normal: np.ndarray,
                 transmit_centre: np.ndarray, receive_centre: np.ndarray, beams_from_origin: bool = True):
        # axis, normal (3,); transmit_centre, receive_centre (3,) [m]: in the body's frame
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
        """Return the arrivals of echoes; the two legs have distances (R,) [m], times (R,) [s] and curvatures."""
        per_speed = dr.opaque(mi.Float, 1 / self.speed)
        spread = None
        if np.linalg.norm(self._sender) > SMALL:
            later, sent, spread = _from(sent, out_distance, opaque_vector(mi.Vector3f, self._sender), out_bent)
            out_time = out_time + mi.Float64(later * per_speed)
        delay, towards = out_time + back_time, mi.Vector3f(towards)
        arrival = towards
        if self._moves or np.linalg.norm(self._receiver) > SMALL:
            start, time = opaque_vector(mi.Vector3f, self._receiver), mi.Float(delay)
            for _ in range(STEPS if self._moves else 1):
                r = start
                if self._moves:
                    r = start + mi.Vector3f(*(mi.Float(part) for part in self._travel.moved(mi.Float64(time))))
                later, arrival, nearer = _from(towards, back_distance, r, back_bent)
                time = mi.Float(delay) + later * per_speed
            delay = delay + mi.Float64(later * per_speed)
            if nearer is not None:
                spread = nearer if spread is None else spread * nearer
        closing = sent_closing = mi.Float(0)
        if self._moves:
            velocity = mi.Vector3f(*(mi.Float(part) for part in self._travel.velocity(delay)))
            closing = dr.dot(arrival, velocity)
            sent_closing = dr.dot(sent, opaque_vector(mi.Vector3f, self._sent_velocity))
        if self._turns:
            turned = self._travel.turned(delay)
            arrival = mi.Vector3f(*rotated(list(arrival), [mi.Float(part) for part in turned], back=True))
        c = dr.opaque(mi.Float, self.speed)
        sine = dr.dot(arrival, opaque_vector(mi.Vector3f, self._axis)) * c / (c + closing)
        if self._from_origin and np.linalg.norm(self._receiver) > SMALL:
            along, ahead = (dr.opaque(mi.Float, part) for part in self._off)
            seen = sine * along + dr.sqrt(dr.maximum(1 - sine * sine, 0)) * ahead
            sine = sine + (along - sine * seen) / dr.maximum(back_distance, NEAREST)                     # (3)
        return EndArrival(delay=delay, sent=sent, towards=arrival, sine=sine, slant=c / (c + closing),
                          doppler=two_way_shift(sent_closing, c, closing), spread=spread)

    def doppler_of_sines(self, sines: np.ndarray, sink: float) -> np.ndarray:
        """Return the Doppler factors of echoes at sines (K,) along the axis, and at a sine `sink` below level."""
        axis, ahead = self._axis, self._normal
        down = np.array([0.0, 0.0, -1.0])
        across = down - (down @ axis) * axis - (down @ ahead) * ahead
        rest = np.sqrt(np.maximum(1 - sines ** 2, 0.0))
        aside = np.minimum(sink, rest)
        forward = np.sqrt(np.maximum(rest ** 2 - aside ** 2 * (across @ across), 0.0))
        return self.doppler_towards(sines[:, None] * axis + aside[:, None] * across + forward[:, None] * ahead)

    def doppler_towards(self, sight: np.ndarray) -> np.ndarray:
        """Return the Doppler factors of echoes from directions (K, 3), scene, at the beginning of the ping."""
        return two_way_doppler(sight @ self._sent_velocity, self.speed, sight @ self._velocity)


def _from(towards: mi.Vector3f, distance: mi.Float, place: mi.Vector3f,
          bent: Curvatures | None) -> tuple[mi.Float, mi.Vector3f, mi.Float | None]:
    """Return the extra distance from a place, by (1) or (4), the unit vector along the leg, and the spread."""
    if bent is None:
        leg, length, later = detour(towards, distance, place)
        return later, leg / dr.maximum(length, 1e-6), None
    level = dr.sqrt(towards.x * towards.x + towards.y * towards.y)
    slanted = level > 1e-6
    a = mi.Vector3f(dr.select(slanted, -towards.y / level, 1), dr.select(slanted, towards.x / level, 0), 0)
    e = dr.cross(towards, a)
    u, across, within = dr.dot(place, towards), dr.dot(place, a), dr.dot(place, e)
    left = [dr.maximum(1 - curvature * u, 0.05) for curvature in bent]
    t_a, t_e = bent[0] * across / left[0], bent[1] * within / left[1]
    square = 1 + t_a * t_a + t_e * t_e
    length = dr.sqrt(square)
    later = (across * t_a + within * t_e) / (1 + length) - u
    return later, (towards - t_a * a - t_e * e) / length, left[0] * left[1] * square
