"""Unknowns from a speckled image by the generic fit: a model by them, of sums of bins, coarse to fine.

    F_k(z) = S_k F(x(z))           z -> `ImageUnknowns`, of deviation 1; S_k -> sums of k bins (`image_record`)

Sums of many bins come first: brightness is then nearly linear in what is unknown. The first stage moves only the
unknowns that come first, a plane or a pose: far waves of a tilted bed else stand in for its tilt.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.gradients.model import ForwardModel, Linearised, Values

from ..fit.answer import Fit
from ..fit.fitting import fit
from ..fit.gauss_newton import GaussNewton
from ..fit.iteration import FitStage, Stopping
from ..fit.priors import Prior
from .image_record import Comparison, ImageRecord

UNKNOWNS = "unknowns"              # their name in the generic fit
LEAST_FALL = 0.01                  # of the misfit, below which a stage ends
TOLERANCE = 1e-5                   # of a step's least squares


class ImageUnknowns(Protocol):
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
        """Return the parameters of unknowns (size,)."""
        ...

    def pushed(self, unknowns: np.ndarray, direction: np.ndarray) -> Values:
        """Return how parameters move about unknowns, along a direction."""
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


class SummedModel:
    """A model by unknowns, whose record is sums of bins: a `ForwardModel`."""

    def __init__(self, model: ForwardModel, unknowns: ImageUnknowns, sums: Comparison):
        self._model, self._unknowns, self._sums = model, unknowns, sums
        self.start = {UNKNOWNS: np.zeros(unknowns.size)}
        self.units = {UNKNOWNS: "1"}

    def value(self, values: Values) -> np.ndarray:
        """Return sums; see `ForwardModel.value`."""
        return self._sums.summed(self._model.value(self._unknowns.values(values[UNKNOWNS])))

    def linearised(self, values: Values) -> SummedLine:
        """Return sums about values; see `ForwardModel.linearised`."""
        at = np.asarray(values[UNKNOWNS], float)
        return SummedLine(self._model.linearised(self._unknowns.values(at)), self._unknowns, self._sums, at)


class SummedLine:
    """A `SummedModel` about some unknowns: see `model.Linearised`."""

    def __init__(self, line: Linearised, unknowns: ImageUnknowns, sums: Comparison, at: np.ndarray):
        self._line, self._unknowns, self._sums, self._at = line, unknowns, sums, at
        self.value = sums.summed(line.value)

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        return self._sums.summed(self._line.forward(self._unknowns.pushed(self._at, tangents[UNKNOWNS])))

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        gradients = self._line.backward(self._sums.transposed(cotangent))
        return {UNKNOWNS: self._unknowns.pulled(self._at, gradients)}


def fit_image(model: ForwardModel, record: ImageRecord, unknowns: ImageUnknowns,
              stages: Sequence[Stage] = COARSE_TO_FINE, *, modes: int = 40,
              begin: Callable[[], np.ndarray] | None = None, state_file: FilePath | None = None, about: str = "",
              told: Callable[[float, float], object] | None = None) -> Fit:
    """Fit unknowns to an image."""
    if not stages:
        raise ValueError("no stage was given; give one or more, or leave them out")
    made = [_stage(model, record, unknowns, one) for one in stages]
    start = sorted((name, np.asarray(value).tobytes()) for name, value in unknowns.values(
        np.linspace(-1, 1, unknowns.size)).items())
    return fit(made[-1].model, made[-1].likelihood, {UNKNOWNS: Prior(deviation=1.0)}, earlier=made[:-1],
               method=made[-1].method, stopping=made[-1].stopping, moves=made[-1].moves, directions=modes,
               state_file=state_file, about=f"{about}\n{stages!r}\n{start!r}", begin=begin, progress=told)


def _stage(model: ForwardModel, record: ImageRecord, unknowns: ImageUnknowns, one: Stage) -> FitStage:
    sums = record.at(one.bins)
    moves = np.arange(unknowns.size) < (unknowns.first if one.first_only else unknowns.size)
    return FitStage(model=SummedModel(model, unknowns, sums), likelihood=sums.likelihood(), moves=moves,
                 method=GaussNewton(inner=one.products, tolerance=TOLERANCE),
                 stopping=Stopping(iterations=one.steps, noise=None, fall=LEAST_FALL))


def unknowns_of(found: Fit) -> np.ndarray:
    """Return the unknowns (size,) that an image's fit found."""
    return found.values[UNKNOWNS]


def spread_of(found: Fit) -> tuple[np.ndarray, np.ndarray]:
    """Return what an image told best of its unknowns: information λ (modes,), falling, and unit vectors (modes, size).

    Along a vector the deviation falls from 1 to (1 + λ)^-1/2; across all of them it is told as it was before.
    """
    return found.observability.singular_values ** 2, found.observability.seen
