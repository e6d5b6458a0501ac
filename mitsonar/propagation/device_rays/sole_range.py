"""Sole range: within this range at most one ray leads from one depth to another.

Of a ray of parameter p that turns above two depths u < l, with W(p, d) its range from the turn down to a depth d,

    X = W(p, u) + W(p, l),      W and dW/dp grow with d

so that what holds in the corner of a cell of depths holds in all of it: X is no less than in the shallow corner, dX/dp
no more than in the deep one. X of direct rays grows with p until they run level at u, if sound is fastest there. They
continue as rays that turn just above, each the only ray to its points as long as dX/dp < 0. Beyond the p where that is
not proven, and on the other side from the start, every ray is at least as long as the least X: the sole range.

Intervals of p are steps of the sine at the lower side of the layer that rays turn in (s_n, its gradient g):

    W = s_n/(p g) + Σ p (c1 + c2) dz / (s1 + s2),    p² s_n dW/dp = -1/g + Σ p² (c1 + c2) dz s_n / (s1 s2 (s1 + s2))

each part bounded by its values at an interval's ends, as in `turned`. Rays of more turns are longer: one that turns
twice begins with one that turns above and holds one that turns below, and of both kinds no two are within the range.

A cell gives no bound for two depths within it. But every ray that turns is long if the depths differ by H: its sine
changes by at most 1 / R per metre of range, with R the radius of the tightest bend, and is zero at a turn, so that
|H| <= ∫ tan θ dx gives

    X >= √(H (2 R - H)),     R = min c / max |g|,     R where H is more

and a ray that does not turn is the only such one to its point: its X grows with p.
"""
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mitsonar.water.profile import SoundSpeedProfile

from ..numpy_rays.layer_arcs import LayerArc

CELLS = 224                    # approximate number of depth cells
SINE_STEP = 1.5e-3
BEYOND = 8                     # cells of the uniform water on either side, as deep together as the profile
TINY = 1e-300
STRAIGHT = 1e12                # [m] radius of practically straight rays


