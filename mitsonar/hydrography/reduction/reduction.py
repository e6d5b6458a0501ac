"""Reduction of soundings: places from two cones and a time, by refracted rays from one array and back to the other.

With T the place of the transmit array at transmission and R that of the receive array at reception, B the sounding,
q = (q_x, q_y) the horizontal slowness of a leg from its array to B, w = √(1/c² - q²) the vertical slowness in the water
at the array, and t(q, z) and X(q, z) the time and horizontal range of a ray to the depth z (`legs`), B satisfies

    X_T(q_T, z) = B - T          a_t·(q_T, w_T) = sin(transmit_angle) / c_h
    X_R(q_R, z) = B - R          a_r·(q_R, w_R) = sin(angle) / c_h            t_T + t_R = travel_time

a -> unit vectors along the arrays, at the attitude of each instant, with the mounting; c_h -> sound speed at the head
that steered the beams: an array measures the slowness along itself, the sine of the steering over c_h. For a level
array this is the horizontal slowness, which Snell's law keeps: an error of c_h then has no further effect. For a tilted
array the vertical slowness also counts, and with it the speed at the array (Beaudoin, Hughes Clarke and Bartlett, 2004,
International Hydrographic Review 5(3), 26).

Newton's method solves this for (B, z): a leg responds to a step of its end by δq = Q δX, Q = (∂X/∂q)⁻¹, and time has
the gradient (q, s / c). It starts from the usual approximation, both cones about a point midway between the arrays,
whose error is about δ² / (8 R) for arrays δ apart at range R: 0.1 m for 9 m at 100 m.
"""
from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.rotations import mounted
from mitsonar.sonar.arrays.cones import cone_directions
from mitsonar.water.profile import SoundSpeedProfile

from .attitude import PlatformMotion, PlatformPose
from .legs import RayLeg, Starts

STEPS = 24
CLOSE = 1e-5                       # [m]: the next step is shorter than CLOSE² over the range
LOWEST = 0.1                       # sine at the start of the search where the cones about one point do not meet
Plane = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Installation:
    """Positions and attitudes of the arrays.

    Parameters
    ----------
    transmit_offset, receive_offset : array (3,) [m]
        Lever arms from the reference point: forward, starboard, down.
    transmit_mounting, receive_mounting : array (3,) [rad]
        Roll, pitch and heading of the arrays in the body.
    """

    transmit_offset: ArrayLike = (0.0, 0.0, 0.0)
    receive_offset: ArrayLike = (0.0, 0.0, 0.0)
    transmit_mounting: ArrayLike = (0.0, 0.0, 0.0)
    receive_mounting: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self):
        for one in fields(self):
            value = np.asarray(getattr(self, one.name), float)
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ValueError(f"installation: {one.name} is {getattr(self, one.name)!r}; give three finite numbers.")
            object.__setattr__(self, one.name, value)

    @property
    def transmit_axis(self) -> np.ndarray:
        """Return the unit vector along the transmit array, in the body."""
        return mounted(np.array([1.0, 0.0, 0.0]), *np.asarray(self.transmit_mounting))

    @property
    def receive_axis(self) -> np.ndarray:
        """Return the unit vector along the receive array, in the body."""
        return mounted(np.array([0.0, 1.0, 0.0]), *np.asarray(self.receive_mounting))


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Measurements of the sonar; all of one shape, NaN where there is no sounding.

    Attributes
    ----------
    ping_time : array (...) [s]
        Start of the ping, by the motion's clock. Across and along track refer to the reference point at this time.
    transmit_time : array (...) [s]
        Transmission of the sounding's sector.
    travel_time : array (...) [s]
        Time from the transmission to the reception.
    angle, transmit_angle : array (...) [rad]
        Steering angles of the receiving and of the transmitted beam.
    head_sound_speed : array (...) [m/s]
        Sound speed with which the beams were steered.
    """

    ping_time: np.ndarray
    transmit_time: np.ndarray
    travel_time: np.ndarray
    angle: np.ndarray
    transmit_angle: np.ndarray
    head_sound_speed: np.ndarray

    def __post_init__(self):
        wide = np.broadcast_arrays(*(np.asarray(getattr(self, one.name), float) for one in fields(self)))
        for one, value in zip(fields(self), wide):
            object.__setattr__(self, one.name, value)

    def __getitem__(self, some: np.ndarray) -> Measured:
        return Measured(**{one.name: getattr(self, one.name)[some] for one in fields(self)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Located:
    """Soundings with places, in the shape of the measurement; NaN for soundings without a place.

    Attributes
    ----------
    x, y, depth : array (...) [m]
        Position: east, north, below the still surface.
    across_track, along_track : array (...) [m]
        To starboard and forward of the reference point at the beginning of the ping, relative to its heading.
    grazing : array (...) [rad]
        Grazing angle of the return leg, at a level bed.
    path_length : array (...) [m]
        One-way length: the mean of both legs.
    spreading_area : array (...) [m²/sr]
        Cross-section of the ray tube at the bed per steradian at an array: the geometric mean of both legs.
    source_depth : array (...) [m]
        Depth of the transmit array.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray
    across_track: np.ndarray
    along_track: np.ndarray
    grazing: np.ndarray
    path_length: np.ndarray
    spreading_area: np.ndarray
    source_depth: np.ndarray

    @property
    def found(self) -> np.ndarray:
        """Return True for soundings with a place."""
        return np.isfinite(self.depth)


