"""What a gradient is of: a record as a function of named parameters, and its linearisation.

    y = F(x)           the record, and the parameters                                    `ForwardModel.value`
    J = dF/dx          about one x                                                       `ForwardModel.linearised`
    J v,  Jᵀ w         how the record moves with the parameters; the gradient of w·y     `Linearised`

Parameters are arrays by name, as `mi.traverse` names them (`bed.vertex_positions`) or as a parametrisation does.
Records are flat. Whoever fits or checks asks for nothing else: what is behind, a sidescan's image, soundings' times,
the signals of elements, makes no difference to them.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

Values = Mapping[str, np.ndarray]  # parameters by name, float64, each of its own shape


class Linearised(Protocol):
    """A record about one set of values.

    Attributes
    ----------
    value : (N,) float64
        The record there.
    """

    value: np.ndarray

    def forward(self, tangents: Values) -> np.ndarray:
        """Return J v, (N,), of directions v; a parameter that is left out stands still.

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
    """A record as a function of parameters, with chance held fixed: the same rays and scatterers for all values.

    Attributes
    ----------
    start : dict[str, array]
        Values that it begins with, float64.
    units : dict[str, str]
        Of each parameter.
    """

    start: dict[str, np.ndarray]
    units: dict[str, str]

    def value(self, values: Values) -> np.ndarray:
        """Return the record of values, (N,); a parameter that is left out is as at the start.

        Raises
        ------
        ValueError
            If a name is unknown, a shape does not fit, or no record can be made of the values.
        """
        ...

    def linearised(self, values: Values) -> Linearised:
        """Return the record about values, with its Jacobian; arguments and errors as of `value`."""
        ...
