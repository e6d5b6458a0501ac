"""Fit of a target's position and attitude to one sidescan image.

    v' = c + t + R(ψ, θ, φ) (v - c),    R = R_z(ψ) R_y(θ) R_x(φ)        c -> the middle of its vertices at the start

For a sphere, cylinder, disk or rectangle, the ``to_world`` is moved in the same way about its origin
(`gradients.rigid`).

Shadows and outlines determine most of the pose: make the model with ``edges``, whose gradients include them. If the
shadow of the start does not overlap the shadow of the answer, there is no gradient towards it. Therefore the fit first
tries poses spread over the prior, then steps along one number after the other, and begins at the best of them (Hooke
and Jeeves 1961, J. ACM 8, 212). Strengths and the track can be unknown too; the deviation of the pose then includes
their errors.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.device.rotations import mounting_matrix
from mitsonar.gradients.parameters.changes import DECIBELS, BoundChange, Log, RigidChange
from mitsonar.gradients.parameters.parametrisation import parametrised
from mitsonar.gradients.records.scene_model import SceneModel

from ..fitting.priors import Prior
from ..fitting.unknowns import Unknowns
from .image_fit import Stage, check_keys, fit_image, image_answer
from .image_record import ImageRecord, saturated

NAMES = "east", "north", "up", "yaw", "pitch", "roll"
STAGES = Stage(bins=6, steps=3, products=12), Stage(bins=2, steps=5, products=12)
STEP = 1e-4                        # of the rotation's derivative [rad]
SPREAD, TRIED = 1.8, 32            # deviations that first tries reach, and how many there are
MOVED = 0, 1, 3                    # of `NAMES`: what they vary
SHARES, SWEEPS = (0.5, 0.25, 0.12), 3     # deviations that one number is moved by, and rounds at most at each
LEAST_FALL = 0.01                  # of the cost, below which rounds end


@dataclass(frozen=True, kw_only=True)
class PosePrior:
    """Prior deviations of a pose; 0 fixes a number.

    Attributes
    ----------
    place : (float, float, float) [m]
        East, north, up.
    angles : (float, float, float) [rad]
        Rotations about the vertical, north and east.
    level_db : float [dB]
        Deviation of each unknown strength.
    track : float [m]
        Deviation of an unknown track in each direction.
    pings : float
        Correlation length of the track's error, in pings.
    """

    place: tuple[float, float, float] = (0.5, 0.5, 0.1)
    angles: tuple[float, float, float] = (0.3, 0.05, 0.05)
    level_db: float = 2.0
    track: float = 0.05
    pings: float = 5.0

    def __post_init__(self):
        deviation = np.array([*self.place, *self.angles], float)
        if deviation.shape != (6,) or np.any(deviation < 0) or not deviation.any():
            raise ValueError(f"a pose's deviations are {deviation.tolist()}; give six numbers, 0 or more, and not all "
                             "of them 0")
        if not (self.level_db > 0 and self.track > 0 and self.pings > 0):
            raise ValueError(f"deviations of strengths and the track are {self.level_db:g} dB and {self.track:g} m, "
                             f"alike over {self.pings:g} pings; give numbers above 0")


@dataclass(frozen=True)
class TurnedModel:
    """Displacement and rotation of a shape: `NAMES`, all 0 at the start; ``box.vertex_positions`` as ``pose``."""

    key: str

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return it for vertices (V, 3) or a transform (4, 4); see `Change.bound`."""
        body = RigidChange(self.key, start)

        def moved(pose: np.ndarray) -> np.ndarray:
            return body.moved(mounting_matrix(*pose[:2:-1]), pose[:3])

        def columns(pose: np.ndarray) -> np.ndarray:
            return np.stack([(moved(pose + step) - moved(pose - step)) / (2 * STEP) for step in STEP * np.eye(6)])

        return BoundChange(name="pose", unit="m, rad", start=np.zeros(6), inner=moved,
                           push=lambda x, dx: np.tensordot(dx, columns(x), 1),
                           pull=lambda x, weights: np.tensordot(columns(x), weights, 2))


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
        Arguments as in `heights.fit_heights`; the scene's bed is known.
    key : str
        Key of the target's vertices, such as ``box.vertex_positions``, or of the transform of a shape without facets,
        such as ``ball.to_world``.
    prior : PosePrior
        Prior deviations of the pose.
    strengths : sequence of str
        Keys of unknown strengths, such as ``sand.strength``, each one number.
    track : str
        Key of the unknown offsets of the track, such as ``sonar.position_offset``.

    Returns
    -------
    Dataset (number)
        Variables as in `Fit.to_dataset`: ``pose``, ``pose_start``, ``pose_deviation``, ``pose_prior_deviation`` of
        `NAMES` [m] and [rad], about the start, and ``pose_resolved``; ``information`` and the numbers ``direction`` by
        mode; ``misfit`` by step. Its attributes describe what the image determined.

    Raises
    ------
    ValueError
        If the key is unknown or of another type, or the record belongs to another sonar.
    """
    check_keys(model, [key, *([track] if track else [])], strengths)
    if track and model.start[track].shape != (model.shape[0], 3):
        raise ValueError(f"{track} has the shape {model.start[track].shape}; give the key of the offsets of "
                         f"{model.shape[0]} pings in three directions")
    changed = parametrised(model, TurnedModel(key), *(Log(name) for name in strengths))
    deviation = np.array([*prior.place, *prior.angles], float)
    priors = {"pose": Prior(deviation=deviation)}
    priors |= {f"{name}_log": Prior(deviation=prior.level_db / DECIBELS) for name in strengths}
    if track:
        priors[track] = Prior(deviation=prior.track, length=prior.pings, spacing=(1.0, np.inf))
    record, free = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest), np.flatnonzero(deviation)

    def begin() -> np.ndarray:
        """Return the unknowns at the start, where the track has no error."""
        sums, unknowns = record.at(stages[0].bins), Unknowns(changed, priors)
        likelihood, steady = sums.likelihood(), free.size + len(strengths)

        def whole(z: np.ndarray) -> np.ndarray:
            return np.append(z, np.zeros(unknowns.size - steady))

        def cost(z: np.ndarray) -> float:
            seen = sums.summed(changed.value(unknowns.values(whole(z))))
            return 2 * likelihood.terms(seen).misfit + float(z @ z)

        return whole(searched(cost, steady, [int(np.searchsorted(free, one)) for one in MOVED if one in free]))

    fit = fit_image(changed, record, priors, stages, first=free.size, modes=len(deviation) * model.shape[0],
                    begin=begin, state_file=state_file, about=f"pose {key}", told=told)
    pose, clipped = fit.parameters["pose"], saturated(record.intensity)
    said = [f"{NAMES[one]} is off by {pose.value[one]:.3g} ± {pose.uncertainty[one]:.2g} {'m' if one < 3 else 'rad'}, "
            f"of which the image told {100 * pose.resolved[one]:.0f} %" for one in free]
    said.append(f"{clipped} bins are as loud as the recorder writes: a model without its full scale is too loud there, "
                "and the pose is off" if clipped
                else "deviations are those of speckle and of what was unknown beside the pose")
    answer = image_answer(fit, "pose", ("number",), pose, "; ".join(said)).assign_coords(number=list(NAMES))
    return answer.assign(direction=(("mode", "number"), pose.seen / np.where(deviation > 0, deviation, 1)))
