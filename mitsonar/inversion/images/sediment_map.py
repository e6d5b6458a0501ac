"""Map of the bed's strength, and of its sediments, from one sidescan image.

    S(cell) = S_0 + h(cell) [dB]                        h -> a plane and its remainder, in cells
    P(k | cell) ∝ exp(-(Ŝ - S_k)² / (2 (σ² + τ²)))      S_k -> levels of classes, σ -> deviation, τ -> within a class

The shape of the bed is known. Cells that no ray meets keep their prior, and all classes are equally likely there.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.gradients.records.scene_model import SceneModel

from ..fitting.answer import told_of
from ..fitting.classes import Classes
from ..fitting.priors import Prior
from .image_fit import Stage, check_keys, fit_image, image_answer
from .image_record import ImageRecord

STAGES = Stage(bins=4, steps=4, products=10), Stage(bins=2, steps=2, products=10)


@dataclass(frozen=True, kw_only=True)
class StrengthPrior:
    """Prior of a bed's strength.

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


def fit_sediment_map(model: SceneModel, image: xr.Dataset, key: str, *, looks: float = 1.0,
                     classes: dict[str, float] | None = None, prior: StrengthPrior = StrengthPrior(),
                     stages: Sequence[Stage] = STAGES, farthest: float | None = None, modes: int = 20,
                     state_file: FilePath | None = None,
                     told: Callable[[float, float], object] | None = None) -> xr.Dataset:
    """Fit a texture of the bed's strength to one image of a sidescan.

    Parameters
    ----------
    model, image, looks, stages, farthest, modes, state_file, told
        Arguments as in `heights.fit_heights`.
    key : str
        Key of the texture in decibels, such as ``bed.bsdf.mu_db.data``.
    classes : dict of float [dB]
        Strengths of sediments by name.
    prior : StrengthPrior
        Prior of the strength.

    Returns
    -------
    Dataset (row, column)
        ``start``, ``strength_db``, ``deviation``, ``prior_deviation`` [dB], ``resolved``; with classes, ``probability``
        (sediment, row, column) and ``label``, the number of the most likely sediment; ``misfit`` by step.

    Raises
    ------
    ValueError
        If the key is unknown or not a texture in decibels, or the record belongs to another sonar.
    """
    check_keys(model, [key])
    start = model.start[key]
    if start.ndim != 3 or start.shape[2] != 1 or "_db" not in key:
        raise ValueError(f"{key} has the shape {start.shape}; give the key of a bitmap of one channel in decibels, "
                         "such as bed.bsdf.mu_db.data")
    if classes is not None and len(classes) < 2:
        raise ValueError(f"{len(classes)} class is too few; give at least two, or leave them out")
    record = ImageRecord.of(image, model.shape, looks=looks, farthest=farthest)
    believed = Prior(deviation=prior.deviation_db, length=prior.length, spacing=(1.0, 1.0, 1.0), level=prior.level_db,
                     slope=prior.deviation_db / max(start.shape))
    fit = fit_image(model, record, {key: believed}, stages, first=3, modes=modes, state_file=state_file,
                    about=f"map {key}", told=told)
    strength, at = fit.parameters[key].over(start.shape[:2], "dB"), ("row", "column")
    said = f"{fit.told()}; {told_of('strength_db', strength.resolved, strength.uncertainty, 'dB')}"
    answer = image_answer(fit, "strength_db", at, strength, said)
    if classes is None:
        return answer
    sediments = Classes(values=tuple(classes.values()), spread=prior.within_db)
    odds = sediments.probabilities(strength.value.ravel(), strength.uncertainty.ravel()).T.reshape(-1, *start.shape[:2])
    return answer.assign(strength_db_probability=(("sediment", *at), odds, {"units": "1"}),
                         strength_db_class=(at, odds.argmax(0))).assign_coords(sediment=list(classes))
