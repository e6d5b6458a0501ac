"""A course through way points: straight legs, joined by arcs or meeting in corners.

Between two legs that differ in heading by δ the course follows a circle of radius ``turn_radius`` R that touches both;
it leaves the first leg R tan(|δ| / 2) before the way point and so passes inside it. On an arc of curvature κ = ±1/R,
s after its start at heading h, the chord is s sinc(κ s / 2) long and heads for h + κ s / 2. With R = 0 the legs meet in
the way point, and the heading jumps there: a survey whose turns are not recorded.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

_BACK_DEG = 179.0                  # a turn beyond this leads back along the leg it came by
_MOST_POINTS = 1_000_000
_BLOCK = 2048                      # places rounded at once
# a cubic B-spline of width 1 about 0, by the share of its mean that falls to each node
_NODES = (np.arange(400) + 0.5) / 400 - 0.5
_WEIGHTS = np.where(np.abs(_NODES) < 0.25, 2 / 3 - 16 * _NODES ** 2 * (1 - 2 * np.abs(_NODES)),
                    4 / 3 * (1 - 2 * np.abs(_NODES)) ** 3)
_WEIGHTS /= _WEIGHTS.sum()


class Course:
    """Lay legs and turns through way points."""
    # points (N, 2) [m]; turn_radius [m]; length [m]; marks (N,) [m]

    def __init__(self, points: ArrayLike, turn_radius: float = 0.0):
        points = np.array(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or not 2 <= len(points) <= _MOST_POINTS:
            raise ValueError(f"way points: got {len(points) if points.ndim else 0}; give from two to {_MOST_POINTS}, "
                             "each as x and y.")
        if not (np.isfinite(points).all() and np.isfinite(turn_radius) and turn_radius >= 0):
            raise ValueError(f"way points: a coordinate or the turn radius {turn_radius!r} m is not a finite number "
                             "(of 0 or more); repair it.")
        steps = np.diff(points, axis=0)
        lengths = np.hypot(*steps.T)
        same = np.flatnonzero(~(lengths > 1e-6))
        if same.size:
            raise ValueError(f"way points {same[0] + 1} and {same[0] + 2} are the same place; leave one of them out.")
        headings = np.unwrap(np.arctan2(steps[:, 0], steps[:, 1]))
        turns = np.diff(headings)
        cuts = np.r_[0.0, self._cuts(turns, lengths, float(turn_radius)), 0.0]
        legs = lengths - cuts[:-1] - cuts[1:]
        along = steps / lengths[:, None]
        arcs = np.abs(turns) * turn_radius
        # leg, arc, leg, arc, ..., leg
        self._lengths = np.r_[np.stack([legs[:-1], arcs], -1).ravel(), legs[-1]]
        self._starts = np.concatenate([points[:-1] + cuts[:-1, None] * along,
                                       points[1:] - cuts[1:, None] * along], 1).reshape(-1, 2)[:-1]
        self._headings = np.repeat(headings, 2)[:-1]
        curvature = np.sign(turns) / turn_radius if turn_radius else np.zeros_like(turns)
        self._curvature = np.r_[np.stack([np.zeros(len(turns)), curvature], -1).ravel(), 0.0]
        self.has_arcs = bool(np.any(arcs > 0))
        self._begins = np.r_[0.0, np.cumsum(self._lengths)]
        self.length = float(self._begins[-1])
        self.marks = np.r_[0.0, self._begins[1:-1:2] + arcs / 2, self.length]

    @staticmethod
    def _cuts(turns: np.ndarray, lengths: np.ndarray, radius: float) -> np.ndarray:
        """Return the lengths [m] that the arc of each inner way point takes from the legs on both sides."""
        if radius == 0:
            return np.zeros(len(turns))
        back = np.flatnonzero(np.abs(turns) > np.deg2rad(_BACK_DEG))
        if back.size:
            raise ValueError(f"the course turns back on itself at way point {back[0] + 2}, where no arc of "
                             f"{radius:g} m fits; move a way point aside, or use a turn radius of 0.")
        tangents = np.r_[0.0, np.tan(np.abs(turns) / 2), 0.0]
        taken = tangents[:-1] + tangents[1:]
        tight = np.flatnonzero(radius * taken > lengths * (1 + 1e-12))
        if tight.size:
            leg = tight[0]
            room = np.min(lengths[taken > 0] / taken[taken > 0])
            raise ValueError(f"turns of {radius:g} m radius need {radius * taken[leg]:.1f} m of the {lengths[leg]:.1f} "
                             f"m between way points {leg + 1} and {leg + 2}; take a turn radius of at most "
                             f"{np.floor(room * 100) / 100:g} m, or 0 for corners.")
        return radius * tangents[1:-1]

    def rounded(self, distance: ArrayLike, width: float) -> tuple[np.ndarray, np.ndarray]:
        """Follow the course with its curvature growing and fading over a width [m], as a vessel's rate of turn does.

        The mean of the course over a cubic B-spline of that width: legs stay what they are, an arc of curvature κ keeps
        its centre and its rate of turn and loses the share 1 - sinc(κ width / 8)^4 of its radius (sinc x = sin(x) / x).
        """
        # distance (...) [m]; width [m] -> position (..., 2) [m], heading (...) [rad]
        distance = np.asarray(distance, dtype=np.float64)
        position, heading, curvature = self.at(distance)
        ends = self._part(distance - 0.5 * width), self._part(distance + 0.5 * width)
        # amid an arc
        share = np.sinc(curvature * width / (8 * np.pi)) ** 4
        inwards = (1 - share) * np.divide(1.0, curvature, out=np.zeros_like(curvature), where=curvature != 0)
        position = position + inwards[..., None] * np.stack([np.cos(heading), -np.sin(heading)], -1)
        turning = np.concatenate([[0], np.cumsum(self._curvature != 0)])
        mixed = (ends[0] != ends[1]) & (turning[ends[1] + 1] > turning[ends[0]])
        places, forward = distance[mixed], np.empty((np.count_nonzero(mixed), 2))
        mean = np.empty_like(forward)
        for start in range(0, len(places), _BLOCK):
            some = slice(start, start + _BLOCK)
            there, ahead, _ = self.at(places[some, None] + width * _NODES)
            mean[some] = np.einsum("n,pnx->px", _WEIGHTS, there)
            forward[some] = np.einsum("n,pnx->px", _WEIGHTS, np.stack([np.sin(ahead), np.cos(ahead)], -1))
        position[mixed] = mean
        turned = np.arctan2(forward[:, 0], forward[:, 1]) - heading[mixed]
        heading[mixed] += (turned + np.pi) % (2 * np.pi) - np.pi
        return position, heading

    def _part(self, distance: np.ndarray) -> np.ndarray:
        """Return the number of the leg or arc that distances lie on."""
        return np.clip(np.searchsorted(self._begins, distance, side="right") - 1, 0, len(self._lengths) - 1)

    def at(self, distance: ArrayLike, on: ArrayLike | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Follow the course, and beyond its ends straight on."""
        # distance (...) [m]; on (...) [m] -> position (..., 2) [m], heading (...) [rad], curvature (...) [rad/m]
        distance = np.asarray(distance, dtype=np.float64)
        leg = distance if on is None or self._curvature.any() else np.broadcast_to(on, distance.shape)
        part = self._part(leg)
        gone = distance - self._begins[part]
        half = 0.5 * self._curvature[part] * gone
        chord = gone * np.sinc(half / np.pi)
        bearing = self._headings[part] + half
        position = self._starts[part] + chord[..., None] * np.stack([np.sin(bearing), np.cos(bearing)], -1)
        return position, bearing + half, self._curvature[part]