class SoleRange(NamedTuple):
    """Cells between edges; the last and the first reach as far as water does."""

    edge: np.ndarray  # (N+1,) [m]: increasing
    range: np.ndarray  # (N, N) [m]: by the cells of both depths
    radius: float  # [m]: of the tightest bend of any ray

    def places(self, top: np.ndarray, bottom: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the cell's number as a line over depth, slope and offset (2, K), in layers from top to bottom (K,)."""
        cell = np.clip(np.searchsorted(self.edge, (top + bottom) / 2) - 1, 0, len(self.edge) - 2)
        slope = 1 / np.diff(self.edge)[cell]
        return slope, cell - self.edge[cell] * slope


def sole_range(profile: SoundSpeedProfile) -> SoleRange:
    """Find for every two depths a range within which no two rays, direct or turned, lead from one to the other."""
    return _sole_range(np.asarray(profile.depth, float).tobytes(), np.asarray(profile.sound_speed, float).tobytes())


@lru_cache(maxsize=16)
def _sole_range(depth: bytes, speed: bytes) -> SoleRange:
    nodes, speeds = np.frombuffer(depth), np.frombuffer(speed)
    edge = _edges(nodes, speeds)
    above = _turned_above(nodes, speeds, edge)
    below = _turned_above(-nodes[::-1], speeds[::-1], -edge[::-1])[::-1, ::-1].T
    sole = np.minimum(above, below)
    sole = np.triu(sole) + np.triu(sole, 1).T
    sole.setflags(write=False)
    steepest = np.max(np.abs(np.diff(speeds) / np.diff(nodes)), initial=0.0)
    return SoleRange(edge, sole, float(speeds.min() / max(steepest, speeds.min() / STRAIGHT)))


def _edges(depth: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the edges of cells: the nodes, even steps between them, and some beyond."""
    thickness, change = np.diff(depth), np.abs(np.diff(speed))
    if not change.any():
        return np.array([depth[0] - 1.0, depth[-1] + 1.0])
    share = CELLS * (thickness / thickness.sum() + change / change.sum()) / 2
    edge, gathered = [depth[:1]], 0.0
    for k, part in enumerate(share):
        gathered += part
        if gathered > 0.7 or k == len(share) - 1:
            # thin layers share a cell
            edge.append(np.linspace(edge[-1][-1], depth[k + 1], max(int(round(gathered)), 1) + 1)[1:])
            gathered = 0.0
    beyond = (depth[-1] - depth[0]) * np.arange(1, BEYOND + 1) / BEYOND
    return np.concatenate([depth[0] - beyond[::-1], *edge, depth[-1] + beyond])


def _turned_above(depth: np.ndarray, speed: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Return the ranges (N, N) that rays turned above both cells allow; valid if the first cell is not below."""
    grid = np.unique(np.concatenate([depth, edge]))
    fast = np.interp(grid, depth, speed)
    at_edge = np.searchsorted(grid, edge)
    cells = len(edge) - 1
    steps = _steps(depth, speed)
    if not steps:
        return np.full((cells, cells), np.inf)
    node, near_speed, gradient, left, right = map(np.array, zip(*steps))
    shortest, slope = [], []
    for some in np.array_split(np.arange(len(node)), max(1, len(node) * len(grid) // 200000)):
        a, b = _bounds(grid, fast, at_edge, *(part[some] for part in (depth[node], near_speed, gradient, left, right)))
        shortest.append(a)
        slope.append(b)
    shortest, slope = np.concatenate(shortest), np.concatenate(slope)
    turn = depth[node] - (near_speed / np.sqrt((1 - right) * (1 + right)) - near_speed) / gradient  # shallowest of each
    # the outermost cells have no end
    slope[:, -1] = np.inf
    goes_on = _goes_on(grid, fast, at_edge)
    best = np.full((cells, cells), np.inf)
    for j in range(len(node)):
        if not np.isfinite(shortest[j]).any():
            continue
        first = np.searchsorted(edge[1:], turn[j], side="right")      # the cells whose lower side is below the turn
        last = np.flatnonzero(np.isfinite(shortest[j, :-1]))[-1] + 1
        if last <= first:
            continue
        some = np.s_[first:last, first:last]
        goes_on[some] &= slope[j, first + 1:last + 1, None] + slope[j, None, first + 1:last + 1] < 0
        least = shortest[j, first:last, None] + shortest[j, None, first:last]
        best[some] = np.minimum(best[some], np.where(goes_on[some], np.inf, least))
    return best


def _steps(depth: np.ndarray, speed: np.ndarray) -> list[tuple[int, float, float, float, float]]:
    """Return the sine intervals by layer, upwards: lower node, its speed, upward gradient, first and last sine."""
    steps = []
    for k in range(len(depth) - 2, -1, -1):
        if speed[k] > speed[k + 1]:
            cosine = speed[k + 1] / speed[k]
            steepest = np.sqrt((1 - cosine) * (1 + cosine))
            sine = np.linspace(0, steepest, int(np.ceil(steepest / SINE_STEP)) + 1)
            gradient = (speed[k] - speed[k + 1]) / (depth[k + 1] - depth[k])
            steps += [(k + 1, speed[k + 1], gradient, a, b) for a, b in zip(sine[:-1], sine[1:])]
    return steps


def _bounds(grid: np.ndarray, fast: np.ndarray, at_edge: np.ndarray, near: np.ndarray, near_speed: np.ndarray,
            gradient: np.ndarray, left: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least W and largest p² s_n dW/dp at the edges, (J, N+1); W is infinite where no ray passes."""
    near_index = np.searchsorted(grid, near)
    steep, level = (np.sqrt((1 - sine) * (1 + sine)) / near_speed for sine in (right, left))      # p, least and largest
    column = np.arange(len(grid))
    below = column > near_index[:, None]
    sines = []
    for p, sine in ((steep, right), (level, left)):
        cosine = p[:, None] * fast
        square = (1 - cosine) * (1 + cosine)
        square[np.arange(len(p)), near_index] = sine * sine
        sines.append(square)
    # where the steepest ray does not pass, no ray does
    blocked = np.maximum.accumulate(below & (sines[0] <= 0), axis=1)
    steepest, levelest = (np.sqrt(np.maximum(square, 0)) for square in sines)
    layers = np.diff(grid), fast[:-1], fast[1:]
    passed = below[:, 1:]                                              # grid layers that end below the near node
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        arcs = [LayerArc(*layers, sines[:, :-1], sines[:, 1:]) for sines in (steepest, levelest)]
        reach = np.where(passed, steep[:, None] * arcs[0].stretch, 0)
        share = np.maximum(_ratio(left[:, None], levelest[:, :-1]), right[:, None] / np.maximum(steepest[:, :-1], TINY))
        tilt = level[:, None] ** 2 * arcs[1].stretch * share / levelest[:, 1:]
        tilt = np.where(passed, np.where(np.isnan(tilt), np.inf, tilt), 0)
        # within the layer that they turn in
        turns_at = near - (1 / level - near_speed) / gradient
        arc = np.where(grid > turns_at[:, None], levelest, 0) / (level * gradient)[:, None]
        arc_tilt = -_ratio(right[:, None], steepest) / gradient[:, None]
    start = (left / (level * gradient))[:, None]
    zero = np.zeros((len(near), 1))
    shortest = np.where(below, start + np.concatenate([zero, np.cumsum(reach, 1)], 1), arc)
    slope = np.where(below, -1 / gradient[:, None] + np.concatenate([zero, np.cumsum(tilt, 1)], 1), arc_tilt)
    return np.where(blocked, np.inf, shortest)[:, at_edge], np.where(blocked, np.inf, slope)[:, at_edge]


def _ratio(sine: np.ndarray, of: np.ndarray) -> np.ndarray:
    """Return the ratio of two sines; 1 where both are 0, as a ray just turns at both places."""
    return np.where((sine == 0) & (of == 0), 1.0, sine / np.maximum(of, TINY))


def _goes_on(grid: np.ndarray, fast: np.ndarray, at_edge: np.ndarray) -> np.ndarray:
    """Return a mask (N, N): the flattest direct rays from the first cell become level there and nowhere below."""
    falls = np.array([np.all(np.diff(fast[a:b + 1]) <= 0) for a, b in zip(at_edge[:-1], at_edge[1:])])
    cells = len(falls)
    goes_on = np.zeros((cells, cells), bool)
    for i in np.flatnonzero(falls):
        lower = at_edge[i + 1]
        fastest = np.maximum.accumulate(fast[lower:])
        goes_on[i, i] = True
        goes_on[i, i + 1:] = fast[lower] >= fastest[at_edge[i + 2:] - lower]
    return goes_on
