"""The check of every parameter of a scene, each alone: each has a model of its own, so none leans on another."""
from __future__ import annotations

from collections.abc import Callable, Sequence

from ..check.check import check_gradients
from ..check.table import NOT_DIFFERENTIATED, GradientCheck, PartCheck, joined
from ..model import ForwardModel


def check_parameters(model_of: Callable[[str], ForwardModel], keys: Sequence[str], *, refuse: bool = False,
                     directions: int = 3, tolerance: float = 0.01, seed: int = 0,
                     progress: Callable[[float, float], object] | None = None) -> GradientCheck:
    """Check parameters by models that are made for one each."""
    found = []
    for number, key in enumerate(keys):
        def of_parts(done: int, total: int, number: int = number) -> None:
            if progress is not None:
                progress(number + done / total, len(keys))

        try:
            model = model_of(key)
        except ValueError as error:
            if refuse:
                raise
            found.append(GradientCheck(rows=(_without(key, str(error)),), directions=directions, tolerance=tolerance))
            continue
        found.append(check_gradients(model, [key], directions=directions, tolerance=tolerance, seed=seed,
                                     progress=of_parts))
    return joined(found)


def _without(key, note):
    return PartCheck(key=key, unit="", size=0, verdict=NOT_DIFFERENTIATED, notes=(note,))
