"""Unknowns from a speckled image: Gauss-Newton, coarse to fine, each step by LSMR.

    ẑ = argmin D(z) + |z|²           D -> the gamma deviance of sums of bins (`image_record`), z of deviation 1
    C = I - V diag(λ / (1 + λ)) Vᵀ    λ, V -> the largest eigenvalues of the weighted Jacobian's square, and vectors

Early stages sum many bins: brightness then is nearly linear in what is unknown. The first stage moves only the
unknowns that come first, a plane or a pose: far waves of a tilted bed else stand in for its tilt.
Each step is tried whole and halved until the sum falls; a stage ends when it no longer does, by 1 %.

References
----------
Fong and Saunders (2011), SIAM J. Sci. Comput. 33, 2950 (LSMR); Halko, Martinsson and
Tropp (2011), SIAM Rev. 53, 217 (its largest eigenvalues); Goodman (1976), J. Opt. Soc. Am. 66, 1145 (speckle).
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..gradients.model import ForwardModel, Linearised, Values
from .image_record import Comparison, ImageRecord

__all__ = ["COARSE_TO_FINE", "ImageFit", "Stage", "Unknowns", "fit_image", "posterior"]

LEAST_FALL = 0.01                  # of the sum, below which a stage ends
SHORTEST = 0.1                     # of a step
EXTRA = 10                         # directions drawn beyond those asked for


class Unknowns(Protocol):
    """What is unknown, as numbers of deviation 1 about 0.

    Attributes
    ----------
    size : int
    first : int
        How many the first stage moves.
    """

    size: int
    first: int

    def values(self, unknowns: np.ndarray) -> Values:
        """Give the parameters of unknowns (size,)."""
        ...

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Give how parameters move about unknowns, along a direction."""
        ...

    def pulled(self, unknowns: np.ndarray, gradients: Values) -> np.ndarray:
        """The transpose of `pushed`."""
        ...


@dataclass(frozen=True, kw_only=True)
class Stage:
    """Steps at one fineness.

    Attributes
    ----------
    bins : int
        That are summed.
    steps : int
        At most.
    products : int
        With the Jacobian and its transpose, at most, a step.
    first_only : bool
        Whether only the first unknowns move.
    """

    bins: int
    steps: int
    products: int = 20
    first_only: bool = False


COARSE_TO_FINE = (Stage(bins=8, steps=8, products=8, first_only=True), Stage(bins=8, steps=4, products=25),
                  Stage(bins=4, steps=3, products=25))


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageFit:
    """What a fit has found.

    Attributes
    ----------
    unknowns : (size,)
    about : Linearised
        The model there.
    comparison : Comparison
        Of the last stage.
    misfit : (steps + 1,)
        Deviance per sum after each step, of that step's stage.
    stopped : str
        Why it ended.
    """

    unknowns: np.ndarray
    about: Linearised
    comparison: Comparison
    misfit: np.ndarray
    stopped: str


def fit_image(model: ForwardModel, record: ImageRecord, unknowns: Unknowns, stages: Sequence[Stage] = COARSE_TO_FINE,
              *, start: np.ndarray | None = None, told: Callable[[int, int], None] | None = None) -> ImageFit:
    """Fit unknowns to an image.

    Parameters
    ----------
    model : ForwardModel
    record : ImageRecord
    unknowns : Unknowns
    stages : sequence of Stage
    start : (size,)
        Unknowns to begin with; without them, 0.
    told : callable
        Of steps done, and of all.
    """
    if not stages:
        raise ValueError("no stage was given; give one or more, or leave them out")
    z = np.zeros(unknowns.size) if start is None else np.array(start, float)
    about = model.linearised(unknowns.values(z))
    misfit, done, total = [], 0, sum(stage.steps for stage in stages)
    comparison, stopped = record.at(stages[0].bins), ""
    for stage in stages:
        comparison = record.at(stage.bins)
        if not misfit:
            misfit.append(comparison.deviance(about.value) / comparison.seen.size)
        moves = np.ones(unknowns.size)
        moves[unknowns.first:] = 0 if stage.first_only else 1
        before, stopped = _cost(comparison, about, z), "the steps that were asked for are done"
        for step in range(stage.steps):
            z, about, after = _stepped(model, comparison, unknowns, (z, about, before), moves, stage.products)
            misfit.append(comparison.deviance(about.value) / comparison.seen.size)
            if told is not None:
                told(done + step + 1, total)
            fallen, before = before - after, after
            if fallen < LEAST_FALL * before:
                stopped = "the last step made it less than 1 % better"
                break
        done += stage.steps
    return ImageFit(unknowns=z, about=about, comparison=comparison, misfit=np.array(misfit), stopped=stopped)


