"""Fit parameters of a model to a record: the most probable values, their uncertainties, and their observability.

    Φ(x) = ½ Σ D(y, F(x)) - ln p(x),       steps -> `steps`

y -> in the ``likelihood``; F -> ``model``; p -> ``priors``.
"""
from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mitsonar.device.files import FilePath, check_writable
from mitsonar.gradients.model import ForwardModel

from .answer import Fit, FittedParameter
from .iteration import FitStage, Method, State, Stopping
from .likelihood import Likelihood
from .misfit import Misfit
from .observability import Observability, observe
from .priors import Prior
from .saved_state import fingerprint, load_state, save_state
from .steps import TrustRegion
from .unknowns import Unknowns


def fit(model: ForwardModel, likelihood: Likelihood, priors: Mapping[str, Prior], *, method: Method | None = None,
        stopping: Stopping | None = None, earlier: Sequence[FitStage] = (), first: int | None = None,
        directions: int = 40, seed: int = 0, begin: Callable[[], np.ndarray] | None = None,
        state_file: FilePath | None = None, about: str = "",
        progress: Callable[[float, float], object] | None = None) -> Fit:
    """Fit parameters of a model to a record.

    Parameters
    ----------
    model : ForwardModel
        Model of the record.
    likelihood : Likelihood
        Likelihood, which holds the record.
    priors : dict[str, Prior]
        Priors of the fitted parameters; others have their start values.
    method : Method, optional
        Method of the steps; default: `TrustRegion`.
    stopping : Stopping, optional
        Conditions at which the fit ends.
    earlier : sequence of FitStage
        Coarser fits that come first, one after the other.
    first : int, optional
        Number of unknowns that move; see `FitStage`.
    directions : int
        Number of directions of the uncertainty; each takes three products with the Jacobian.
    seed : int
        Seed of those directions.
    begin : callable, optional
        Returns the unknowns z (n,) at the start, unless a saved state is resumed. Default: the priors' means.
    state_file : str or path, optional
        File of the state, written after each step. A fit resumes from an existing file with the same answer. The file
        stays when the fit is done.
    about : str
        Text that separates this fit from others with the same record and priors.
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
    method, stopping = method or TrustRegion(), stopping or Stopping()
    if directions < 1:
        raise ValueError(f"the record is looked at in {directions} directions; give 1 or more")
    unknowns = Unknowns(model, priors)
    stages = [*earlier, FitStage(model=model, likelihood=likelihood, method=method, stopping=stopping, first=first)]
    misfits = [Misfit(one.model, one.likelihood, unknowns, one.first) for one in stages]
    mark = _mark(unknowns, stages, about, seed) if state_file is not None else ""
    if state_file is not None:
        check_writable(state_file)
    if state_file is not None and os.path.exists(state_file):
        state = load_state(state_file, mark, unknowns.size, len(stages))
    else:
        state = _begun(misfits[0], np.zeros(unknowns.size) if begin is None else begin(), seed)
    total = sum(one.stopping.iterations for one in stages)
    while True:
        misfit, stage = misfits[state.stage], stages[state.stage]
        if reason := stage.stopping.reason(misfit, state):
            if state.stage + 1 == len(stages):
                break
            state = state.onward(misfits[state.stage + 1].cost(state.z, state.iteration))
            continue
        state = stage.method.step(misfit, state)
        if state_file is not None:
            save_state(state_file, state, mark)
        if progress is not None:
            progress(sum(one.stopping.iterations for one in stages[:state.stage]) + state.within, total)
    final = Misfit(model, likelihood, unknowns).about(state.z, state.iteration, record_alone=True)
    look = observe(final, directions, seed)
    expected = np.repeat([one.likelihood.expected for one in stages], np.diff([*state.begins, state.cost.size]))
    return Fit(parameters=_parameters(model, unknowns, state, look), predicted=np.asarray(final.predicted),
               deviance=state.deviance / expected, cost=state.cost, step=state.step, observability=look,
               stopped=reason, unknowns=state.z)


def _mark(unknowns: Unknowns, stages: Sequence[FitStage], about: str, seed: int) -> str:
    """Return the fingerprint of this fit."""
    mark = f"{about}\n{stages[-1].method!r}\n{seed}"
    for number, one in enumerate(reversed(stages)):
        if number:
            mark += f"\n{one.method!r}\n{one.stopping!r}\n{one.first}"
        mark = fingerprint(unknowns, one.likelihood, mark)
    return mark


def _begun(misfit: Misfit, z: np.ndarray, seed: int) -> State:
    """Return the state at the start, after a check of the model."""
    from mitsonar.device.chance import Salt

    first = misfit.about(np.asarray(z, float), 0)
    first.check(np.random.default_rng([seed, Salt.PROBES, 1]))
    return State.at(first.z, first.cost)


def _parameters(model: ForwardModel, unknowns: Unknowns, state: State, look: Observability) \
        -> dict[str, FittedParameter]:
    """Return the fitted parameters."""
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
