"""Steps by gradients alone: Adam, and L-BFGS.

Both go over z: a gradient by z, taken back to x, has been smoothed by the prior's covariance.

    Adam      m = β₁ m + (1 - β₁) g,   v = β₂ v + (1 - β₂) g²,   z -= rate m' / (√v' + ε)
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .gauss_newton import tried
from .iteration import State
from .misfit import Misfit

FIRST, SECOND, EPSILON = 0.9, 0.99, 1e-12
HALVINGS = 8                       # of Adam's rate, in one step, before no step is left


@dataclass(frozen=True, kw_only=True)
class Adam:
    """Steps of Adam (Kingma and Ba, 2015); its rate is halved where a step would raise the misfit.

    Parameters
    ----------
    rate : float
        [prior deviations] that a number moves, a gradient.
    gradients : int
        Gradients a step of the fit.

    Raises
    ------
    ValueError
        If one of them is not above zero.
    """

    rate: float = 0.05
    gradients: int = 10

    def __post_init__(self):
        if not (np.isfinite(self.rate) and self.rate > 0 and self.gradients >= 1):
            raise ValueError(f"Adam: a rate of {self.rate:g} and {self.gradients} gradients; give numbers above zero")

    def step(self, misfit: Misfit, state: State) -> State:
        """Return the state after a step; see `Method.step`."""
        before = misfit.cost(state.z, state.iteration).total
        fewest, memory = int(state.damping), state.memory if state.memory.size else np.zeros((2, state.z.size))
        for halvings in range(fewest, fewest + HALVINGS):
            # the mean gradient of a step that overshot goes on to point beyond
            first = memory[0] if halvings == fewest else np.zeros_like(memory[0])
            try:
                z, walked = self._walked(misfit, state, self.rate * 0.5 ** halvings, first, memory[1])
            except ValueError:                        # no record can be made on the way: a shorter way
                continue
            cost = tried(misfit, z, state.iteration)
            if cost.total < before:
                return state.moved(z, cost, memory=walked, damping=float(halvings))
        return replace(state, stuck=True)

    def _walked(self, misfit: Misfit, state: State, rate: float, first: np.ndarray, second: np.ndarray) \
            -> tuple[np.ndarray, np.ndarray]:
        """Where a step's gradients lead (n,), and the means that they leave (2, n)."""
        z = state.z
        for number in range(self.gradients):
            gradient = misfit.about(z, state.iteration).gradient()
            done = state.iteration * self.gradients + number + 1
            first = FIRST * first + (1 - FIRST) * gradient
            second = SECOND * second + (1 - SECOND) * gradient ** 2
            z = z - rate * (first / (1 - FIRST ** done)) / (np.sqrt(second / (1 - SECOND ** done)) + EPSILON)
        return z, np.stack([first, second])


@dataclass(frozen=True, kw_only=True)
class LBFGS:
    """Steps of L-BFGS (Liu and Nocedal, 1989), which begins anew at each step of the fit.

    Parameters
    ----------
    gradients : int
        Iterations of L-BFGS a step of the fit.

    Raises
    ------
    ValueError
        If there is none.
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