def located(measured: Measured, motion: PlatformMotion, installation: Installation, profile: SoundSpeedProfile, *,
            head_speed: ArrayLike | None = None, node: bool = True, under_way: bool = True) -> Located:
    """Return the places of soundings.

    Parameters
    ----------
    measured : Measured
        Measured times and angles.
    motion : Motion
        Motion from the first transmission to the last reception; beyond its ends it continues straight.
    installation : Installation
        Lever arms and mounting angles.
    profile : SoundSpeedProfile
        True or assumed water.
    head_speed : array (...) or float [m/s], or None
        Sound speed by which angles are converted: the slowness along an array is sin(angle) / ``head_speed``. None: the
        speed that steered the beams, which gives the measured slowness. Any other speed misinterprets correct beams.
    node : bool
        If True, the head's speed is the profile's node at the arrays, as in real systems: rays start with it, and the
        water is linear from there to the cast's next node. If False, the profile is used unchanged, and should have the
        head's speed at the arrays.
    under_way : bool
        If True, include the motion over ground during reception. Some instruments leave it out (`instrument_rules`
        determines that from a line): places of an EM 710 that drifts sideways at 0.19 m/s agree within 1 mm across the
        track without it, and within 35 mm with it.

    Returns
    -------
    Located
        NaN where a number is NaN, where cones do not meet, and for rays that turn before the sounding: the whole beam
        must go down, or up.
    """
    shape = measured.travel_time.shape
    head = np.broadcast_to(measured.head_sound_speed if head_speed is None else np.asarray(head_speed, float), shape)
    rows = np.stack([np.ravel(getattr(measured, one.name)) for one in fields(measured)] + [head.ravel()])
    some = np.flatnonzero(np.isfinite(rows).all(0))
    kept = Measured(**{one.name: values[some] for one, values in zip(fields(measured), rows)})
    legs = _Legs.of(kept, motion, installation, profile, rows[-1][some] if node else None, rows[-1][some], under_way)
    up = legs.initial()[:, 2] < 0
    found = np.full((9, rows.shape[1]), np.nan)
    for side in (False, True):
        number = np.flatnonzero(up == side)
        if number.size:
            part = legs[number]
            found[:, some[number]] = _solved(part.mirrored() if side else part) * (_UP if side else 1.0)
    reference = motion.at(kept.ping_time)
    found[3:5, some] = _about(reference, found[0, some], found[1, some])
    return Located(**{one.name: row.reshape(shape) for one, row in zip(fields(Located), found)})


_UP = np.array([1, 1, -1, 1, 1, 1, 1, 1, -1.0])[:, None]   # signs of the rows of `Located` in water turned upside down


@dataclass(frozen=True, kw_only=True, eq=False)
class _Side:
    """Legs of one array: its place (N, 3), axis (N, 3), the slowness along it (N,), and the starts of rays."""

    place: np.ndarray
    axis: np.ndarray
    along: np.ndarray
    starts: Starts

    def __getitem__(self, some: np.ndarray) -> _Side:
        return _Side(place=self.place[some], axis=self.axis[some], along=self.along[some], starts=self.starts[some])

    def mirrored(self) -> _Side:
        flip = np.array([1, 1, -1.0])
        return replace(self, place=self.place * flip, axis=self.axis * flip, starts=self.starts.mirrored())


