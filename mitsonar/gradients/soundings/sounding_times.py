"""Compute travel times of soundings at known beam angles, as a function of the water and of the bed.

A ray of horizontal slowness p, which Snell's law keeps, goes from (x, y, z0) in the horizontal direction e to the bed
b(x, y), at depth z with the sine of grazing s and the speed c; b' is the bed's slope along e:

    t = 2 T(p, z),      z = b((x, y) + e X(p, z))
    dt = 2 [-Σ φ_k dc_k + a Σ β_j db_j + (p + a b') (Σ ξ_k dc_k + (dX/dp) dp)],     a = 1 / (c s (1 - b' p c / s))

φ_k = ∫ hat_k / (c² s) dz and ξ_k = p ∫ hat_k / s³ dz of the nodes of the profile (`profile_derivatives`), β_j the
shares of the bed's nodes at the place. A roll ρ of the array turns the beam: p = sin(arcsin(p0 c_h) + ρ u) / c_h with
c_h the speed at the head, u = ``starboard``, and angles from the vertical.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from mitsonar.hydrography.detection.sounding_beams import SoundingBeams
from mitsonar.hydrography.reduction.legs import RayLeg, Starts
from mitsonar.propagation.numpy_rays.profile_derivatives import passage_derivatives
from mitsonar.water.profile import SoundSpeedProfile

from ..model import Values
from .sounding_bed import BedGrid, BedShares

SPEED, BED, ROLL = "sound_speed", "bed_depth", "roll_offset"
UNITS = {SPEED: "m/s", BED: "m", ROLL: "rad"}
STEPS, CLOSE, LOST = 60, 1e-7, 1e-6    # [m] from the bed: the next step is much shorter; it was not found
MOST_NUMBERS = 100_000_000         # of a Jacobian by the profile: 0.8 GB


class Landing(NamedTuple):
    """Hold the points where N beams meet the bed; symbols are those of the equations above."""

    slowness: np.ndarray
    depth: np.ndarray
    time: np.ndarray                # one way
    distance: np.ndarray
    per_depth: np.ndarray           # a
    along: np.ndarray               # p + a b'
    shares: BedShares


class _Over(NamedTuple):
    """Hold beams at depths, and the bed below or above them; `miss` is the bed's depth less the beam's."""

    leg: RayLeg
    distance: np.ndarray
    shares: BedShares
    miss: np.ndarray
    slope: np.ndarray
    facing: np.ndarray


class SoundingTimes:
    """Two-way times of soundings as a `ForwardModel`.

    Parameters
    ----------
    beams : SoundingBeams
    profile : SoundSpeedProfile
        Profile at the start; the speeds at its nodes are the parameter ``sound_speed``.
    bed : BedGrid
        Bed at the start; its depths are the parameter ``bed_depth``.
    free : tuple of str
        Parameters that may change, of ``sound_speed``, ``bed_depth`` and ``roll_offset``.

    Raises
    ------
    ValueError
        If a name in `free` is unknown, or the Jacobian would have too many numbers.
    """

    def __init__(self, beams: SoundingBeams, profile: SoundSpeedProfile, bed: BedGrid,
                 free: tuple[str, ...] = (SPEED, BED)):
        unknown = sorted(set(free) - set(UNITS))
        if unknown or not free:
            raise ValueError(f"sounding times: {unknown[0] if unknown else 'nothing'} is no parameter; free may hold "
                             f"{', '.join(UNITS)}.")
        if len(beams) * profile.depth.size > MOST_NUMBERS:
            raise ValueError(f"sounding times: {len(beams)} soundings and a profile of {profile.depth.size} nodes are "
                             f"more than {MOST_NUMBERS} numbers; take fewer soundings or nodes.")
        self.beams, self.profile, self.bed = beams, profile, bed
        everything = {SPEED: np.array(profile.sound_speed), BED: np.array(bed.depth), ROLL: np.zeros(1)}
        self._all = everything
        self.start = {name: everything[name] for name in UNITS if name in free}
        self.units = {name: UNITS[name] for name in self.start}

    def value(self, values: Values) -> np.ndarray:
        """Return the two-way times (N,) [s]; see `ForwardModel.value`."""
        return 2 * self._landed(*self._given(values)).time

    def linearised(self, values: Values) -> LinearisedTimes:
        """Return the times about values, with their Jacobian; see `ForwardModel.linearised`."""
        profile, depths, roll = self._given(values)
        landing = self._landed(profile, depths, roll)
        beams, p = self.beams, landing.slowness
        passed = passage_derivatives(profile, p, beams.depth, landing.depth)
        jacobian: dict[str, np.ndarray | sparse.csr_array] = {}
        if SPEED in self.start:
            jacobian[SPEED] = 2 * (passed.time_by_speed + landing.along[:, None] * passed.range_by_speed)
        if BED in self.start:
            rows = np.repeat(np.arange(len(beams)), 4)
            data = 2 * landing.per_depth[:, None] * landing.shares.share
            jacobian[BED] = sparse.csr_array((data.ravel(), (rows, landing.shares.node.ravel())),
                                             shape=(len(beams), self.bed.depth.size))
        if ROLL in self.start:
            turn = np.sqrt(1 - (p * beams.head_speed) ** 2) / beams.head_speed * beams.starboard
            jacobian[ROLL] = (2 * landing.along * passed.range_by_parameter * turn)[:, None]
        shapes = {name: self.start[name].shape for name in jacobian}
        return LinearisedTimes(2 * landing.time, jacobian, shapes)

    def places(self, values: Values) -> np.ndarray:
        """Return the points x, y, depth, (N, 3) [m], where beams meet the bed."""
        landing = self._landed(*self._given(values))
        return np.stack([self.beams.x + self.beams.east * landing.distance,
                         self.beams.y + self.beams.north * landing.distance, landing.depth], -1)

    def _given(self, values: Values) -> tuple[SoundSpeedProfile, np.ndarray, float]:
        """Return profile, bed depths and roll for values."""
        numbers = dict(self._all)
        for name, value in values.items():
            numbers[name] = fitting(self.start, name, value)
        return (SoundSpeedProfile(self.profile.depth, numbers[SPEED]), numbers[BED].ravel(), float(numbers[ROLL][0]))

    def _landed(self, profile: SoundSpeedProfile, depths: np.ndarray, roll: float) -> Landing:
        """Trace the beams to the bed by Newton's method on the depth."""
        beams = self.beams
        p = beams.slowness
        if roll:                                       # a beam turned over the vertical goes the other way: p < 0
            p = np.sin(np.arcsin(p * beams.head_speed) + roll * beams.starboard) / beams.head_speed
        starts, deepest = Starts(profile=profile, depth=beams.depth), 3 * depths.max()
        z = np.maximum(depths.mean(), beams.depth + 1.0)
        todo = np.arange(len(beams))
        with np.errstate(invalid="ignore", divide="ignore"):
            for step in range(STEPS):
                over = self._over(starts, p, z, depths, todo)
                # a step of Newton's, but no farther up than most of the way, and none away from a bed that turns away
                ahead = over.miss / np.where(over.facing > 0.2, over.facing, 1.0) * (1.0 if step < STEPS // 3 else 0.5)
                top, here = beams.depth[todo], z[todo]
                stepped = np.maximum(np.minimum(here + ahead, deepest - 2 * top), top + 0.3 * (here - top))
                z[todo] = np.where(np.isfinite(over.leg.time), stepped, 0.5 * (top + here))
                todo = todo[~(np.abs(over.miss) < CLOSE)]
                if not todo.size:
                    break
            over = self._over(starts, p, z, depths, np.arange(len(beams)))
        lost = ~(np.abs(over.miss) < LOST) | (over.facing <= 0)
        if lost.any():
            grazing = np.degrees(np.arccos(np.minimum(1, np.abs(p) * profile.at(beams.depth))))[lost]
            raise ValueError(f"sounding times: {lost.sum()} of {len(beams)} beams do not come down to the bed in this "
                             f"water, the first with {grazing[0]:.1f} degrees of grazing at the head; leave beams out "
                             "that are nearly level.")
        per_depth = 1 / (over.leg.speed * over.leg.sine * over.facing)
        return Landing(p, z, over.leg.time, over.distance, per_depth, p + per_depth * over.slope, over.shares)

    def _over(self, starts: Starts, p: np.ndarray, z: np.ndarray, depths: np.ndarray, some: np.ndarray) -> _Over:
        """Trace some beams to depths, and interpolate the bed there."""
        p, z, beams = p[some], z[some], self.beams
        east, north = beams.east[some], beams.north[some]
        leg = starts[some].to_depth(np.abs(p), z)
        distance = p * leg.stretch
        shares = self.bed.shares(beams.x[some] + east * distance, beams.y[some] + north * distance)
        here = depths[shares.node]
        slope = ((shares.by_x * east[:, None] + shares.by_y * north[:, None]) * here).sum(1)
        miss, facing = (shares.share * here).sum(1) - z, 1 - slope * p * leg.speed / leg.sine
        return _Over(leg, distance, shares, miss, slope, facing)


class LinearisedTimes:
    """Hold times about values, as a `Linearised`."""
    # value (N,) [s]; jacobian (N, size)

    def __init__(self, value: np.ndarray, jacobian: dict[str, np.ndarray | sparse.csr_array],
                 shapes: dict[str, tuple[int, ...]]):
        self.value, self.jacobian, self._shapes = value, jacobian, shapes

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        result = np.zeros(len(self.value))
        like = {name: np.empty(shape) for name, shape in self._shapes.items()}
        for name, tangent in tangents.items():
            result += self.jacobian[name] @ fitting(like, name, tangent).ravel()
        return result

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        if np.shape(cotangent) != self.value.shape:
            raise ValueError(f"sounding times: weights have the shape {np.shape(cotangent)}; give {self.value.size}, "
                             "one for each time.")
        return {name: (rows.T @ np.asarray(cotangent, float)).reshape(self._shapes[name])
                for name, rows in self.jacobian.items()}


def fitting(like: Values, name: str, value: np.ndarray) -> np.ndarray:
    """Return a parameter's value as float64; refuse an unknown name or another shape."""
    if name not in like:
        raise ValueError(f"sounding times: {name} is no parameter; there are {', '.join(like)}.")
    value = np.asarray(value, float)
    if value.shape != like[name].shape:
        raise ValueError(f"sounding times: {name} has the shape {value.shape}; give {like[name].shape}.")
    return value
