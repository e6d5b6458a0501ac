"""Seabed heights from one sidescan image: brightness determines slopes, and the first return the depth.

    z_v = z_0 + h(x_v, y_v),    µ = µ_0 e^g        h -> a plane and its remainder, g -> error of the level

The start is a level bed at the depth of the first return. Slopes along the track change ranges, and hardly the
brightness; the two sides together separate tilt from an error of the level. Parts of the bed that no ray meets keep
their prior. Deviations are those of speckle about the answer; errors of the model, such as facets, navigation and
water, are not included.
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
        Standard deviation of the heights about a plane.
    length : float [m]
        Correlation length: shorter waves are weaker.
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
        Model of the image's sonar and water, with ``key`` and, if given, ``strength`` among its parameters.
    image : Dataset
        Image of a sidescan.
    key : str
        Key of the bed's vertices, such as ``bed.vertex_positions``.
    strength : str
        Key of the bed's strength, such as ``bed.bsdf.strength``, which absorbs an error of the level.
    looks : float
        Number of looks of a bin: 1 for raw speckle.
    prior : HeightPrior
        Prior of the heights.
    stages : sequence of Stage
        Stages of the fit, from coarse to fine.
    farthest : float [m]
        Slant range up to which the image counts; it should lie within the bed.
    modes : int
        Number of directions of the uncertainty.
    state_file : str or path
        File of the state, as in `fit`.
    told : callable
        Called with steps done and their total.

    Returns
    -------
    Dataset (x, y)
        Variables as in `Fit.to_dataset`: ``height``, ``height_start``, ``height_deviation``,
        ``height_prior_deviation`` [m], and ``height_resolved``, the removed share of the prior's variance; ``misfit``
        by step; ``information`` by mode. Its attributes describe what the image determined.

    Raises
    ------
    ValueError
        If a key is unknown, a strength is not above zero, the vertices form no grid, or the record belongs to another
        sonar.
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
    """Return the regular grid that vertices (N, 3) form in the horizontal plane."""
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
        raise ValueError("two vertices share one place of the grid; give a bed with a single height at each place")
    return x, y, number