@dataclass(frozen=True, kw_only=True, eq=False)
class _Legs:
    """Both legs of N soundings, and their times (N,)."""

    out: _Side
    back: _Side
    time: np.ndarray

    @classmethod
    def of(cls, measured: Measured, motion: PlatformMotion, installation: Installation, profile: SoundSpeedProfile,
           node: np.ndarray | None, head: np.ndarray, under_way: bool) -> _Legs:
        sent, received = (motion.at(measured.transmit_time + part * measured.travel_time) for part in (0, 1))
        if not under_way:
            received.place[:, :2] = sent.place[:, :2]
        sides = []
        for pose, angle, offset, axis in (
                (sent, measured.transmit_angle, installation.transmit_offset, installation.transmit_axis),
                (received, measured.angle, installation.receive_offset, installation.receive_axis)):
            place = pose.carried(np.asarray(offset))
            starts = Starts(profile=profile, depth=place[:, 2], head_speed=node)
            sides.append(_Side(place=place, axis=pose.turned(axis), along=np.sin(angle) / head, starts=starts))
        return cls(out=sides[0], back=sides[1], time=measured.travel_time)

    def __getitem__(self, some: np.ndarray) -> _Legs:
        return _Legs(out=self.out[some], back=self.back[some], time=self.time[some])

    def mirrored(self) -> _Legs:
        return _Legs(out=self.out.mirrored(), back=self.back.mirrored(), time=self.time)

    def initial(self) -> np.ndarray:
        """Return unit vectors (N, 3) where the two cones meet, or nearly meet, about one point; the lower of two."""
        u, v = (side.along * side.starts.speed for side in (self.out, self.back))
        return cone_directions(self.out.axis, self.back.axis, u, v, LOWEST)


def _solved(legs: _Legs) -> np.ndarray:
    """Return the rows of `Located` (9, N) of soundings below their arrays; across and along track are left out."""
    out, back = legs.out, legs.back
    middle = replace(out.starts, depth=0.5 * (out.place[:, 2] + back.place[:, 2]))
    q = legs.initial()[:, :2] / middle.speed[:, None]
    z = middle.coarse(0.5 * legs.time).depth_after(np.hypot(*q.T), 0.5 * legs.time)
    if (turned := np.isnan(z)).any():                          # in the few nodes of the first guess; try all nodes
        z[turned] = middle[turned].depth_after(np.hypot(*q[turned].T), 0.5 * legs.time[turned])
    z = np.where(z > np.maximum(out.place[:, 2], back.place[:, 2]), z, np.nan)
    slow = [tuple(q.T.copy()) for _ in range(2)]
    leg = middle.to_depth(np.hypot(*q.T), z)
    place = [0.5 * (out.place[:, i] + back.place[:, i]) + q[:, i] * leg.stretch for i in (0, 1)]
    todo = np.flatnonzero(np.isfinite(leg.time))
    rows = np.full((9, len(z)), np.nan)
    for _ in range(STEPS):
        if not todo.size:
            break
        sides = [out[todo], back[todo]]
        x, y, depth = place[0][todo], place[1][todo], z[todo]
        q = [(one[0][todo], one[1][todo]) for one in slow]
        step, turns, ends = _step(sides, legs.time[todo], x, y, depth, q)
        share = _share(sides, step, depth, legs.time[todo])
        place[0][todo], place[1][todo], z[todo] = x + share * step[0], y + share * step[1], depth + share * step[2]
        for one, (before, turn) in zip(slow, zip(q, turns)):
            one[0][todo], one[1][todo] = before[0] + share * turn[0], before[1] + share * turn[1]
        far = np.abs(step).max(0)
        lost = np.isnan(far)
        z[todo[lost]] = np.nan
        done = far < CLOSE
        rows[:, todo[done]] = _answer(sides, slow, ends, todo, place, z)[:, done]
        todo = todo[~done & ~lost]
    return rows


