"""Every ray that leaves one depth, turns once below and arrives at another depth at a given range.

With ``upper`` and ``lower`` the depths of the two ends, ``near`` the upper edge of the layer of gradient g > 0 that the
ray turns in, s its sine there, and sine, cosine those at the fastest depth between ``upper`` and ``near``:

    X = x(upper..lower) + 2 x(lower..near) + 2 s / (p g)

As ``sine`` grows the layers passed give less range and the arc through the turning point gives more. Bounds of X, and
likewise of dX/d(sine), on an interval of ``sine`` therefore follow from its two ends. Intervals that cannot contain
the range are dropped; on intervals where X provably rises or falls there is one ray or none; the others are halved.
So no ray is missed, except that two closer than 1e-9 rad, on either side of a caustic, count as one.
"""
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from mitsonar.water.profile import SoundSpeedProfile

from .layer_arcs import TurningArc
from .layers import Layers

TINY_SINE = 1e-80  # stands for a horizontal ray: no division by zero and no overflow
OVERLAP = 1e-11  # share by which a ray may turn beyond a node: rounding must leave no gap between two layers
SAME_GRADIENT, JUST_PASSED = 1e-7, 1e-6  # relative; the range they cost is smaller than what OVERLAP adds
SUMMED = 1e-13  # relative error of a sum over layers, with room to spare
HALVINGS = 50
ROUNDING = 2e-15  # a range this close, relatively, cannot be improved
CONVERGED = 1e-9  # a relative Newton step this small leaves an error of its square
BATCH = 1 << 16  # numbers in a block: memory stays bounded and blocks stay in the cache


Cases: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray]    # upper and lower depth, range


class TurnedRays(NamedTuple):
    """Turned rays, every field (R,); the sines are those at the ends."""

    case: np.ndarray
    travel_time: np.ndarray
    arc_length: np.ndarray
    ray_parameter: np.ndarray
    range_slope: np.ndarray
    upper_sine: np.ndarray
    lower_sine: np.ndarray
    turning_depth: np.ndarray


class Intervals(NamedTuple):
    """Intervals of ``sine``, every field (I,): case, node above the turning layer, first and last sine."""

    case: np.ndarray
    node: np.ndarray
    left: np.ndarray
    right: np.ndarray

    def some(self, keep: np.ndarray | slice) -> "Intervals":
        """Return the intervals of a mask or a slice."""
        return Intervals(*(field[keep] for field in self))


def rays_turned_below(profile: SoundSpeedProfile, upper: np.ndarray, lower: np.ndarray, horizontal_range: np.ndarray,
                      latest: np.ndarray) -> TurnedRays:
    """Find every ray between two depths that turns once, below both."""
    # upper, lower (N,) [m]; horizontal_range (N,) [m]; latest (N,) [s]
    cases = upper, lower, horizontal_range
    open_intervals = _first_intervals(profile, *cases, latest)
    brackets = []
    for _ in range(HALVINGS):
        if not open_intervals.case.size:
            break
        possible, monotonic, crosses = _in_batches(_judge, profile, cases, open_intervals)
        brackets.append(open_intervals.some(possible & monotonic & crosses))
        open_intervals = _halves(open_intervals.some(possible & ~monotonic))
    # Intervals still open have shrunk onto a caustic at the range itself.
    brackets.append(open_intervals)
    brackets = Intervals(*map(np.concatenate, zip(*brackets)))
    if not brackets.case.size:
        return TurnedRays(brackets.case, *[np.empty(0)] * 7)
    return TurnedRays(*_in_batches(_solve, profile, cases, brackets))


