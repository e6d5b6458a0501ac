"""Parameters from a speckled image by the generic fit, from coarse to fine sums of bins.

    F_k(x) = S_k F(x)              S_k -> sums of k bins (`image_record`)

Sums of many bins come first, because their brightness is nearly linear in the unknowns. The first stage moves only the
first unknowns, a plane or a pose: otherwise long waves would imitate the tilt of a bed.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.gradients.model import ForwardModel, Linearised, Values

from ..fitting.answer import Fit, FittedParameter, named
from ..fitting.fitting import fit
from ..fitting.iteration import FitStage, Stopping
from ..fitting.priors import Prior
from ..fitting.steps import TrustRegion
from .image_record import Comparison, ImageRecord

if TYPE_CHECKING:
    import xarray as xr

LEAST_FALL = 0.01                  # of the misfit, below which a stage ends
TOLERANCE = 1e-5                   # of a step's least squares


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
    """A model whose record is sums of bins: a `ForwardModel`."""

    def __init__(self, model: ForwardModel, sums: Comparison):
        self._model, self._sums = model, sums
        self.start, self.units = model.start, model.units

    def value(self, values: Values) -> np.ndarray:
        """Return sums; see `ForwardModel.value`."""
        return self._sums.summed(self._model.value(values))

    def linearised(self, values: Values) -> SummedLine:
        """Return sums about values; see `ForwardModel.linearised`."""
        return SummedLine(self._model.linearised(values), self._sums)


class SummedLine:
    """A `SummedModel` linearised about some values; see `model.Linearised`."""

    def __init__(self, line: Linearised, sums: Comparison):
        self._line, self._sums = line, sums
        self.value = sums.summed(line.value)

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v; see `Linearised.forward`."""
        return self._sums.summed(self._line.forward(tangents))

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w; see `Linearised.backward`."""
        return self._line.backward(self._sums.transposed(cotangent))


def fit_image(model: ForwardModel, record: ImageRecord, priors: Mapping[str, Prior],
              stages: Sequence[Stage] = COARSE_TO_FINE, *, first: int, modes: int = 40,
              begin: Callable[[], np.ndarray] | None = None, state_file: FilePath | None = None, about: str = "",
              told: Callable[[float, float], object] | None = None) -> Fit:
    """Fit parameters to an image."""
    # priors [str, Prior]
    if not stages:
        raise ValueError("no stage was given; give one or more, or leave them out")
    made = [_stage(model, record, one, first) for one in stages]
    last = made[-1]
    return fit(last.model, last.likelihood, priors, earlier=made[:-1], method=last.method, stopping=last.stopping,
               first=last.first, directions=modes, state_file=state_file, about=f"{about}\n{stages!r}", begin=begin,
               progress=told)


def _stage(model: ForwardModel, record: ImageRecord, one: Stage, first: int) -> FitStage:
    sums = record.at(one.bins)
    return FitStage(model=SummedModel(model, sums), likelihood=sums.likelihood(),
                    first=first if one.first_only else None,
                    method=TrustRegion(inner=one.products, tolerance=TOLERANCE),
                    stopping=Stopping(iterations=one.steps, noise=None, fall=LEAST_FALL))


def check_keys(model: ForwardModel, keys: Sequence[str], numbers: Sequence[str] = ()) -> None:
    """Refuse keys that the model has not, and ``numbers`` that are more than one number."""
    for name in (*keys, *numbers):
        if name not in model.start:
            raise ValueError(f"the model has no parameter {name!r}; make it with that key: it has "
                             f"{', '.join(model.start)}")
    for name in numbers:
        if model.start[name].size != 1:
            raise ValueError(f"{name} has {model.start[name].size} values; give the key of a strength that is one "
                             "number")


def image_answer(found: Fit, name: str, dims: tuple[str, ...], one: FittedParameter, observable: str,
                 **attrs: Any) -> xr.Dataset:
    """Return a parameter's answer as a dataset, with the misfit by step and the information λ by mode.

    Along a mode the deviation falls from 1 to (1 + λ)^-1/2 of the prior's.
    """
    import xarray as xr

    information = found.observability.singular_values ** 2
    return xr.Dataset({**named(name, dims, one), "misfit": ("step", found.deviance, {"units": "1"}),
                       "information": ("mode", information, {"units": "1"})},
                      attrs={"kind": "fit", "parameters": [name], "stopped": found.stopped, "observable": observable,
                             **attrs})
