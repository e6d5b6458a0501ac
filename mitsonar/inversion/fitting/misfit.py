"""The function that a fit minimises over its unknowns z, and the linear problem of a step.

    Φ(z) = ½ Σ D(F(x(z))) + ½ |z|² + classes,       A = √w J ∂x/∂z,    b = -slope / √w

D, slope, w -> of the likelihood, bin by bin (`likelihood`); classes -> rows of the same kind (`classes`). A step is
the d of least |A d - b|² + |z + d|². Half of D and half of |z|² are minus logarithms of the likelihood and of the
prior: Φ's lowest point is the most probable z.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.gradients.model import ForwardModel, Linearised

from .likelihood import Likelihood, Terms
from .unknowns import Unknowns

ASYMMETRY = 1e-3                   # between forward and backward, that rounding of float32 does not reach


@dataclass(frozen=True, kw_only=True)
class Cost:
    """Cost Φ of a fit at some z, and its parts."""

    total: float  # Φ
    deviance: float  # Σ D, of the record alone


NO_RECORD = Cost(total=np.inf, deviance=np.inf)


class Misfit:
    """Φ of a model, a record and priors."""

    def __init__(self, model: ForwardModel, likelihood: Likelihood, unknowns: Unknowns,
                 first: int | None = None):
        self.model, self.likelihood, self.unknowns = model, likelihood, unknowns
        self.moves = (np.arange(unknowns.size) < (unknowns.size if first is None else first)).astype(float)
        self._classed = [name for name in unknowns.names if unknowns.bound[name].classes is not None]

    def settled(self, iteration: int) -> bool:
        """Return whether Φ stays the same from this iteration on: classes pull as they will at the end."""
        return all(self._spread(name, iteration) == self._spread(name, 10_000) for name in self._classed)

    def cost(self, z: np.ndarray, iteration: int) -> Cost:
        """Return Φ at z."""
        values = self.unknowns.values(z)
        terms = self.likelihood.terms(self.model.value(values))
        return self._cost(z, terms, self._class_terms(values, iteration))

    def tried(self, z: np.ndarray, iteration: int) -> Cost:
        """Return Φ at z; infinite where the model makes no record of it."""
        try:
            cost = self.cost(z, iteration)
        except ValueError:
            return NO_RECORD
        return cost if np.isfinite(cost.total) else NO_RECORD

    def about(self, z: np.ndarray, iteration: int, *, record_alone: bool = False) -> MisfitLinearised:
        """Linearise at z, with or without the pull of classes; valid until the next call."""
        values = self.unknowns.values(z)
        line = self.model.linearised(values)
        terms = self.likelihood.terms(line.value)
        classes = [] if record_alone else self._class_terms(values, iteration)
        return MisfitLinearised(self, z, line, terms, classes, self._cost(z, terms, classes))

    def classed(self) -> list[slice]:
        """Return the parts of x that have classes."""
        return [self.unknowns.parts[name] for name in self._classed]

    def _spread(self, name: str, iteration: int) -> float:
        classes = self.unknowns.bound[name].classes
        assert classes is not None
        return classes.spread_at(iteration)

    def _class_terms(self, values: dict[str, np.ndarray], iteration: int) -> list[Terms]:
        found = []
        for name in self._classed:
            classes = self.unknowns.bound[name].classes
            assert classes is not None
            found.append(classes.terms(values[name].ravel(), classes.spread_at(iteration)))
        return found

    @staticmethod
    def _cost(z: np.ndarray, terms: Terms, classes: list[Terms]) -> Cost:
        total = terms.misfit + 0.5 * float(z @ z) + sum(one.misfit for one in classes)
        return Cost(total=total, deviance=float(terms.deviance.sum()))


class MisfitLinearised:
    """Φ about one z: the linear problem of a step."""
    # predicted (N,)

    def __init__(self, misfit: Misfit, z: np.ndarray, line: Linearised, terms: Terms, classes: list[Terms], cost: Cost):
        self._unknowns, self._line, self._classed = misfit.unknowns, line, misfit.classed()
        self.z, self.cost, self.predicted, self.moves = z, cost, line.value, misfit.moves
        self._slope = misfit.unknowns.slope(z)
        self._root = np.sqrt(terms.weight)
        self._class_root = [np.sqrt(one.weight) for one in classes]
        parts = [_over(terms.slope, self._root)]
        parts += [_over(one.slope, root) for one, root in zip(classes, self._class_root)]
        self.rest = -np.concatenate(parts)

    def forward(self, dz: np.ndarray) -> np.ndarray:
        """Return A dz."""
        dx = self._unknowns.pushed(self._slope, self.moves * dz)
        moved = self._line.forward(self._unknowns.shaped(dx))
        return np.concatenate([_times(self._root, moved),
                               *(root * dx[part] for root, part in zip(self._class_root, self._classed))])

    def backward(self, weights: np.ndarray) -> np.ndarray:
        """Return Aᵀ w."""
        count = self._root.size
        dx = self._unknowns.flat(self._line.backward(self._root * weights[:count]))
        for root, part in zip(self._class_root, self._classed):
            dx[part] += root * weights[count:count + root.size]
            count += root.size
        return self.moves * self._unknowns.pulled(self._slope, dx)

    def matrix(self) -> np.ndarray:
        """Return A whole, by a product an unknown."""
        rows = np.empty((self.z.size, self.rest.size))       # each written as it is made
        for row, unit in zip(rows, np.eye(self.z.size)):
            row[:] = self.forward(unit)
        return rows.T

    def gradient(self) -> np.ndarray:
        """Return dΦ/dz."""
        return self.moves * self.z - self.backward(self.rest)

    def spread(self, dz: np.ndarray) -> np.ndarray:
        """Return dq (n,) of dz; q is x without bounds."""
        return self._unknowns.pushed(np.ones_like(self._slope), dz)

    def gathered(self, dq: np.ndarray) -> np.ndarray:
        """Return the transpose of `spread`."""
        return self._unknowns.pulled(np.ones_like(self._slope), dq)

    def between_bounds(self, dq: np.ndarray) -> np.ndarray:
        """Return dx (..., n) of dq (..., n)."""
        return self._slope * dq

    def mapped(self, deviation: np.ndarray) -> np.ndarray:
        """Return deviations of x (n,) of those of q."""
        return self._unknowns.mapped(self.z, deviation)

    @property
    def prior_deviation(self) -> np.ndarray:
        """Deviations of q that the prior alone has, (n,)."""
        unknowns = self._unknowns
        return np.concatenate([unknowns.bound[name].root.deviation for name in unknowns.names])

    def check(self, random: np.random.Generator) -> None:
        """Check that forward and backward derivatives belong to one matrix, for each parameter alone.

        A parameter with little effect on the record would not be noticed among the others.
        """
        dz, heard = random.standard_normal(self.z.size), False
        for name, part in self._unknowns.pieces.items():
            alone = np.zeros_like(dz)
            alone[part] = dz[part]
            heard |= self._check_alone(name, alone)
        if not heard:
            raise ValueError("no value of the record that counts moves with the parameters; fit others, or begin where "
                             "they are heard")

    def _check_alone(self, name: str, dz: np.ndarray) -> bool:
        """Return True if the record changes with dz, of one parameter; refuse derivatives that disagree on it."""
        moved = self.forward(dz)[:self._root.size]           # without classes, which hear all
        square = float(moved @ moved)
        if not np.isfinite(square):
            raise ValueError(f"the model's derivatives by {name} are not finite; start from other values")
        if square == 0:
            return False
        # an infinite derivative by another parameter is not of this one: its dz is zero
        back = self.backward(np.concatenate([moved, np.zeros(self.rest.size - moved.size)]))
        other = float(dz[dz != 0] @ back[dz != 0])
        if not np.isfinite(other):
            raise ValueError(f"the model's derivatives by {name} are not finite; start from other values")
        if abs(square - other) > ASYMMETRY * square:
            raise ValueError(f"the model's forward and backward derivatives by {name} differ by "
                             f"{abs(other / square - 1):.1e} of their product, and fits need them to {ASYMMETRY:g}; "
                             "check them by mitsonar gradient-check")
        return True


def _over(value: np.ndarray, root: np.ndarray) -> np.ndarray:
    return np.divide(value, root, out=np.zeros_like(value), where=root > 0)


def _times(root: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Return the product of two arrays, with 0 for entries that do not count."""
    return np.where(root > 0, root * np.asarray(moved, float), 0)
