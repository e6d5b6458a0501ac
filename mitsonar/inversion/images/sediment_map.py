"""A map of the bed's strength from one sidescan image, and of sediments.

    S(cell) = S_0 + h(cell) [dB]                        h -> `SmoothField`, in cells of a texture
    P(k | cell) ∝ exp(-(Ŝ - S_k)² / (2 (σ² + τ²)))      S_k -> levels of classes, σ -> deviation, τ -> within one

The bed's shape is known here. Cells that no ray meets keep what was believed of them, and their classes are even.
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
from ..fit.smooth_field import SmoothField
from .image_fit import Stage, fit_image, spread_of, unknowns_of
from .image_record import ImageRecord

STAGES = Stage(bins=4, steps=4, products=10), Stage(bins=2, steps=2, products=10)


@dataclass(frozen=True, kw_only=True)
class StrengthPrior:
    """What is believed of a bed's strength beforehand.

    Attributes
    ----------
    deviation_db : float [dB]
        About the mean.
    length : float [cells]
        Shorter waves are fainter.
    level_db : float [dB]
        Deviation of the mean about that of the scene.
    within_db : float [dB]
        Deviation within a class.
    """

    deviation_db: float = 6.0
    length: float = 1.5
    level_db: float = 6.0
    within_db: float = 1.0


class StrengthUnknowns:
    """Cells of a texture in decibels, as unknowns."""
    # start [dB]

    def __init__(self, start: np.ndarray, key: str, prior: StrengthPrior):
        self._start, self._key = start, key
        self.field = SmoothField((start.shape[0], start.shape[1]), (1.0, 1.0), deviation=prior.deviation_db,
                                 length=prior.length, level=prior.level_db,
                                 slope=prior.deviation_db / max(start.shape))
        self.size, self.first = self.field.size, self.field.plane

    def strength_db(self, unknowns: np.ndarray) -> np.ndarray:
        """Return strengths (ny, nx) [dB]."""
        return self._start[:, :, 0] + self.field.of(unknowns)

    def values(self, unknowns: np.ndarray) -> Values:
        """Return the texture."""
        return {self._key: self.strength_db(unknowns)[:, :, None]}

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Return how the texture moves."""
        return {self._key: self.field.of(direction)[:, :, None]}

    def pulled(self, unknowns: np.ndarray, gradients: Values) -> np.ndarray:
        """The transpose of `pushed`."""
        return self.field.transposed(gradients[self._key][:, :, 0])


def fit_sediment_map(model: SceneModel, image: xr.Dataset, key: str, *, looks: float = 1.0,
                     classes: dict[str, float] | None = None, prior: StrengthPrior = StrengthPrior(),
                     stages: Sequence[Stage] = STAGES, farthest: float | None = None, modes: int = 20,
                     state_file: FilePath | None = None,
                     told: Callable[[float, float], object] | None = None) -> xr.Dataset:
    """Fit a texture of the bed's strength to one image of a sidescan.

    Parameters
    ----------
    model, image, looks, stages, farthest, modes, state_file, told
        As of `heights.fit_heights`.
    key : str
        Of the texture, such as ``bed.bsdf.mu_db.data``; in decibels.
    classes : dict of float [dB]
        Strengths of sediments by name.
    prior : StrengthPrior

    Returns
    -------
    Dataset (row, column)
        ``start``, ``strength_db``, ``deviation``, ``prior_deviation`` [dB], ``resolved``; with classes, ``probability``
        (sediment, row, column) and ``label``, the number of the likeliest; ``misfit`` by step.

    Raises
    ------
    ValueError
        If the key is unknown or no texture in decibels, or the record is another sonar's.
    """
    if key not in model.start:
        raise ValueError(f"the model has no parameter {key!r}; make it with that key: it has {', '.join(model.start)}")
    start = model.start[key]
    if start.ndim != 3 or start.shape[2] != 1 or "_db" not in key:
        raise ValueError(f"{key} has the shape {start.shape}; give the key of a bitmap of one channel in decibels, "
                         "such as bed.bsdf.mu_db.data")
    if classes is not None and len(classes) < 2:
        raise ValueError(f"{len(classes)} class was given; give two or more, or none")
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)
    unknowns = StrengthUnknowns(start, key, prior)
    fit = fit_image(model, record, unknowns, stages, modes=modes, state_file=state_file, about=f"map {key}", told=told)
    return _answer(fit, unknowns, prior, classes)


def _answer(fit: Fit, unknowns: StrengthUnknowns, prior: StrengthPrior, classes: dict[str, float] | None) -> xr.Dataset:
    before, strength = unknowns.strength_db(np.zeros(unknowns.size)), unknowns.strength_db(unknowns_of(fit))
    information, vectors = spread_of(fit)
    patterns = np.stack([unknowns.field.of(vector) for vector in vectors])
    believed = unknowns.field.prior_deviation()
    gone = np.tensordot(information / (1 + information), patterns ** 2, 1)
    deviation = np.sqrt(np.maximum(believed ** 2 - gone, 0))
    at = ("row", "column")
    resolved = np.clip(gone / believed ** 2, 0, 1)
    told = fit.told() + "; " + told_of("strength_db", resolved, deviation, "dB")
    data = xr.Dataset({**named("strength_db", at, "dB", value=strength, start=before, deviation=deviation,
                               prior_deviation=believed, resolved=resolved),
                       "misfit": ("step", fit.deviance, {"units": "1"}),
                       "information": ("mode", information, {"units": "1"})},
                      attrs={"kind": "fit", "parameters": ["strength_db"], "stopped": fit.stopped, "observable": told})
    if classes is None:
        return data
    probability = _probabilities(strength, deviation, np.array(list(classes.values())), prior.within_db)
    return data.assign(strength_db_probability=(("sediment", *at), probability, {"units": "1"}),
                       strength_db_class=(at, probability.argmax(0))).assign_coords(sediment=list(classes))


def _probabilities(strength: np.ndarray, deviation: np.ndarray, levels: np.ndarray, within: float) -> np.ndarray:
    """Probabilities (K, ny, nx) of classes, all as likely beforehand."""
    exponent = -0.5 * (strength - levels[:, None, None]) ** 2 / (deviation ** 2 + within ** 2)
    weight = np.exp(exponent - exponent.max(0))
    return weight / weight.sum(0)
