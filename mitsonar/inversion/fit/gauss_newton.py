"""Steps of Gauss and Newton, by products with the Jacobian alone.

    d = argmin |A d - b|² + |z + d|² + λ |d|²,        Φ(z + t d) < Φ(z) + 10⁻⁴ t d·∇Φ,    t = 1, 1/2, 1/4, ...

A, b -> of `misfit`; λ -> ``damping``, more where a whole step did not do what its model said, less where it did
(Levenberg, 1944; Marquardt, 1963). The least squares are solved by LSMR (Fong and Saunders, 2011): each of its
iterations takes one product with A and one with its transpose. Few of them are a step by the best known directions.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .iteration import State
from .misfit import About, Cost, Misfit

DESCENT = 1e-4
SHARES = 1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 1e-3             # of a step, tried one after the other
GOOD, MORE, LESS = 0.5, 4.0, 0.25
LEAST, FIRST_DAMPING = 1e-3, 1.0
NOTHING = Cost(total=np.inf, deviance=np.inf)


@dataclass(frozen=True, kw_only=True)
class GaussNewton:
    """Gauss-Newton steps.

    Parameters
    ----------
    inner : int
        Iterations of LSMR a step, at most.
    tolerance : float
        Of LSMR, relative.

    Raises
    ------
    ValueError
        If there is no inner iteration, or the tolerance is not between 0 and 1.
    """

    inner: int = 20
    tolerance: float = 1e-3

    def __post_init__(self):
        if self.inner < 1 or not 0 < self.tolerance < 1:
            raise ValueError(f"Gauss-Newton: {self.inner} inner iterations to {self.tolerance:g}; give 1 or more, and "
                             "a tolerance between 0 and 1")

    def step(self, misfit: Misfit, state: State) -> State:
        """Return the state after a step; see `Method.step`."""
        damping = state.damping
        for _ in range(2):
            about = misfit.about(state.z, state.iteration)
            direction, slope = self._direction(about, damping)
            for number, share in enumerate(SHARES):
                z = state.z + share * direction
                cost = tried(misfit, z, state.iteration)
                if cost.total < about.cost.total + DESCENT * share * slope:
                    return state.moved(z, cost, damping=_damping(damping, number, about.cost, cost, slope))
            damping = max(MORE ** 2 * damping, FIRST_DAMPING * MORE)
        return replace(state, stuck=True)

    def _direction(self, about: About, damping: float) -> tuple[np.ndarray, float]:
        """The step d (n,), and d·∇Φ."""
        from scipy.sparse.linalg import LinearOperator, lsmr

        count, size = about.rest.size, about.z.size
        root = np.sqrt(1 + damping)

        def forward(d: np.ndarray) -> np.ndarray:
            return np.concatenate([about.forward(np.ravel(d)), root * np.ravel(d)])

        def backward(w: np.ndarray) -> np.ndarray:
            w = np.ravel(w)
            return about.backward(w[:count]) + root * w[count:]

        gradient = about.gradient()
        operator = LinearOperator((count + size, size), matvec=forward, rmatvec=backward, dtype=np.float64)
        rest = np.concatenate([about.rest, -about.moves * about.z / root])
        direction = lsmr(operator, rest, atol=self.tolerance, btol=self.tolerance, conlim=0, maxiter=self.inner)[0]
        slope = float(direction @ gradient)
        return (direction, slope) if slope < 0 else (-gradient / (1 + damping), -float(gradient @ gradient))


def tried(misfit: Misfit, z: np.ndarray, iteration: int) -> Cost:
    """Return Φ at z; infinite where the model makes no record of it."""
    try:
        cost = misfit.cost(z, iteration)
    except ValueError:
        return NOTHING
    return cost if np.isfinite(cost.total) else NOTHING


def _damping(damping: float, shorter: int, before: Cost, after: Cost, slope: float) -> float:
    """The next step's: a step that is all of the quadratic's lowers Φ by half of -slope."""
    if shorter:
        return max(MORE * damping, LEAST * MORE ** (2 + shorter))
    gain = (before.total - after.total) / (-0.5 * slope)
    if gain < LESS:
        return max(MORE * damping, LEAST * MORE ** 2)
    less = damping * LESS if gain > GOOD else damping
    return less if less >= LEAST else 0.0
