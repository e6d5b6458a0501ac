"""Hold the answer of a fit: values, uncertainties, and the observed and unobserved parts."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .observability import Observability

if TYPE_CHECKING:
    import xarray as xr

QUIET = 0.7                        # of the expected deviance, below which noise was said to be more than it is
TOLD = 0.5                         # share of a number's prior variance that must be gone to call it told
HIDDEN = 0.1                       # the same of a pattern that is called unseen


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedParameter:
    """One parameter of a fit; arrays have its shape.

    Attributes
    ----------
    value, start : array
        Fitted value, and the value at the start.
    uncertainty, prior_deviation : array
        Posterior and prior deviations.
    resolved : array
        1 - posterior / prior variance: 0 is not determined by the record, 1 wholly.
    seen, unseen : (k, ...) array
        Patterns that the record determines best, and those that are least known after it.
    unit : str
        Unit of the values.
    labels : array of int, optional
        The likeliest class of each number.
    probabilities : (..., K) array, optional
        Probability of each class.
    classes : tuple of float, optional
        Values of the classes.
    """

    value: np.ndarray
    start: np.ndarray
    uncertainty: np.ndarray
    prior_deviation: np.ndarray
    resolved: np.ndarray
    seen: np.ndarray
    unseen: np.ndarray
    unit: str = ""
    labels: np.ndarray | None = None
    probabilities: np.ndarray | None = None
    classes: tuple[float, ...] | None = None

    @classmethod
    def still(cls, start: np.ndarray, unit: str) -> FittedParameter:
        """Return a parameter that was not fitted."""
        none, nothing = np.zeros(start.shape), np.zeros((0, *start.shape))
        return cls(value=start, start=start, uncertainty=none, prior_deviation=none, resolved=none, seen=nothing,
                   unseen=nothing, unit=unit)

    def over(self, shape: tuple[int, ...], unit: str) -> FittedParameter:
        """Return the parameter in another shape with as many numbers, and in another unit."""
        return replace(self, unit=unit, **{name: getattr(self, name).reshape(shape) for name in (
            "value", "start", "uncertainty", "prior_deviation", "resolved")})


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Answer:
    """Hold fitted parameters by name."""

    parameters: dict[str, FittedParameter]  # [str, FittedParameter]
    observability: Observability  # over all unknowns together, in the order of `parameters`

    @property
    def values(self) -> dict[str, np.ndarray]:
        """Fitted values, by name."""
        return {name: one.value for name, one in self.parameters.items()}

    @property
    def start(self) -> dict[str, np.ndarray]:
        """Start values, by name."""
        return {name: one.start for name, one in self.parameters.items()}

    @property
    def uncertainty(self) -> dict[str, np.ndarray]:
        """Posterior deviations, by name."""
        return {name: one.uncertainty for name, one in self.parameters.items()}

    @property
    def resolved(self) -> dict[str, np.ndarray]:
        """Shares of prior variances that the record took away, by name."""
        return {name: one.resolved for name, one in self.parameters.items()}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Fit(Answer):
    """Result of a fit.

    Attributes
    ----------
    predicted : (N,) array
        Record of the fitted values.
    deviance, cost, step : (iterations + 1,) arrays
        Deviance over that of noise; misfit with priors; change of the unknowns [prior deviations].
    stopped : str
        Reason of the end.
    unknowns : (n,) array
        z of the answer, from which another fit may begin.
    """

    predicted: np.ndarray
    deviance: np.ndarray
    cost: np.ndarray
    step: np.ndarray
    stopped: str
    unknowns: np.ndarray

    @property
    def iterations(self) -> int:
        """Number of steps."""
        return self.cost.size - 1

    @property
    def unseen(self) -> int:
        """Number of the least known patterns that the record does not determine at all."""
        return int((self.observability.unseen_resolved < HIDDEN).sum())

    def sentences(self) -> list[str]:
        """Return sentences about the fit, and about what the record determined."""
        look = self.observability
        total = look.deviation.size
        said = [f"{self.iterations} step{'s' * (self.iterations != 1)}: {self.stopped}", self.told()]
        said += [self._of_parameter(name, one) for name, one in self.parameters.items()]
        if self.deviance[-1] < QUIET:
            quiet = max(float(self.deviance[-1]), 1e-3)
            said.append(f"the residual is only {quiet:.2g} of the stated noise: the record probably has less, such as "
                        f"an image with more looks per bin (--looks {1 / quiet:.2g}), and the standard deviations "
                        "above are too large")
        if self.unseen:
            said.append(f"{'at least ' if self.unseen == look.unseen_resolved.size < total else ''}{self.unseen} "
                        f"pattern{'s' if self.unseen > 1 else ''} of the parameters cannot be told from the record: "
                        "along them the answer is the prior's")
        return said

    @staticmethod
    def _of_parameter(name: str, one: FittedParameter) -> str:
        unit = f" {one.unit}" if one.unit not in ("", "1") else ""
        middle = f"{np.median(one.uncertainty):.3g}{unit}"
        if one.value.size == 1:
            return (f"{name} is {one.value.item():.6g} ± {middle}, of which the record told "
                    f"{100 * one.resolved.item():.0f} %")
        return told_of(name, one.resolved, one.uncertainty, one.unit)

    def told(self) -> str:
        """Return a sentence on the number of parameters that the record determines."""
        look = self.observability
        return (f"the record tells {'' if look.complete else 'at least '}{look.effective:.1f} of "
                f"{look.deviation.size} numbers"
                f"{'' if look.complete else f', in the {look.singular_values.size} directions that were looked at'}")

    def to_dataset(self) -> xr.Dataset:
        """Return a dataset of the fit, which `mitsonar.write` writes as netCDF."""
        import xarray as xr

        variables = {"deviance": ("iteration", self.deviance, {"long_name": "deviance over that of noise"}),
                     "cost": ("iteration", self.cost), "step": ("iteration", self.step, {"units": "1"}),
                     "singular_value": ("pattern", self.observability.singular_values, {"units": "1"}),
                     "unseen_resolved": ("unseen", self.observability.unseen_resolved, {"units": "1"}),
                     "predicted": ("bin", self.predicted)}
        for name, one in self.parameters.items():
            variables |= dict(_variables(name, one))
        attrs = {"kind": "fit", "parameters": list(self.parameters), "stopped": self.stopped,
                 "effective_parameters": self.observability.effective,
                 "complete": int(self.observability.complete), "observable": "; ".join(self.sentences())}
        return xr.Dataset(variables, attrs=attrs)

    def __repr__(self) -> str:
        return "Fit\n" + "\n".join(f"    {one}" for one in self.sentences())


def told_of(name: str, resolved: np.ndarray, deviation: np.ndarray, unit: str) -> str:
    """Return a sentence on how many numbers of a parameter a record determined, and to what deviation."""
    told = resolved > TOLD
    if not told.any():
        return (f"{name}: none of its {told.size} numbers is told to better than {np.sqrt(1 - TOLD):.1f} of its "
                "deviation beforehand")
    return (f"{name}: {int(told.sum())} of {told.size} numbers are told, to ± {np.median(deviation[told]):.3g}"
            f"{f' {unit}' if unit else ''} in the middle of them")


def named(name: str, dims: tuple[str, ...], one: FittedParameter) -> dict[str, tuple]:
    """Return a parameter's variables by the names that every fit's dataset has."""
    unit = one.unit or "1"
    measured = {"": one.value, "_start": one.start, "_deviation": one.uncertainty,
                "_prior_deviation": one.prior_deviation}
    return {**{name + what: (dims, some, {"units": unit}) for what, some in measured.items()},
            f"{name}_resolved": (dims, one.resolved, {"units": "1"})}


def _variables(name: str, one: FittedParameter) -> Iterator[tuple[str, tuple]]:
    """Return a parameter's variables of a dataset."""
    dims = tuple(f"{name}_{axis}" for axis in range(one.value.ndim))
    yield from named(name, dims, one).items()
    for kind, dim, patterns in (("seen", "pattern", one.seen), ("unseen", "unseen", one.unseen)):
        yield f"{name}_{kind}", ((dim, *dims), patterns, {"units": one.unit or "1"})
    if one.labels is not None and one.probabilities is not None and one.classes is not None:
        yield f"{name}_class", (dims, one.labels, {"values": list(one.classes)})
        yield f"{name}_probability", ((*dims, f"{name}_classes"), one.probabilities, {"units": "1"})
