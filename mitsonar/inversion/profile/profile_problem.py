"""Equations of `profile`, and the priors of water and bed.

    speeds      about the start, of deviation σ and covariance σ² (1 + √3 d / l) exp(-√3 d / l), d apart in depth
    bed         known: about the given depths; unknown: second differences from node to node of deviation `bed_bend`
    roll        about 0

The covariance is Matérn's of order 3/2 (Rasmussen and Williams, 2006, Gaussian Processes for Machine Learning,
eq. 4.17): profiles with a continuous gradient, which may change within a length l.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsonar.gradients.soundings.sounding_bed import BedGrid
from mitsonar.hydrography.detection.sounding_beams import SoundingBeams
from mitsonar.propagation.numpy_rays.profile_derivatives import hats
from mitsonar.water.profile import SoundSpeedProfile

from ..fitting.likelihood import huber
from ..fitting.steps import LONGER, trust_region_step
from .profile_answer import WELL, ProfileFit

if TYPE_CHECKING:
    from scipy import sparse

FAR = 1000.0                       # [m] from the start that an unknown bed may be


@dataclass(frozen=True, kw_only=True)
class ProfilePrior:
    """Prior deviations and lengths of a fit.

    Parameters
    ----------
    deviation : float [m/s]
        Deviation of the speeds about the start.
    length : float [m]
        Correlation length of the speeds in depth.
    head_deviation : float [m/s]
        Deviation of the head's own sound-speed sensor.
    bed_deviation : float [m]
        Deviation of a given bed; unused for an unknown bed.
    bed_bend : float [m]
        Deviation of the second differences of an unknown bed, from node to node.
    roll_deviation : float [rad]
        Deviation of a roll offset of all beams; 0: no offset.

    Raises
    ------
    ValueError
        If a number is not finite, or not above zero (the roll's: below zero).
    """

    deviation: float = 10.0
    length: float = 15.0
    head_deviation: float = 0.3
    bed_deviation: float = 0.1
    bed_bend: float = 3.0
    roll_deviation: float = 0.0

    def __post_init__(self):
        for one in fields(self):
            value = getattr(self, one.name)
            least = 0.0 if one.name == "roll_deviation" else 1e-9
            if not (np.isfinite(value) and value >= least):
                raise ValueError(f"profile prior: {one.name} is {value:g}; give a number above zero.")

    def covariance(self, depth: np.ndarray) -> np.ndarray:
        """Return that of the speeds at depths (K,) [m]: (K, K) [m²/s²]."""
        apart = np.sqrt(3) * np.abs(depth[:, None] - depth) / self.length
        return self.deviation ** 2 * (1 + apart) * np.exp(-apart)


def bed_precision(bed: BedGrid, prior: ProfilePrior, known: bool) -> sparse.csc_array:
    """Return the inverse covariance of the bed's depths, sparse (J, J) [1/m²]."""
    from scipy import sparse

    count = bed.depth.size
    if known:
        return sparse.csc_array(sparse.identity(count) / prior.bed_deviation ** 2)
    rows = [sparse.identity(count) / FAR]
    for nodes, other, along_x in ((bed.x.size, bed.y.size, True), (bed.y.size, bed.x.size, False)):
        if nodes < 3:
            continue
        second = sparse.diags_array([np.ones(nodes - 2), -2 * np.ones(nodes - 2), np.ones(nodes - 2)],
                                    offsets=[0, 1, 2], shape=(nodes - 2, nodes))
        one = sparse.identity(other)
        rows.append((sparse.kron(one, second) if along_x else sparse.kron(second, one)) / prior.bed_bend)
    stack = sparse.vstack(rows).tocsr()
    return sparse.csc_array(stack.T @ stack)


OUTLIER = 3.0                      # deviations beyond which a time counts less (Huber)
FIRST_RADIUS = 1.5                 # of the first step [prior deviations], as a root mean square
STILL = 0.02                       # of a node's deviation: a profile that moves by less stands still
TELLING = 0.1                      # a fall of the cost that nothing follows from: that of one deviation is 1
SAME_NOISE = 0.98
PATCH = 2                          # nodes to the side of a patch of the bed on which misfits go together


@dataclass(frozen=True, kw_only=True, eq=False)
class _ProfileState:
    """Values, their times' residuals and Jacobian."""

    speed: np.ndarray
    bed: np.ndarray
    roll: float
    rest: np.ndarray
    by_dense: np.ndarray               # (N, K + roll)
    by_bed: Any


class ProfileProblem:
    """All that stays the same from step to step."""

    def __init__(self, beams: SoundingBeams, start: SoundSpeedProfile, bed: BedGrid, prior: ProfilePrior, known: bool):
        from mitsonar.gradients.soundings.sounding_times import BED, ROLL, SPEED, SoundingTimes

        self.beams, self.start, self.bed, self.prior = beams, start, bed, prior
        self.rolls, self.known = prior.roll_deviation > 0, known
        self.names = SPEED, BED, ROLL
        self.model = SoundingTimes(beams, start, bed, (SPEED, BED, ROLL) if self.rolls else (SPEED, BED))
        self.covariance = prior.covariance(start.depth)
        self.bed_precision = bed_precision(bed, prior, known)
        # what second differences of an unknown bed are about is level, not the bed that it begins with
        self.bed_middle = bed.depth.ravel() if known else np.full(bed.depth.size, bed.depth.mean())
        # the head's sensor: one number, however many pings heard of it
        self.head_depth, self.head_speed = float(np.median(beams.depth)), float(np.median(beams.head_speed))
        self.head = hats(start, np.array([self.head_depth]))[0]
        sensor = np.outer(self.head, self.head) / prior.head_deviation ** 2
        self.precision = np.zeros((self.dense, self.dense))
        nodes = start.depth.size
        self.prior_precision = np.linalg.inv(self.covariance + 1e-9 * prior.deviation ** 2 * np.eye(nodes)) + sensor
        self.precision[:nodes, :nodes] = self.prior_precision
        if self.rolls:
            self.precision[-1, -1] = prior.roll_deviation ** -2

    @property
    def dense(self) -> int:
        return self.start.depth.size + self.rolls

    def first(self) -> _ProfileState:
        """Return the start, with the head's speed pulled to its sensor."""
        speed = np.array(self.start.sound_speed)
        return self.at(speed, self.bed.depth.ravel(), 0.0)

    def values(self, speed: np.ndarray, bed: np.ndarray, roll: float) -> dict[str, np.ndarray]:
        """Return them as the model takes them."""
        numbers = speed, bed.reshape(self.bed.depth.shape), np.array([roll])
        return dict(list(zip(self.names, numbers))[:3 if self.rolls else 2])

    def at(self, speed: np.ndarray, bed: np.ndarray, roll: float) -> _ProfileState:
        """Linearise about values."""
        speed_name, bed_name, roll_name = self.names
        line = self.model.linearised(self.values(speed, bed, roll))
        dense = line.jacobian[speed_name]
        if self.rolls:
            dense = np.hstack([dense, line.jacobian[roll_name]])
        return _ProfileState(speed=speed, bed=bed, roll=roll, rest=self.beams.travel_time - line.value, by_dense=dense,
                      by_bed=line.jacobian[bed_name])

    def cost(self, state: _ProfileState, noise: float) -> float:
        """Return Φ."""
        data = huber((state.rest / noise) ** 2, OUTLIER)[0].sum()
        dense, bed = self._off(state)
        sensor = (self.head @ state.speed - self.head_speed) / self.prior.head_deviation
        own = self.precision.copy()
        own[:self.start.depth.size, :self.start.depth.size] -= np.outer(self.head, self.head) / (
            self.prior.head_deviation ** 2)
        return float(data + dense @ own @ dense + sensor ** 2 + bed @ (self.bed_precision @ bed))

    def _off(self, state: _ProfileState) -> tuple[np.ndarray, np.ndarray]:
        """Return the deviations of values from the prior."""
        dense = state.speed - self.start.sound_speed
        return np.append(dense, state.roll) if self.rolls else dense, state.bed - self.bed_middle

    def normal(self, state: _ProfileState, noise: float) -> tuple[np.ndarray, np.ndarray, Any, np.ndarray]:
        """Weigh residuals, and give the data's normal matrix of the dense unknowns, D⁻¹ Eᵀ, D's solver, the weights."""
        from scipy.sparse.linalg import splu

        weight = huber((state.rest / noise) ** 2, OUTLIER)[1] / noise ** 2
        cross = state.by_bed.T @ (weight[:, None] * state.by_dense)                          # (J, K)
        scaled = state.by_bed.multiply(np.sqrt(weight)[:, None]).tocsc()
        solver = splu((scaled.T @ scaled + self.bed_precision).tocsc())
        return state.by_dense.T @ (weight[:, None] * state.by_dense), cross, solver, weight

    def fitted(self, noise: float, iterations: int, progress: Callable[[int, float], object] | None) -> ProfileFit:
        """Minimise Φ until nothing changes; the weight of the times follows their misfit, limited by their noise."""
        state, misfits, stopped = self.first(), [], "the iterations were used up"
        trusted, radius = max(noise, self.noise_found(state)), FIRST_RADIUS * np.sqrt(self.dense)
        for _ in range(iterations):
            new, moved, gained, radius = self.stepped(state, trusted, radius)
            if new is None:
                stopped = "no shorter step fits better"
                break
            state = new
            misfits.append(float(np.sqrt(np.mean(state.rest ** 2))))
            if progress is not None:
                progress(len(misfits), misfits[-1])
            before, trusted = trusted, max(noise, min(trusted, self.noise_found(state)))
            if (moved < STILL or gained < TELLING) and trusted > SAME_NOISE * before:
                stopped = "the profile stands still"
                break
        return self.answer(state, trusted, np.array(misfits), stopped)

    def stepped(self, state: _ProfileState, noise: float, radius: float) -> tuple[_ProfileState | None, float, float,
                                                                                  float]:
        """Return one step of SciPy's trust region over speeds and roll, the bed eliminated; None: none fits better."""
        nodes = self.start.depth.size
        dense, cross, solver, weight = self.normal(state, noise)
        off, bed_off = self._off(state)
        push = state.by_dense.T @ (weight * state.rest) - self.precision @ off
        # the head's sensor pulls to its own speed, not to the start's
        push[:nodes] += self.head * (self.head_speed - self.head @ self.start.sound_speed) / (
            self.prior.head_deviation ** 2)
        bed_push = state.by_bed.T @ (weight * state.rest) - self.bed_precision @ bed_off
        given, bed_step = solver.solve(cross), solver.solve(bed_push)
        schur = dense + self.precision - cross.T @ given
        lower = np.linalg.cholesky(0.5 * (schur + schur.T))
        cost, scale = self.cost(state, noise), np.full(self.dense, self.prior.deviation)
        scale[nodes:] = self.prior.roll_deviation

        score = np.linalg.solve(lower, cross.T @ bed_step - push)
        whole = np.linalg.norm(np.linalg.solve(lower.T, score) / scale)

        def there(step: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
            share = min(1.0, np.linalg.norm(step / scale) / whole)      # the bed's own step is shortened alike
            return (state.speed + step[:nodes], state.bed + share * bed_step - given @ step,
                    state.roll + (step[-1] if self.rolls else 0.0))

        def tried(step: np.ndarray) -> float:
            try:
                speed, bed, roll = there(step)
                rest = self.beams.travel_time - self.model.value(self.values(speed, bed, roll))
            except ValueError:                         # water that beams do not come down in
                return np.inf
            return 0.5 * self.cost(replace(state, speed=speed, bed=bed, roll=roll, rest=rest), noise)

        step = trust_region_step(score, lower.T, 0.5 * cost, tried, radius * scale)
        if step is None:
            return None, 0.0, 0.0, radius
        new, after = self.at(*there(step)), np.linalg.inv(schur)
        moved = float(np.sqrt(np.max((step ** 2 / np.diag(after))[:nodes])))
        return new, moved, cost - self.cost(new, noise), LONGER * float(np.linalg.norm(step / scale))

    def noise_found(self, state: _ProfileState) -> float:
        """Estimate the deviation of the times: by the median, which few outliers do not move."""
        count, unknown = len(self.beams), self.dense + self.bed_precision.shape[0]
        rest = max(count - unknown, count // 2)
        return float(np.median(np.abs(state.rest)) / 0.6745 * np.sqrt(count / rest))

    def answer(self, state: _ProfileState, noise: float, misfits: np.ndarray, stopped: str) -> ProfileFit:
        """Return the answer and its uncertainty."""
        nodes = self.start.depth.size
        dense, cross, solver, weight = self.normal(state, noise)
        given = solver.solve(cross)
        told = dense - cross.T @ given
        told = 0.5 * (told + told.T)
        inverse = np.linalg.inv(told + self.precision)
        after = _larger(inverse, inverse @ (self._scatter(state, weight, given) + self.precision) @ inverse)
        if self.rolls:                                 # for the singular values the roll is eliminated, too
            told = told[:nodes, :nodes] - np.outer(told[:nodes, -1], told[-1, :nodes]) / (
                told[-1, -1] + self.precision[-1, -1])
        after = after[:nodes, :nodes]
        prior = np.linalg.inv(self.precision[:nodes, :nodes])
        root = np.linalg.cholesky(0.5 * (prior + prior.T))
        squares, vectors = np.linalg.eigh(root.T @ told @ root)
        order = np.argsort(-squares)
        low, middle, high = np.percentile(self.model.places(self.values(state.speed, state.bed, state.roll))[:, 2],
                                          [2, 50, 98])
        deviation = np.sqrt(np.diag(after))
        share = _column(self.start, self.head_depth, middle)
        return ProfileFit(
            depth=np.array(self.start.depth), start=np.array(self.start.sound_speed), speed=state.speed,
            deviation=deviation, prior_deviation=np.sqrt(np.diag(prior)), told=self._told(deviation, low, high),
            directions=self._directions(state),
            singular_values=np.sqrt(np.maximum(squares[order], 0)), patterns=(root @ vectors[:, order]).T,
            column_mean=float(share @ state.speed), column_mean_deviation=float(np.sqrt(share @ after @ share)),
            bed_depths=np.array([low, middle, high]), bed=state.bed.reshape(self.bed.depth.shape), roll=state.roll,
            soundings=len(self.beams), noise=noise, misfit=misfits, head_depth=self.head_depth, stopped=stopped)

    def _scatter(self, state: _ProfileState, weight: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Return the covariance of the gradient on the dense unknowns, from residuals summed over patches."""
        rows = (state.by_dense - state.by_bed @ given) * (weight * state.rest)[:, None]
        sums = self._patches(state) @ rows
        return sums.T @ sums

    def _patches(self, state: _ProfileState) -> Any:
        """Return which soundings are on which patch of the bed: sparse (P, N) of ones."""
        from scipy import sparse

        j, i = np.divmod(np.asarray(state.by_bed.argmax(axis=1)).ravel(), self.bed.x.size)
        _, patch = np.unique((j // PATCH) * self.bed.x.size + i // PATCH, return_inverse=True)
        return sparse.csr_array((np.ones(len(patch)), (patch, np.arange(len(patch)))))

    def _directions(self, state: _ProfileState) -> float:
        """Return the rms distance between the directions from which a place of the bed is seen; 0 for a known bed.

        Along one line the direction changes evenly with the place: in each patch, the residual about a plane through
        the directions is the effect of other lines.
        """
        if self.known:
            return float("inf")
        beams, patches = self.beams, self._patches(state)
        places = self.model.places(self.values(state.speed, state.bed, state.roll))[:, :2]
        count = patches.sum(axis=1)
        own = places - patches.T @ ((patches @ places) / count[:, None])
        plane = np.concatenate([np.ones((len(own), 1)), own / own.std()], axis=1)
        matrix = (patches @ (plane[:, :, None] * plane[:, None]).reshape(len(plane), 9)).reshape(-1, 3, 3)
        matrix += 1e-6 * np.eye(3)                     # of patches with few soundings
        rest = np.zeros(patches.shape[0])
        for along in (beams.east, beams.north):
            sine = beams.slowness * beams.head_speed * along
            right = patches @ (plane * sine[:, None])
            rest += patches @ sine ** 2 - (right * np.linalg.solve(matrix, right[..., None])[..., 0]).sum(1)
        return float(np.median(np.sqrt(np.maximum(patches.T @ (rest / count), 0))))

    def _told(self, deviation: np.ndarray, low: float, high: float) -> np.ndarray:
        depth = self.start.depth
        inside = (depth >= low) & (depth <= high)
        at_head = np.abs(depth - self.head_depth) < 1.0
        return (inside & (deviation < WELL * self.prior.deviation)) | (
            at_head & (deviation < 2 * self.prior.head_deviation))


def _larger(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the second of two covariances, with no deviation less than the first's."""
    scale = np.sqrt(np.maximum(1, np.diag(one) / np.diag(other)))
    return scale[:, None] * other * scale


def _column(profile: SoundSpeedProfile, top: float, bottom: float) -> np.ndarray:
    """Return the weights of the nodes (K,) in the mean over depths."""
    edges = np.r_[top, profile.depth[(profile.depth > top) & (profile.depth < bottom)], bottom]
    ends = hats(profile, edges)
    return (np.diff(edges)[:, None] * (ends[1:] + ends[:-1]) / 2).sum(0) / (bottom - top)