def _first_intervals(profile: SoundSpeedProfile, upper: np.ndarray, lower: np.ndarray, horizontal_range: np.ndarray,
                     latest: np.ndarray) -> Intervals:
    """Return one interval for each layer in which a ray of the case can turn: the speed exceeds all that lies above."""
    node_depth, node_speed = profile.depth, profile.sound_speed
    near = np.maximum(node_depth[:-1], lower[:, None])  # (N, K-1)
    # The largest speed from `upper` to `near`, over the ends and the nodes between.
    passed = np.where(node_depth > upper[:, None], node_speed, 0.0)
    fastest = np.maximum(profile.at(upper), profile.at(lower))[:, None]
    fastest = np.maximum(fastest, np.maximum.accumulate(passed, axis=1)[:, :-1])
    far_speed = node_speed[1:]
    can_turn = (node_depth[1:] > lower[:, None]) & (far_speed > fastest)
    # A ray is nowhere faster than at its turning point, and its path is no shorter than that of a mirror at `near`.
    height = (lower - upper)[:, None] + 2 * (near - lower[:, None])
    can_turn &= np.hypot(horizontal_range[:, None], height) <= latest[:, None] * far_speed
    # Range per depth, p c / sqrt(1 - (p c)^2), is convex in c and grows with p: at the mean speed it is least.
    node_sum, upper_sum, lower_sum = (_speed_integral(profile, depth) for depth in (node_depth[:-1], upper, lower))
    to_near = np.maximum(node_sum, lower_sum[:, None])
    mean = 2 * to_near - lower_sum[:, None] - upper_sum[:, None] - SUMMED * np.abs(to_near)
    mean = np.clip(mean / np.maximum(height, TINY_SINE) / far_speed, 0, 1)
    can_turn &= mean * height <= horizontal_range[:, None] * (1 + OVERLAP) * np.sqrt((1 - mean) * (1 + mean))
    node, case = np.nonzero(can_turn.T)  # neighbours in the list share their layers
    right = _sine(fastest[case, node], far_speed[node]) * (1 + OVERLAP)
    # Where the gradient goes on below a node, a ray that only just passes it is left to the layer above: its sine at
    # the node is rounding error, and dX/dp the difference of two numbers as large as that sine is small.
    gradient, above = np.diff(node_speed) / np.diff(node_depth), np.maximum(node - 1, 0)
    goes_on = ((node > 0) & (node_depth[node] > lower[case]) & (node_speed[node] > fastest[case, above])
               & (np.abs(gradient[node] - gradient[above]) <= SAME_GRADIENT * gradient[node]))
    just_passed = JUST_PASSED * _sine(np.minimum(fastest[case, above], node_speed[node]), node_speed[node])
    return Intervals(case, node, np.where(goes_on, just_passed, TINY_SINE), right)


def _sine(speed: np.ndarray, turning_speed: np.ndarray) -> np.ndarray:
    """Return the sine, where the speed is ``speed``, of the ray that is horizontal where it is ``turning_speed``."""
    cosine = speed / turning_speed
    return np.sqrt((1 - cosine) * (1 + cosine))


