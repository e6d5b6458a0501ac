"""Where a target lies and how it is turned, from one sidescan image of it.

    v' = c + t + R(ψ, θ, φ) (v - c),    R = R_z(ψ) R_y(θ) R_x(φ)        c -> the middle of its vertices at the start

Shadows and outlines say most of it: make the model with ``edges``, whose gradients have them. A target must be near
enough at the start for its shadow and its image to overlap those of the answer.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..gradients.model import Values
from ..gradients.scene_model import SceneModel
from .image_fit import Stage, fit_image, posterior
from .image_record import ImageRecord

__all__ = ["PosePrior", "fit_pose"]

NAMES = "east", "north", "up", "yaw", "pitch", "roll"
STAGES = Stage(bins=6, steps=5, products=6), Stage(bins=2, steps=5, products=6)
STEP = 1e-4                        # of the rotation's derivative [rad]


@dataclass(frozen=True, kw_only=True)
class PosePrior:
    """Deviations beforehand; 0 holds still.

    Attributes
    ----------
    place : (float, float, float) [m]
        East, north, up.
    angles : (float, float, float) [rad]
        About the vertical, north and east.
    """

    place: tuple[float, float, float] = (0.5, 0.5, 0.1)
    angles: tuple[float, float, float] = (0.3, 0.05, 0.05)


class PoseUnknowns:
    """Six numbers that move a mesh.

    Parameters
    ----------
    start : (N, 3) [m]
    key : str
    prior : PosePrior
    """

    size = first = 6

    def __init__(self, start: np.ndarray, key: str, prior: PosePrior):
        self._start, self._key = start, key
        self._middle = 0.5 * (start.min(0) + start.max(0))
        self.deviation = np.array([*prior.place, *prior.angles], float)
        if self.deviation.shape != (6,) or np.any(self.deviation < 0) or not self.deviation.any():
            raise ValueError(f"a pose's deviations are {self.deviation.tolist()}; give six numbers, 0 or more, and not "
                             "all of them 0")

    def _moved(self, pose: np.ndarray) -> np.ndarray:
        (sz, sy, sx), (cz, cy, cx) = np.sin(pose[3:]), np.cos(pose[3:])
        turn = (np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
                @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]))
        return self._middle + pose[:3] + (self._start - self._middle) @ turn.T

    def _columns(self, unknowns: np.ndarray) -> np.ndarray:
        """How vertices move with each number, (6, N, 3)."""
        pose = self.deviation * unknowns
        return np.stack([deviation * (self._moved(pose + step) - self._moved(pose - step)) / (2 * STEP)
                         for deviation, step in zip(self.deviation, STEP * np.eye(6))])

    def values(self, unknowns: np.ndarray) -> Values:
        """Give the vertices."""
        return {self._key: self._moved(self.deviation * unknowns)}

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Give how vertices move."""
        return {self._key: np.tensordot(direction, self._columns(unknowns), 1)}

    def pulled(self, unknowns: np.ndarray, gradients: Values) -> np.ndarray:
        """The transpose of `pushed`."""
        return np.tensordot(self._columns(unknowns), gradients[self._key], 2)


def fit_pose(model: SceneModel, image: xr.Dataset, key: str, *, looks: float = 1.0, prior: PosePrior = PosePrior(),
             stages: Sequence[Stage] = STAGES, farthest: float | None = None,
             told: Callable[[int, int], None] | None = None) -> xr.Dataset:
    """Fit the pose of a target to one image of a sidescan.

    Parameters
    ----------
    model, image, looks, stages, farthest, told
        As of `heights.fit_heights`; the scene's bed is known.
    key : str
        Of the target's vertices, such as ``box.vertex_positions``.
    prior : PosePrior

    Returns
    -------
    Dataset (number)
        ``pose``, ``deviation``, ``prior_deviation`` of `NAMES` [m] and [rad], about the start; ``information`` by
        direction, whose numbers ``direction`` has; ``misfit`` by step.

    Raises
    ------
    ValueError
        If the key is unknown or no mesh's, or the record is another sonar's.
    """
    if key not in model.start:
        raise ValueError(f"the model has no parameter {key!r}; make it with that key: it has {', '.join(model.start)}")
    if model.start[key].ndim != 2 or model.start[key].shape[1] != 3:
        raise ValueError(f"{key} has the shape {model.start[key].shape}; give the key of a mesh's vertices")
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)
    unknowns = PoseUnknowns(model.start[key], key, prior)
    fit = fit_image(model, record, unknowns, stages, told=told)
    information, vectors = posterior(fit, unknowns, 6)
    spread = (vectors ** 2 / (1 + information)[:, None]).sum(0)
    units = {"units": "m, rad"}
    return xr.Dataset({"pose": ("number", unknowns.deviation * fit.unknowns, units),
                       "deviation": ("number", unknowns.deviation * np.sqrt(spread), units),
                       "prior_deviation": ("number", unknowns.deviation, units),
                       "information": ("mode", information), "direction": (("mode", "number"), vectors),
                       "misfit": ("step", fit.misfit)}, {"number": list(NAMES)},
                      {"kind": "pose from one sidescan image", "stopped": fit.stopped})
