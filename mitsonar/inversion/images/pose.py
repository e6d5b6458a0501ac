"""Where a target lies and how it is turned, from one sidescan image of it.

    v' = c + t + R(ψ, θ, φ) (v - c),    R = R_z(ψ) R_y(θ) R_x(φ)        c -> the middle of its vertices at the start

or the same of the ``to_world`` of a sphere, cylinder, disk or rectangle, about its origin (`gradients.rigid`).

Shadows and outlines say most of it: make the model with ``edges``, whose gradients have them. Where its shadow does not
overlap that of the answer there is no gradient towards it: places and turns that are spread over what is believed are
tried first, then steps along one number after the other, and Gauss-Newton begins at the best (Hooke and Jeeves 1961,
J. ACM 8, 212). Strengths and the track can be unknown beside the pose; its deviation then holds what they are off.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.gradients.model import Values
from mitsonar.gradients.parameters.changes import Rigid
from mitsonar.gradients.records.scene_model import SceneModel

from ..fit.answer import Fit, named
from .image_fit import Stage, fit_image, spread_of, unknowns_of
from .image_record import ImageRecord, saturated

NAMES = "east", "north", "up", "yaw", "pitch", "roll"
STAGES = Stage(bins=6, steps=3, products=12), Stage(bins=2, steps=5, products=12)
STEP = 1e-4                        # of the rotation's derivative [rad]
SPREAD, TRIED = 1.8, 32            # deviations that first tries reach, and how many there are
MOVED = 0, 1, 3                    # of `NAMES`: what they vary
SHARES, SWEEPS = (0.5, 0.25, 0.12), 3     # deviations that one number is moved by, and rounds at most at each
LEAST_VARIANCE = 0.01              # of the track's, that a wave of its offsets has at least
LEAST_FALL = 0.01                  # of the cost, below which rounds end


@dataclass(frozen=True, kw_only=True)
class PosePrior:
    """Deviations beforehand; 0 holds still.

    Attributes
    ----------
    place : (float, float, float) [m]
        East, north, up.
    angles : (float, float, float) [rad]
        About the vertical, north and east.
    level_db : float [dB]
        Of each strength that is unknown.
    track : float [m]
        Of the track in each direction, where it is unknown.
    pings : float
        Over which the track is off alike.
    """

    place: tuple[float, float, float] = (0.5, 0.5, 0.1)
    angles: tuple[float, float, float] = (0.3, 0.05, 0.05)
    level_db: float = 2.0
    track: float = 0.05
    pings: float = 5.0


class PoseUnknowns:
    """Six numbers that move a mesh or another shape, and beside them strengths and the track."""
    # start (N, 3) [m]

    first = 6

    def __init__(self, start: np.ndarray, key: str, prior: PosePrior, strengths: Values | None = None,
                 track: tuple[str, int] | None = None):
        self._body, self._key = Rigid(key, start), key
        self.deviation = np.array([*prior.place, *prior.angles], float)
        if self.deviation.shape != (6,) or np.any(self.deviation < 0) or not self.deviation.any():
            raise ValueError(f"a pose's deviations are {self.deviation.tolist()}; give six numbers, 0 or more, and not "
                             "all of them 0")
        if not (prior.level_db > 0 and prior.track > 0 and prior.pings > 0):
            raise ValueError(f"deviations of strengths and the track are {prior.level_db:g} dB and {prior.track:g} m, "
                             f"alike over {prior.pings:g} pings; give numbers above 0")
        self._strengths, self._gain = dict(strengths or {}), prior.level_db * np.log(10) / 10
        self._track, count = track if track is not None else ("", 0)
        ping = np.arange(count)
        alike = np.exp(-0.5 * ((ping[:, None] - ping) / prior.pings) ** 2)
        variance, waves = np.linalg.eigh(alike)
        kept = variance > LEAST_VARIANCE * variance.sum()
        self._root = prior.track * waves[:, kept] * np.sqrt(variance[kept])
        self._gains = slice(6, 6 + len(self._strengths))
        self.steady = self._gains.stop
        self.size = self.steady + 3 * self._root.shape[1]

    def _moved(self, pose: np.ndarray) -> np.ndarray:
        (sz, sy, sx), (cz, cy, cx) = np.sin(pose[3:]), np.cos(pose[3:])
        turn = (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
                @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]))
        return self._body.moved(turn, pose[:3])

    def _columns(self, unknowns: np.ndarray) -> np.ndarray:
        """How vertices or the transform move with each number, (6, N, 3) or (6, 4, 4)."""
        pose = self.deviation * unknowns[:6]
        return np.stack([deviation * (self._moved(pose + step) - self._moved(pose - step)) / (2 * STEP)
                         for deviation, step in zip(self.deviation, STEP * np.eye(6))])

    def values(self, unknowns: np.ndarray) -> Values:
        """Return the vertices or the transform, strengths and the track's offsets."""
        gains = np.exp(self._gain * unknowns[self._gains])
        found = {key: start * gain for (key, start), gain in zip(self._strengths.items(), gains)}
        if self._track:
            found[self._track] = self._root @ unknowns[self.steady:].reshape(-1, 3)
        return {self._key: self._moved(self.deviation * unknowns[:6]), **found}

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Return how they move."""
        gains = self._gain * direction[self._gains] * np.exp(self._gain * unknowns[self._gains])
        found = {key: start * gain for (key, start), gain in zip(self._strengths.items(), gains)}
        if self._track:
            found[self._track] = self._root @ direction[self.steady:].reshape(-1, 3)
        return {self._key: np.tensordot(direction[:6], self._columns(unknowns), 1), **found}

    def pulled(self, unknowns: np.ndarray, gradients: Values) -> np.ndarray:
        """The transpose of `pushed`."""
        gains = self._gain * np.exp(self._gain * unknowns[self._gains])
        parts = [np.tensordot(self._columns(unknowns), gradients[self._key], 2),
                 [np.sum(start * gradients[key]) * gain for (key, start), gain in zip(self._strengths.items(), gains)]]
        if self._track:
            parts.append((self._root.T @ gradients[self._track]).ravel())
        return np.concatenate(parts)


def searched(cost: Callable[[np.ndarray], float], size: int, moved: Sequence[int] = MOVED) -> np.ndarray:
    """Find unknowns (size,) of deviation 1 near the least cost, without gradients."""
    from scipy.stats import qmc

    tries = np.zeros((TRIED + 1, size))
    if moved:
        tries[1:, list(moved)] = SPREAD * (2 * qmc.Sobol(len(moved), scramble=False).random(TRIED) - 1)
    costs = [cost(one) for one in tries]
    best, least = tries[int(np.argmin(costs))], min(costs)
    for share in SHARES:
        for _ in range(SWEEPS):
            before = least
            for step in share * np.eye(size):
                for there in (best + step, best - step):
                    new = cost(there)
                    if new < least:
                        best, least = there, new
                        break
            if before - least < LEAST_FALL * before:
                break
    return best


def fit_pose(model: SceneModel, image: xr.Dataset, key: str, *, looks: float = 1.0, prior: PosePrior = PosePrior(),
             stages: Sequence[Stage] = STAGES, farthest: float | None = None,
             strengths: Sequence[str] = (), track: str | None = None,
             state_file: FilePath | None = None, told: Callable[[float, float], object] | None = None) -> xr.Dataset:
    """Fit the pose of a target to one image of a sidescan.

    Parameters
    ----------
    model, image, looks, stages, farthest, state_file, told
        As of `heights.fit_heights`; the scene's bed is known.
    key : str
        Of the target's vertices, such as ``box.vertex_positions``, or of the transform of a shape without facets, such
        as ``ball.to_world``.
    prior : PosePrior
    strengths : sequence of str
        Keys of strengths that are unknown too, such as ``sand.strength``, each one number.
    track : str
        Key of the track's offsets, such as ``sonar.position_offset``, which are unknown then.

    Returns
    -------
    Dataset (number)
        By the names of `Fit.to_dataset`: ``pose``, ``pose_start``, ``pose_deviation``, ``pose_prior_deviation`` of
        `NAMES` [m] and [rad], about the start, and ``pose_resolved``; ``information`` by mode, whose numbers
        ``direction`` has; ``misfit`` by step. Its attributes say what was seen.

    Raises
    ------
    ValueError
        If the key is unknown or neither of the two, or the record is another sonar's.
    """
    for name in (key, *strengths, *([track] if track else [])):
        if name not in model.start:
            raise ValueError(f"the model has no parameter {name!r}; make it with that key: it has "
                             f"{', '.join(model.start)}")
    for name in strengths:
        if model.start[name].size != 1:
            raise ValueError(f"{name} has {model.start[name].size} values; give the key of a strength that is one "
                             "number")
    if track and model.start[track].shape != (model.shape[0], 3):
        raise ValueError(f"{track} has the shape {model.start[track].shape}; give the key of the offsets of "
                         f"{model.shape[0]} pings in three directions")
    unknowns = PoseUnknowns(model.start[key], key, prior, {name: model.start[name] for name in strengths},
                            (track, model.shape[0]) if track else None)
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)

    def begin() -> np.ndarray:
        return _start(model, record, unknowns, stages[0])

    fit = fit_image(model, record, unknowns, stages, modes=unknowns.size, begin=begin, state_file=state_file,
                    about=f"pose {key}", told=told)
    return _answer(fit, unknowns, saturated(record.intensity))


def _start(model: SceneModel, record: ImageRecord, unknowns: PoseUnknowns, stage: Stage) -> np.ndarray:
    """Where Gauss-Newton begins: the track stands still until then."""
    sums, free = record.at(stage.bins), np.flatnonzero(unknowns.deviation)
    likelihood = sums.likelihood()
    some = np.concatenate([free, np.arange(6, unknowns.steady)])

    def all_of(z: np.ndarray) -> np.ndarray:
        found = np.zeros(unknowns.size)
        found[some] = z
        return found

    def cost(z: np.ndarray) -> float:
        seen = sums.summed(model.value(unknowns.values(all_of(z))))
        return 2 * likelihood.terms(seen).misfit + float(z @ z)

    return all_of(searched(cost, some.size, [int(np.searchsorted(free, one)) for one in MOVED if one in free]))


def _answer(fit: Fit, unknowns: PoseUnknowns, clipped: int) -> xr.Dataset:
    information, vectors = spread_of(fit)
    spread = (vectors[:, :6] ** 2 / (1 + information)[:, None]).sum(0)
    believed = unknowns.deviation
    resolved = np.where(believed > 0, 1 - spread, 0)
    found, deviation = believed * unknowns_of(fit)[:6], believed * np.sqrt(spread)
    said = [f"{name} is off by {found[number]:.3g} ± {deviation[number]:.2g} {'m' if number < 3 else 'rad'}, of which "
            f"the image told {100 * resolved[number]:.0f} %"
            for number, name in enumerate(NAMES) if believed[number] > 0]
    said.append(f"{clipped} bins are as loud as the recorder writes: a model without its full scale is too loud there, "
                "and the pose is off" if clipped
                else "deviations are those of speckle and of what was unknown beside the pose")
    return xr.Dataset({**named("pose", ("number",), "m, rad", value=found, start=np.zeros(6), deviation=deviation,
                               prior_deviation=believed, resolved=resolved),
                       "information": ("mode", information), "direction": (("mode", "number"), vectors[:, :6]),
                       "misfit": ("step", fit.deviance)}, {"number": list(NAMES)},
                      {"kind": "fit", "parameters": ["pose"], "stopped": fit.stopped, "observable": "; ".join(said)})
