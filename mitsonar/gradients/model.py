"""Protocols of a record as a function of named parameters, and of its linearisation.

    y = F(x)           the record, and the parameters                                    `ForwardModel.value`
    J = dF/dx          about one x                                                       `ForwardModel.linearised`
    J v,  Jᵀ w         how the record moves with the parameters; the gradient of w·y     `Linearised`

Parameters are arrays by name, as in `mi.traverse` (`bed.vertex_positions`) or a parametrisation. Records are flat.
Fits and checks use nothing else, whether the record is an image, travel times of soundings or signals of elements.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np

Values = Mapping[str, np.ndarray]  # parameters by name, float64, each of its own shape


class Linearised(Protocol):
    """Record about one set of values.

    Attributes
    ----------
    value : (N,) float64
        Record at these values.
    """

    value: np.ndarray

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v, (N,), for directions v; parameters that are left out do not move.

        Raises
        ------
        ValueError
            If a name is unknown or a shape does not fit.
        """
        ...

    def backward(self, cotangent: np.ndarray) -> dict[str, np.ndarray]:
        """Return Jᵀ w of weights w (N,), one array per parameter in its shape.

        Raises
        ------
        ValueError
            If the shape does not fit.
        """
        ...


class ForwardModel(Protocol):
    """Record as a function of parameters; rays and scatterers are the same for all values.

    Attributes
    ----------
    start : dict[str, array]
        Values at the start, float64.
    units : dict[str, str]
        Unit of each parameter.
    """

    start: dict[str, np.ndarray]
    units: dict[str, str]

    def value(self, values: Values) -> np.ndarray:
        """Return the record (N,) for values; parameters that are left out have their start values.

        Raises
        ------
        ValueError
            If a name is unknown, a shape does not fit, or no record can be made of the values.
        """
        ...

    def linearised(self, values: Values) -> Linearised:
        """Return the record about values, with its Jacobian; arguments and errors are those of `value`."""
        ...


@runtime_checkable
class ShapedModel(ForwardModel, Protocol):
    """Model whose record has a shape, such as pings, rows and bins."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Return the shape of the record before it is made flat."""
        ...


@runtime_checkable
class PartialLinearised(Linearised, Protocol):
    """Linearised record that leaves something out."""

    @property
    def told(self) -> Mapping[str, float]:
        """Return shares of echoes and bins that the record and its derivatives leave out, by name."""
        ...


def shape_of(model: ForwardModel) -> tuple[int, ...] | None:
    """Return the shape of a model's record before it is made flat; None if it has no other."""
    return tuple(model.shape) if isinstance(model, ShapedModel) else None


def left_out(about: Linearised) -> Mapping[str, float]:
    """Return the shares that a linearised record leaves out, by name; empty for a whole record."""
    return about.told if isinstance(about, PartialLinearised) else {}
