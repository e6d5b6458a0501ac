"""Seabed heights from one sidescan image: how bright a place is tells its slope, and the first return the depth.

    z_v = z_0 + h(x_v, y_v),    µ = µ_0 e^g        h -> a plane and what bends it, g -> what the level is off

The start is a level bed at the depth of the first return. Slopes along the track are seen by what is nearer or farther,
and hardly by brightness; a level that is off is told from tilt by the two sides together. What no ray meets keeps what
was believed of it. Deviations are those of speckle, about the answer: a model that differs by its facets, its
navigation or its water comes on top.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.gradients.parameters.changes import DECIBELS, BoundChange, Heights, Log
from mitsonar.gradients.parameters.parametrisation import parametrised
from mitsonar.gradients.records.scene_model import SceneModel

from ..fitting.answer import told_of
from ..fitting.priors import Prior
from .image_fit import COARSE_TO_FINE, Stage, check_keys, fit_image, image_answer
from .image_record import ImageRecord

POOR = 1.5                         # of speckle's deviance, above which a bed does not explain its image


@dataclass(frozen=True, kw_only=True)
class HeightPrior:
    """Prior of a bed's heights.

    Attributes
    ----------
    deviation : float [m]
        Of what bends.
    length : float [m]
        Shorter waves are fainter.
    level : float [m]
        Deviation of the mean depth about that of the first return.
    slope : float [-]
        Deviation of the bed's tilt.
    gain_db : float [dB]
        Deviation of the level, and so of the bed's strength.
    """

    deviation: float = 0.4
    length: float = 4.0
    level: float = 0.5
    slope: float = 0.1
    gain_db: float = 2.0


@dataclass(frozen=True)
class OnGrid:
    """Heights of vertices as a grid (nx, ny), as `grid_of` numbers them: ``bed.heights`` as ``height``."""

    key: str
    number: np.ndarray

    def bound(self, start: np.ndarray, unit: str) -> BoundChange:
        """Return it for heights (V,); see `Change.bound`."""
        def spread(x: np.ndarray) -> np.ndarray:
            heights = np.zeros(start.size)
            heights[self.number] = x
            return heights

        return BoundChange(name="height", unit=unit, start=start[self.number], inner=spread,
                           push=lambda x, dx: spread(dx), pull=lambda x, weights: weights[self.number])


def fit_heights(model: SceneModel, image: xr.Dataset, key: str, *, strength: str | None = None, looks: float = 1.0,
                prior: HeightPrior = HeightPrior(), stages: Sequence[Stage] = COARSE_TO_FINE,
                farthest: float | None = None, modes: int = 60, state_file: FilePath | None = None,
                told: Callable[[float, float], object] | None = None) -> xr.Dataset:
    """Fit the heights of a bed to one image of a sidescan.

    Parameters
    ----------
    model : SceneModel
        Of the image's sonar and water; with ``key`` and, where it is given, ``strength`` among its parameters.
    image : Dataset
        Of the sidescan.
    key : str
        Of the bed's vertices, such as ``bed.vertex_positions``.
    strength : str
        Key of the bed's strength, such as ``bed.bsdf.strength``: it takes up a level that is off.
    looks : float
        Of a bin: 1 of raw speckle.
    prior : HeightPrior
    stages : sequence of Stage
    farthest : float [m]
        Slant range up to which the image counts; it should end before the bed does.
    modes : int
        Directions of which uncertainty is told.
    state_file : str or path
        As of `fit`.
    told : callable
        Of steps done, and of all.

    Returns
    -------
    Dataset (x, y)
        By the names of `Fit.to_dataset`: ``height``, ``height_start``, ``height_deviation``,
        ``height_prior_deviation`` [m], and ``height_resolved``, the share of the prior's variance that has gone;
        ``misfit`` by step; ``information`` by mode. Its attributes say what was seen.

    Raises
    ------
    ValueError
        If a key is unknown, a strength is not above zero, the vertices stand on no grid, or the record is another
        sonar's.
    """
    check_keys(model, [key], [] if strength is None else [strength])
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)
    depth = float(np.median(record.first_return - image["z"].values.astype(float)))
    x, y, number = grid_of(model.start[key])
    gain = [] if strength is None else [Log(strength)]
    spacing = float(np.mean(np.diff(x))), float(np.mean(np.diff(y)))
    priors = {f"{strength}_log": Prior(deviation=prior.gain_db / DECIBELS)} if gain else {}
    priors["height"] = Prior(mean=np.full(number.shape, -depth), deviation=prior.deviation, length=prior.length,
                             spacing=spacing, level=prior.level, slope=prior.slope)
    changed = parametrised(model, Heights(key), OnGrid(f"{key.rpartition('.')[0]}.heights", number), *gain)
    fit = fit_image(changed, record, priors, stages, first=3 + len(gain), modes=modes, state_file=state_file,
                    about=f"heights {key}", told=told)
    height = fit.parameters["height"]
    louder = float(DECIBELS * (fit.values[f"{strength}_log"] - fit.start[f"{strength}_log"]).item()) if gain else 0.0
    slopes = [float(np.mean(np.gradient(height.value, axis, axis=side))) for side, axis in enumerate((x, y))]
    said = (f"{fit.told()}; {told_of('height', height.resolved, height.uncertainty, 'm')}; "
            "deviations are of speckle alone: errors of the model come on top")
    poor = record.at(stages[-1].bins).over_speckle(fit.predicted)
    if poor > POOR:
        said += (f"; the image is {poor:.1f} times as far off as speckle alone would be: the bed is rougher than the "
                 "prior or the nodes allow, or the sonar, water or sediment is another, and heights may be wrong by "
                 "more than was told")
    answer = image_answer(fit, "height", ("x", "y"), height, said, gain_db=louder, slope_x=slopes[0],
                          slope_y=slopes[1], misfit_of_speckle=poor)
    return answer.assign_coords(x=("x", x, {"units": "m"}), y=("y", y, {"units": "m"}))


def grid_of(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the regular grid that vertices (N, 3) stand on in the plane."""
    # -> x [m], y [m]
    x, column = np.unique(np.round(positions[:, 0], 3), return_inverse=True)
    y, row = np.unique(np.round(positions[:, 1], 3), return_inverse=True)
    steps = [np.diff(axis) for axis in (x, y)]
    if len(x) * len(y) != len(positions) or min(len(x), len(y)) < 3 or any(np.ptp(d) > 0.02 * d.mean() for d in steps):
        raise ValueError(f"the {len(positions)} vertices stand on no regular grid along x and y; give the key of a "
                         "seabed or bathymetry that is not turned")
    number = np.full((len(x), len(y)), -1)
    number[column, row] = np.arange(len(positions))
    if np.any(number < 0):
        raise ValueError("two vertices stand on one place of the grid; give a bed of one height everywhere")
    return x, y, number
