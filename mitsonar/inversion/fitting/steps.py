"""Steps of a fit by SciPy: of its trust region, or of L-BFGS.

    d of least |A d - b|² + |z + d|²,  |d| < radius,       Φ(z + d) < Φ(z)

A, b -> as in `misfit`. Each step calls `scipy.optimize.least_squares` anew (Branch, Coleman and Li, 1999), so that the
state of an interrupted fit is z and a radius. Its least squares are solved by LSMR (Fong and Saunders, 2011): each
inner iteration takes one product with A and one with its transpose.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from .iteration import State
from .misfit import Cost, Misfit

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

LONGER = 2.0                       # a step is at most so much longer than the one before it
FIRST_RADIUS = 3.0                 # of the first step [prior deviations], as a root mean square
TRIES = 12                         # lengths of one step, each a quarter or less of that before
NOTHING = 1e-15                    # SciPy's own stopping rules are not asked for


class _AcceptedError(Exception):
    """SciPy asked for the Jacobian at another point, so the step is done."""


@dataclass(frozen=True, kw_only=True)
class TrustRegion:
    """Steps of `scipy.optimize.least_squares` within a trust region.

    Parameters
    ----------
    inner : int
        Greatest number of LSMR iterations a step.
    tolerance : float
        Relative tolerance of LSMR.
    whole : bool
        If True, compute the whole Jacobian by one product an unknown, and solve each step exactly: for up to some
        hundred unknowns of models whose products cost little.

    Raises
    ------
    ValueError
        If inner is below 1, or the tolerance is not between 0 and 1.
    """

    inner: int = 20
    tolerance: float = 1e-3
    whole: bool = False

    def __post_init__(self):
        if self.inner < 1 or not 0 < self.tolerance < 1:
            raise ValueError(f"trust region: {self.inner} inner iterations to {self.tolerance:g}; give 1 or more, and "
                             "a tolerance between 0 and 1")

    def step(self, misfit: Misfit, state: State) -> State:
        """Return the state after a step; see `Method.step`."""
        from scipy.sparse.linalg import LinearOperator

        about = misfit.about(state.z, state.iteration)
        count, size = about.rest.size, about.z.size
        costs: list[Cost] = []

        def tried(d: np.ndarray) -> float:
            costs.append(misfit.tried(state.z + about.moves * d, state.iteration))
            return costs[-1].total

        def jacobian() -> LinearOperator | np.ndarray:
            if self.whole:
                return np.vstack([about.matrix(), np.diag(about.moves)])
            return LinearOperator((count + size, size), dtype=np.float64, matvec=lambda v: np.concatenate(
                [about.forward(np.ravel(v)), about.moves * np.ravel(v)]),
                rmatvec=lambda w: about.backward(np.ravel(w)[:count]) + about.moves * np.ravel(w)[count:])

        radius = state.radius or FIRST_RADIUS * np.sqrt(max(about.moves.sum(), 1.0))
        solver = {} if self.whole else {"maxiter": self.inner, "atol": self.tolerance, "btol": self.tolerance,
                                        "conlim": 0.0, "regularize": False}
        d = trust_region_step(np.concatenate([-about.rest, about.moves * about.z]), jacobian(), about.cost.total, tried,
                              radius, **solver)
        if d is None:
            return replace(state, stuck=True)
        d = about.moves * d
        return state.moved(state.z + d, costs[-1], radius=LONGER * float(np.linalg.norm(d)))


def trust_region_step(score: np.ndarray, jacobian: LinearOperator | np.ndarray, total: float,
                      tried: Callable[[np.ndarray], float], scale: float | np.ndarray, **lsmr: Any) \
        -> np.ndarray | None:
    """Return the first step d (n,) of `scipy.optimize.least_squares` that lowers Φ; None if no step does."""
    # score (N,); jacobian (N, n)
    from scipy.optimize import least_squares
    from scipy.sparse.linalg import LinearOperator, aslinearoperator

    # ½|f|² of SciPy is Φ and a constant: one more row, which no unknown moves, makes up for what scores leave out
    constant, size, whole = float(score @ score), jacobian.shape[1], isinstance(jacobian, np.ndarray)
    start, accepted = np.append(score, np.sqrt(2 * total)), np.zeros(size)

    def rows(d: np.ndarray) -> np.ndarray:
        if not d.any():
            return start
        accepted[:] = d
        return np.append(np.zeros(score.size), np.sqrt(2 * tried(d) + constant))

    def slopes(d: np.ndarray) -> np.ndarray | LinearOperator:
        if d.any():
            raise _AcceptedError
        if whole:
            return np.vstack([jacobian, np.zeros(size)])
        inner = aslinearoperator(jacobian)
        return LinearOperator((start.size, size), dtype=np.float64, matvec=lambda v: np.append(inner.matvec(v), 0.0),
                              rmatvec=lambda w: inner.rmatvec(np.ravel(w)[:-1]))

    how: dict[str, Any] = {"tr_solver": "exact"} if whole else {"tr_solver": "lsmr", "tr_options": lsmr}
    try:
        least_squares(rows, np.zeros(size), slopes, x_scale=scale, max_nfev=TRIES, ftol=NOTHING, xtol=NOTHING,
                      gtol=NOTHING, **how)
    except _AcceptedError:
        return accepted
    return None


@dataclass(frozen=True, kw_only=True)
class LBFGS:
    """Steps of `scipy.optimize.minimize` by L-BFGS-B, which is called anew at each step of the fit.

    Parameters
    ----------
    gradients : int
        Number of L-BFGS iterations a step of the fit.

    Raises
    ------
    ValueError
        If gradients is below 1.
    """

    gradients: int = 20

    def __post_init__(self):
        if self.gradients < 1:
            raise ValueError(f"L-BFGS: {self.gradients} gradients a step; give 1 or more")

    def step(self, misfit: Misfit, state: State) -> State:
        """Return the state after a step; see `Method.step`."""
        from scipy.optimize import minimize

        start = misfit.cost(state.z, state.iteration)

        def slope(z: np.ndarray) -> tuple[float, np.ndarray]:
            try:
                about = misfit.about(z, state.iteration)
            except ValueError:                        # no record can be made there: far above
                return 1e3 * abs(start.total) + 1e3, np.zeros_like(z)
            return about.cost.total, about.gradient()

        found = minimize(slope, state.z, jac=True, method="L-BFGS-B", options={"maxiter": self.gradients})
        cost = misfit.cost(found.x, state.iteration)
        return state.moved(found.x, cost) if cost.total < start.total else replace(state, stuck=True)