def _in_batches(function: Callable[[SoundSpeedProfile, Cases, Intervals], tuple[np.ndarray, ...]],
                profile: SoundSpeedProfile, cases: Cases, intervals: Intervals) -> list[np.ndarray]:
    size = max(1, BATCH // (2 * profile.depth.size))
    parts = [function(profile, cases, intervals.some(slice(start, start + size)))
             for start in range(0, intervals.case.size, size)]
    return [np.concatenate(part) for part in zip(*parts)]


def _passed(profile: SoundSpeedProfile, cases: Cases, intervals: Intervals) -> tuple[Layers, np.ndarray, np.ndarray]:
    """Return the layers above the turning ones, the gradient of these, and the range asked for."""
    upper, lower, horizontal_range = (field[intervals.case] for field in cases)
    near = np.maximum(profile.depth[intervals.node], lower)
    layers = Layers.between(profile, upper, lower, near, passes=(1, 2))
    gradient = profile.gradients[intervals.node + 1]
    return layers, gradient, horizontal_range


def _judge(profile: SoundSpeedProfile, cases: Cases, intervals: Intervals) -> tuple[np.ndarray, ...]:
    """Return three masks of intervals: may hold the range, X is monotonic, X crosses the range."""
    layers, gradient, horizontal_range = _passed(profile, cases, intervals)
    passed, arc, steepness, share, arc_slope = [], [], [], [], []
    for sine in (intervals.left, intervals.right):
        cosine = np.sqrt((1 - sine) * (1 + sine))
        sines = layers.sines(sine, cosine)
        stretch = layers.arcs(sines).stretch
        parameter = cosine / layers.fastest
        passed.append(parameter * (stretch @ layers.passes))
        arc.append(TurningArc(parameter, gradient, sines[:, -1]).range)
        # -dX/d(sine) of a layer is steepness, which falls with the sine, times share, which grows; the arc's grows.
        smaller, larger = np.minimum(sines[:, :-1], sines[:, 1:]), np.maximum(sines[:, :-1], sines[:, 1:])
        steepness.append(stretch / larger / (cosine * layers.fastest)[:, None])
        share.append(sine[:, None] / smaller)
        arc_slope.append(arc[-1] * sine / (cosine * sines[:, -1]) ** 2)
    lowest, highest = passed[1] + arc[0], passed[0] + arc[1]
    possible = (lowest <= horizontal_range * (1 + OVERLAP)) & (highest >= horizontal_range * (1 - OVERLAP))
    slope_at_least = arc_slope[0] - (steepness[0] * share[1]) @ layers.passes
    slope_at_most = arc_slope[1] - (steepness[1] * share[0]) @ layers.passes
    monotonic = (slope_at_least > 0) | (slope_at_most < 0)
    crosses = (passed[0] + arc[0] < horizontal_range) != (passed[1] + arc[1] < horizontal_range)
    return possible, monotonic, crosses


def _solve(profile: SoundSpeedProfile, cases: Cases, brackets: Intervals) -> tuple[np.ndarray, ...]:
    """Close in on the ray in each bracket by Newton's method, halving where that leaves the bracket."""
    layers, gradient, horizontal_range = _passed(profile, cases, brackets)
    left, right = brackets.left.copy(), brackets.right.copy()
    sine = (left + right) / 2
    left_excess = _excess(layers, gradient, horizontal_range, left)[0]
    for _ in range(2 * HALVINGS):
        excess, slope = _excess(layers, gradient, horizontal_range, sine)
        on_left = (excess < 0) == (left_excess < 0)
        left, right = np.where(on_left, sine, left), np.where(on_left, right, sine)
        step = np.where(slope == 0, np.inf, -excess / np.where(slope == 0, 1, slope))
        stepped = sine + step
        stepped = np.where((stepped > left) & (stepped < right), stepped, (left + right) / 2)
        moved = np.where(np.abs(excess) <= ROUNDING * horizontal_range, 0, stepped - sine)
        sine = sine + moved
        if np.all(np.abs(moved) <= CONVERGED * sine):
            break
    cosine = np.sqrt((1 - sine) * (1 + sine))
    passed = layers.cross(sine, cosine)
    parameter = cosine / layers.fastest
    upper_sine, lower_sine, near_sine = passed.sines.T
    arc = TurningArc(parameter, gradient, near_sine)
    found = parameter * passed.range_per_parameter + arc.range
    return (
        brackets.case,
        # Fermat: the time to the range asked for follows from the time to the range found to second order.
        passed.travel_time + arc.time + parameter * (horizontal_range - found),
        passed.arc_length + arc.length,
        parameter,
        passed.range_slope + arc.slope,
        upper_sine,
        lower_sine,
        np.maximum(profile.depth[brackets.node], cases[1][brackets.case]) + arc.depth(layers.speed[:, -1]),
    )


def _excess(layers: Layers, gradient: np.ndarray, horizontal_range: np.ndarray,
            sine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return X - horizontal_range and dX/d(sine)."""
    cosine = np.sqrt((1 - sine) * (1 + sine))
    parameter = cosine / layers.fastest
    per_parameter, range_slope = layers.reach(sine, cosine)
    near_sine = layers.sines(sine, cosine)[:, -1]
    arc = TurningArc(parameter, gradient, near_sine).range
    slope = arc * sine / (cosine * near_sine) ** 2 - range_slope * sine / (cosine * layers.fastest)
    return parameter * per_parameter + arc - horizontal_range, slope


def _speed_integral(profile: SoundSpeedProfile, depth: np.ndarray) -> np.ndarray:
    """Return the integral of the sound speed [m^2/s] from the first node down to ``depth``."""
    node_depth, node_speed = profile.depth, profile.sound_speed
    to_node = np.r_[0.0, np.cumsum(np.diff(node_depth) * (node_speed[1:] + node_speed[:-1]) / 2)]
    above = np.maximum(np.searchsorted(node_depth, depth, side="right") - 1, 0)
    return to_node[above] + (depth - node_depth[above]) * (node_speed[above] + profile.at(depth)) / 2


def _halves(intervals: Intervals) -> Intervals:
    middle = (intervals.left + intervals.right) / 2
    return Intervals(np.r_[intervals.case, intervals.case], np.r_[intervals.node, intervals.node],
                     np.r_[intervals.left, middle], np.r_[middle, intervals.right])