def _share(sides: list[_Side], step: np.ndarray, z: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the share of a step (3, N) to take: at most a quarter of the range, and half the way up to the arrays."""
    long = np.sqrt((step**2).sum(0)) / (0.125 * time * sides[0].starts.speed)
    up = -step[2] / (0.5 * (z - np.maximum(sides[0].place[:, 2], sides[1].place[:, 2])))
    return 1 / np.maximum(1, np.maximum(long, up))


def _step(sides: list[_Side], time: np.ndarray, x: np.ndarray, y: np.ndarray, z: np.ndarray,
          slow: list[Plane]) -> tuple[np.ndarray, list[Plane], list[RayLeg]]:
    """Return a Newton step of B and z (3, N), of both slownesses, and the legs before the step."""
    equations, answers, legs, rest = [], [], [], time.copy()
    timing = np.zeros((3, len(z)))
    for side, (qx, qy) in zip(sides, slow):
        p = np.hypot(qx, qy)
        leg = side.starts.to_depth(p, z)
        miss = x - side.place[:, 0] - qx * leg.stretch, y - side.place[:, 1] - qy * leg.stretch
        with np.errstate(invalid="ignore", divide="ignore"):
            vertical = np.sqrt(1 / side.starts.speed**2 - p * p)
            per_depth = leg.speed / leg.sine
            bend = (1 / leg.slope - 1 / leg.stretch) / np.where(p > 1e-12, p * p, np.inf)
            turn = _AttitudeTurn(1 / leg.stretch + bend * qx * qx, bend * qx * qy, 1 / leg.stretch + bend * qy * qy)
            a, b, down = side.axis.T
            normal = turn.of((a - down * qx / vertical, b - down * qy / vertical))
            equations.append(np.stack([*normal, -(normal[0] * qx + normal[1] * qy) * per_depth]))
            answers.append(side.along - a * qx - b * qy - down * vertical - normal[0] * miss[0] - normal[1] * miss[1])
            timing += np.stack([qx, qy, leg.sine / leg.speed])
            rest = rest - leg.time - qx * miss[0] - qy * miss[1]
        legs.append((leg, turn, miss, per_depth))
    step = _solved_three([*equations, timing], [*answers, rest])
    turns = []
    for (_, turn, miss, per_depth), (qx, qy) in zip(legs, slow):
        turns.append(turn.of((miss[0] + step[0] - qx * per_depth * step[2],
                              miss[1] + step[1] - qy * per_depth * step[2])))
    return step, turns, [leg for leg, *_ in legs]


@dataclass(frozen=True, eq=False)
class _AttitudeTurn:
    """Symmetric matrices Q of N legs."""

    xx: np.ndarray
    xy: np.ndarray
    yy: np.ndarray

    def of(self, vector: Plane) -> Plane:
        """Return Q times a horizontal vector."""
        x, y = vector
        return self.xx * x + self.xy * y, self.xy * x + self.yy * y


def _solved_three(rows: list[np.ndarray], answers: list[np.ndarray]) -> np.ndarray:
    """Return the solutions (3, N) of three equations, rows (3, N) and answers (N,), by Cramer's rule."""
    a, b, c = rows
    crosses = [np.cross(*pair, axis=0) for pair in ((b, c), (c, a), (a, b))]
    with np.errstate(invalid="ignore", divide="ignore"):
        return sum(k * cross for k, cross in zip(answers, crosses)) / (a * crosses[0]).sum(0)


def _answer(sides: list[_Side], slow: list[tuple[np.ndarray, np.ndarray]], ends: list[RayLeg], todo: np.ndarray,
            place: list[np.ndarray], z: np.ndarray) -> np.ndarray:
    """Return the rows of `Located` of solved soundings; lengths and sines lack the last step of 1e-5 m."""
    out, back = ends
    area = np.ones(len(todo))
    with np.errstate(invalid="ignore"):
        for side, (qx, qy), leg in zip(sides, slow, ends):
            p, speed = np.hypot(qx[todo], qy[todo]), side.starts.speed
            area = area * leg.stretch * leg.slope * np.sqrt(1 - (p * speed) ** 2) * leg.sine / speed**2
        area = np.sqrt(area)
        grazing = np.arcsin(back.sine)
    none = np.full(len(todo), np.nan)
    return np.stack([place[0][todo], place[1][todo], z[todo], none, none, grazing, 0.5 * (out.length + back.length),
                     area, sides[0].starts.depth])


def _about(reference: PlatformPose, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return across and along track (2, N) of places relative to a pose."""
    east, north = x - reference.place[..., 0], y - reference.place[..., 1]
    sine, cosine = np.sin(reference.heading), np.cos(reference.heading)
    return np.stack([east * cosine - north * sine, east * sine + north * cosine])
