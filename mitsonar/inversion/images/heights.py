"""Seabed heights from one sidescan image: how bright a place is tells its slope, and the first return the depth.

    z_v = z_0 + h(x_v, y_v),    µ = µ_0 10^(g/10)        h -> `SmoothField`, g -> what the level is off

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
from mitsonar.gradients.model import Values
from mitsonar.gradients.records.scene_model import SceneModel

from ..fit.answer import Fit, named, told_of
from ..fit.smooth_field import SmoothField, grid_of
from .image_fit import COARSE_TO_FINE, Stage, fit_image, spread_of, unknowns_of
from .image_record import ImageRecord

POOR = 1.5                         # of speckle's deviance, above which a bed does not explain its image


@dataclass(frozen=True, kw_only=True)
class HeightPrior:
    """What is believed of a bed beforehand.

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


class HeightUnknowns:
    """Heights of a bed and its strength, as unknowns."""
    # depth [m]; x [m]; y [m]

    def __init__(self, model: SceneModel, key: str, strength: str | None, depth: float, prior: HeightPrior):
        self._key, self._strength = key, strength
        self._start = model.start[key].copy()
        self.x, self.y, self._number = grid_of(self._start)
        self._start[:, 2] = -depth
        self._gain = prior.gain_db * np.log(10) / 10
        self._mu = None if strength is None else model.start[strength]
        spacing = float(np.mean(np.diff(self.x))), float(np.mean(np.diff(self.y)))
        self.field = SmoothField((len(self.x), len(self.y)), spacing, deviation=prior.deviation, length=prior.length,
                                 level=prior.level, slope=prior.slope)
        self._gains = 0 if strength is None else 1
        self.size, self.first = self.field.size + self._gains, self.field.plane + self._gains

    def heights(self, unknowns: np.ndarray) -> np.ndarray:
        """Return z (nx, ny) [m] of unknowns."""
        return self._start[self._number, 2] + self.field.of(unknowns[self._gains:])

    def gain_db(self, unknowns: np.ndarray) -> float:
        """Return how much stronger the bed is [dB] than in the scene."""
        return float(10 / np.log(10) * self._gain * unknowns[0]) if self._gains else 0.0

    def values(self, unknowns: np.ndarray) -> Values:
        """Return vertices and strength of unknowns."""
        positions = self._start.copy()
        positions[self._number, 2] = self.heights(unknowns)
        found = {self._key: positions}
        if self._strength is not None and self._mu is not None:
            found[self._strength] = self._mu * np.exp(self._gain * unknowns[0])
        return found

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Return how vertices and strength move along a direction."""
        positions = np.zeros_like(self._start)
        positions[self._number, 2] = self.field.of(direction[self._gains:])
        found = {self._key: positions}
        if self._strength is not None and self._mu is not None:
            found[self._strength] = self._mu * np.exp(self._gain * unknowns[0]) * self._gain * direction[0]
        return found

    def pulled(self, unknowns: np.ndarray, gradients: Values) -> np.ndarray:
        """The transpose of `pushed`."""
        field = self.field.transposed(gradients[self._key][self._number, 2])
        if self._strength is None or self._mu is None:
            return field
        gain = np.sum(gradients[self._strength] * self._mu) * np.exp(self._gain * unknowns[0]) * self._gain
        return np.concatenate([[gain], field])


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
        If a key is unknown, the vertices stand on no grid, or the record is another sonar's.
    """
    for name in (key, strength):
        if name is not None and name not in model.start:
            raise ValueError(f"the model has no parameter {name!r}; make it with that key: it has "
                             f"{', '.join(model.start)}")
    if strength is not None and model.start[strength].size != 1:
        raise ValueError(f"{strength} has {model.start[strength].size} values; give the key of a strength that is one "
                         "number, or none")
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)
    depth = float(np.median(record.first_return - image["z"].values.astype(float)))
    unknowns = HeightUnknowns(model, key, strength, depth, prior)
    fit = fit_image(model, record, unknowns, stages, modes=modes, state_file=state_file, about=f"heights {key}",
                    told=told)
    answer = _answer(fit, unknowns)
    poor = record.at(stages[-1].bins).over_speckle(fit.predicted)
    answer.attrs["misfit_of_speckle"] = poor
    if poor > POOR:
        answer.attrs["observable"] += (
            f"; the image is {poor:.1f} times as far off as speckle alone would be: the bed is rougher than the prior "
            "or the nodes allow, or the sonar, water or sediment is another, and heights may be wrong by more than was "
            "told")
    return answer


def _answer(fit: Fit, unknowns: HeightUnknowns) -> xr.Dataset:
    found = unknowns_of(fit)
    start, height = unknowns.heights(np.zeros(unknowns.size)), unknowns.heights(found)
    information, vectors = spread_of(fit)
    patterns = np.stack([unknowns.heights(vector) - start for vector in vectors])
    prior = unknowns.field.prior_deviation()
    gone = np.tensordot(information / (1 + information), patterns ** 2, 1)
    deviation = np.sqrt(np.maximum(prior ** 2 - gone, 0))
    resolved = np.clip(gone / prior ** 2, 0, 1)
    slopes = [float(np.mean(np.gradient(height, axis, axis=number)))
              for number, axis in enumerate((unknowns.x, unknowns.y))]
    data = xr.Dataset(
        {**named("height", ("x", "y"), "m", value=height, start=start, deviation=deviation, prior_deviation=prior,
                 resolved=resolved),
         "misfit": ("step", fit.deviance, {"units": "1"}), "information": ("mode", information, {"units": "1"})},
        {"x": ("x", unknowns.x, {"units": "m"}), "y": ("y", unknowns.y, {"units": "m"})})
    told = (f"{fit.told()}; {told_of('height', resolved, deviation, 'm')}; "
            "deviations are of speckle alone: errors of the model come on top")
    return data.assign_attrs(
        kind="fit", parameters=["height"], stopped=fit.stopped, observable=told,
        gain_db=unknowns.gain_db(found), slope_x=slopes[0], slope_y=slopes[1])