def _cost(comparison: Comparison, about: Linearised, z: np.ndarray) -> float:
    return comparison.deviance(about.value) + float(z @ z)


def _stepped(model: ForwardModel, comparison: Comparison, unknowns: Unknowns,
             now: tuple[np.ndarray, Linearised, float], moves: np.ndarray, products: int
             ) -> tuple[np.ndarray, Linearised, float]:
    """One step of Gauss-Newton; where none makes it better, the same again."""
    from scipy.sparse.linalg import LinearOperator, lsmr

    z, about, cost = now
    residual, forward, backward = _weighted(comparison, unknowns, z, about)
    count = residual.size
    operator = LinearOperator((count + z.size, z.size), dtype=float,
                              matvec=lambda v: np.concatenate([forward(moves * v.ravel()), v.ravel()]),
                              rmatvec=lambda w: moves * backward(w.ravel()[:count]) + w.ravel()[count:])
    found = lsmr(operator, np.concatenate([residual, -z]), atol=1e-5, btol=1e-5, maxiter=products)[0] * moves
    share = 1.0
    while share >= SHORTEST:
        there = z + share * found
        tried = model.linearised(unknowns.values(there))
        new = _cost(comparison, tried, there)
        if new < cost:
            return there, tried, new
        share /= 2
    return z, model.linearised(unknowns.values(z)), cost


def _weighted(comparison: Comparison, unknowns: Unknowns, z: np.ndarray, about: Linearised
              ) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]:
    """Residuals of unit deviation, and products with their Jacobian and its transpose."""
    residual, weight = comparison.residuals(about.value)

    def forward(direction: np.ndarray) -> np.ndarray:
        return weight * comparison.summed(about.forward(unknowns.pushed(z, direction)))

    def backward(cotangent: np.ndarray) -> np.ndarray:
        return unknowns.pulled(z, about.backward(comparison.transposed(weight * cotangent)))

    return residual, forward, backward


def posterior(fit: ImageFit, unknowns: Unknowns, modes: int) -> tuple[np.ndarray, np.ndarray]:
    """Give what the image tells best: information λ (modes,), falling, and unit vectors (modes, size).

    Along a vector the deviation falls from 1 to (1 + λ)^-1/2; across all of them it stays, so that what lies between
    the last λ and 0 is told as more uncertain than it is.

    Raises
    ------
    ValueError
        If none is asked for.
    """
    if modes < 1:
        raise ValueError(f"{modes} directions were asked for; give 1 or more")
    _, forward, backward = _weighted(fit.comparison, unknowns, fit.unknowns, fit.about)

    def squared(rows: np.ndarray) -> np.ndarray:
        return np.stack([backward(forward(row)) for row in rows])

    size = unknowns.size
    if modes + EXTRA >= size:
        basis = np.eye(size)
    else:
        drawn = np.random.default_rng(0).standard_normal((modes + EXTRA, size))
        basis = np.linalg.qr(squared(drawn).T)[0].T
    small = basis @ squared(basis).T
    values, vectors = np.linalg.eigh(0.5 * (small + small.T))
    order = np.argsort(values)[::-1][:modes]
    return np.maximum(values[order], 0), vectors.T[order] @ basis
