"""State of a fit between two steps, conditions of its end, and the interface of its steps."""
from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from mitsonar.gradients.model import ForwardModel

from .likelihood import Likelihood
from .misfit import Cost, Misfit


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """Hold a fit between two steps: all that the next step depends on."""

    z: np.ndarray
    deviance: np.ndarray  # of the record
    cost: np.ndarray  # of the record
    step: np.ndarray  # of the record
    radius: float = 0.0  # how far the next step may go [prior deviations]
    stuck: bool = False  # no step lowered Φ
    begins: np.ndarray = field(default_factory=lambda: np.zeros(1, int))

    @classmethod
    def at(cls, z: np.ndarray, cost: Cost) -> State:
        """Return the state at the start z."""
        return cls(z=z, deviance=np.array([cost.deviance]), cost=np.array([cost.total]), step=np.zeros(1))

    @property
    def iteration(self) -> int:
        """Number of steps."""
        return self.cost.size - 1

    @property
    def stage(self) -> int:
        """The number of the present stage."""
        return self.begins.size - 1

    @property
    def within(self) -> int:
        """Number of steps in the present stage."""
        return self.iteration - int(self.begins[-1])

    def onward(self, cost: Cost) -> State:
        """Return the state at the next stage, whose misfit of the same z is another."""
        return replace(self, deviance=np.append(self.deviance[:-1], cost.deviance),
                       cost=np.append(self.cost[:-1], cost.total), radius=0.0, stuck=False,
                       begins=np.append(self.begins, self.iteration))

    def moved(self, z: np.ndarray, cost: Cost, **changes: Any) -> State:
        """Return the state at another z."""
        length = float(np.sqrt(np.mean((z - self.z) ** 2)))
        return replace(self, z=z, deviance=np.append(self.deviance, cost.deviance),
                       cost=np.append(self.cost, cost.total), step=np.append(self.step, length), **changes)


@dataclass(frozen=True, kw_only=True)
class Stopping:
    """Conditions at which a fit ends.

    Parameters
    ----------
    iterations : int
        Greatest number of steps.
    noise : float, optional
        Stop once the record's deviance is this share of its expectation at the truth (discrepancy principle; Morozov,
        1966), because further changes fit noise. If the start is below it, stop once a step lowers the deviance by no
        more than its own deviation, √(2 N). None: continue to the most probable values. Uncertainties are those about
        the values at the end.
    fall : float
        Stop when Φ falls by less than this share of it.

    Raises
    ------
    ValueError
        If a number is below zero, or there is no step.
    """

    iterations: int = 15
    noise: float | None = 1.0
    fall: float = 1e-4

    def __post_init__(self):
        if self.iterations < 1:
            raise ValueError(f"a fit of {self.iterations} iterations makes no step; give 1 or more")
        for name, value in (("noise", self.noise), ("fall", self.fall)):
            if value is not None and not (np.isfinite(value) and value >= 0):
                raise ValueError(f"a fit stops at {name} {value:g}; give a number that is not below zero")

    def reason(self, misfit: Misfit, state: State) -> str:
        """Return the reason to stop here, or an empty text."""
        reduced = state.deviance[-1] / misfit.likelihood.expected
        settled = misfit.settled(state.iteration)
        # a fall is of one Φ: the last two costs are both of the classes' pull at the end
        comparable = state.within > 0 and misfit.settled(max(state.iteration - 2, 0))
        if settled and self.noise is not None and reduced <= self.noise and (
                state.stuck or state.within > 0 and self._reached(state, misfit.likelihood.expected)):
            return f"the record is fitted to its noise: {reduced:.3g} of the deviance expected of it"
        if state.stuck:
            return f"no step lowers the misfit, at {reduced:.3g} of the deviance that noise would have"
        if comparable and state.cost[-2] - state.cost[-1] <= self.fall * abs(state.cost[-1]):
            return f"the misfit stands still, at {reduced:.3g} of the deviance that noise would have"
        if state.within >= self.iterations:
            return f"no more were asked for, at {reduced:.3g} of the deviance that noise would have"
        return ""


    def _reached(self, state: State, expected: float) -> bool:
        """Return True if the last step reached the noise, or changed no more than chance does.

        A record with more looks than stated lies below its noise from the start.
        """
        before, now = state.deviance[-2:]
        return before > (self.noise or 0) * expected or before - now <= np.sqrt(2 * expected)


class Method(Protocol):
    """Make the steps of a fit."""

    def step(self, misfit: Misfit, state: State) -> State:
        """Return the state after a step; if no step lowers Φ, return the same state, stuck."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class FitStage:
    """Hold an earlier stage of a fit, with the same unknowns."""

    model: ForwardModel  # with the same parameters
    likelihood: Likelihood  # with its record
    method: Method
    stopping: Stopping
    first: int | None = None  # only so many of the unknowns z move, the first of them
