"""Fit parameters of a model to a record: the most probable values, what they may be off, and what could be seen.

    Φ(x) = ½ Σ D(y, F(x)) - ln p(x),       steps -> `gauss_newton` or `first_order`

y -> in the ``likelihood``; F -> ``model``; p -> ``priors``.
"""
from __future__ import annotations

import os
from collections.abc import Callable, Mapping

import numpy as np

from ..gradients.model import ForwardModel
from ..io.files import FilePath, check_writable
from .answer import Fit, FittedParameter
from .gauss_newton import GaussNewton
from .iteration import Method, State, Stopping
from .likelihood import Likelihood
from .misfit import Misfit
from .observability import Observability, observe
from .priors import Prior
from .saved_state import fingerprint, load_state, save_state
from .unknowns import Unknowns

__all__ = ["fit"]


def fit(model: ForwardModel, likelihood: Likelihood, priors: Mapping[str, Prior], *, method: Method | None = None,
        stopping: Stopping | None = None, directions: int = 40, seed: int = 0, state_file: FilePath | None = None,
        about: str = "", progress: Callable[[float, float], object] | None = None) -> Fit:
    """Fit parameters of a model to a record.

    Parameters
    ----------
    model : ForwardModel
    likelihood : Likelihood
        With the record.
    priors : dict[str, Prior]
        Of the parameters that are fitted; others stay as at the start.
    method : Method, optional
        Default: `GaussNewton`.
    stopping : Stopping, optional
    directions : int
        In which to look at what the record tells; three products with the Jacobian each.
    seed : int
        Of those directions.
    state_file : str or path, optional
        Written after each step, and gone on with where it is there: the answer is the same. It stays when the fit is
        done.
    about : str
        What tells this fit from others with the same record and priors.
    progress : callable, optional
        Called with steps done and their total.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If a name is unknown, shapes do not fit, the model's derivatives forward and backward differ, or the state is of
        another fit.
    """
    method, stopping = method or GaussNewton(), stopping or Stopping()
    if directions < 1:
        raise ValueError(f"the record is looked at in {directions} directions; give 1 or more")
    unknowns = Unknowns(model, priors)
    misfit = Misfit(model, likelihood, unknowns)
    mark = fingerprint(unknowns, likelihood, f"{about}\n{method!r}\n{seed}") if state_file is not None else ""
    if state_file is not None:
        check_writable(state_file)
    if state_file is not None and os.path.exists(state_file):
        state = load_state(state_file, mark, unknowns.size)
    else:
        from ..device.chance import Salt

        first = misfit.about(np.zeros(unknowns.size), 0)
        first.check(np.random.default_rng([seed, Salt.PROBES, 1]))
        state = State.at(first.z, first.cost)
    while not (reason := stopping.reason(misfit, state)):
        state = method.step(misfit, state)
        if state_file is not None:
            save_state(state_file, state, mark)
        if progress is not None:
            progress(state.iteration, stopping.iterations)
    final = misfit.about(state.z, state.iteration, record_alone=True)
    look = observe(final, directions, seed)
    return Fit(parameters=_parameters(model, unknowns, state, look), predicted=np.asarray(final.predicted),
               deviance=state.deviance / likelihood.expected, cost=state.cost, step=state.step, observability=look,
               stopped=reason)


def _parameters(model: ForwardModel, unknowns: Unknowns, state: State, look: Observability) \
        -> dict[str, FittedParameter]:
    """What the answer says of each parameter."""
    values, begin = unknowns.values(state.z), unknowns.values(np.zeros(unknowns.size))
    found = {}
    for name, part in unknowns.parts.items():
        shape = values[name].shape
        classes = unknowns.bound[name].classes
        odds = None if classes is None else classes.probabilities(values[name].ravel(), look.deviation[part])
        found[name] = FittedParameter(
            value=values[name], start=begin[name], uncertainty=look.deviation[part].reshape(shape),
            prior_deviation=unknowns.bound[name].deviation.reshape(shape),
            resolved=look.resolved[part].reshape(shape), seen=look.seen[:, part].reshape(-1, *shape),
            unseen=look.unseen[:, part].reshape(-1, *shape), unit=model.units.get(name, ""),
            labels=None if odds is None else odds.argmax(1).reshape(shape),
            probabilities=None if odds is None else odds.reshape(*shape, -1),
            classes=None if classes is None else classes.values)
    return found
