"""Prior of a parameter, and its bounds.

    x = b(m + S z),     z ~ N(0, 1)

m -> ``mean``; S -> a square root of the covariance, from ``deviation``, ``length``, ``level`` and ``slope``, or from
``covariance`` (`smoothness`); b -> the bounds. A fit steps in z, in which all unknowns have the same scale.

Bounds are kept by a transformation of q, so that x always lies between them:

    both      x = m + h tanh((q - m) / h),         m, h -> middle and half width
    one       x = b ± s ln(1 + exp(±(q - b) / s)), s -> the prior's deviation

A projection onto bounds would stop steps that are solved for all unknowns together; the transformation is smooth. Far
from a bound x equals q; the prior is normal in q.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .classes import Classes
from .smoothness import Root, covariance_root, grid_root, independent_root, mesh_root


@dataclass(frozen=True, kw_only=True, eq=False)
class Bounds:
    """Limits of a parameter's numbers."""

    lower: float  # may be infinite
    upper: float  # may be infinite
    scale: np.ndarray  # s

    def inside(self, free: np.ndarray) -> np.ndarray:
        """Return x of q (n,)."""
        if self._both:
            middle, half = self._middle
            return middle + half * np.tanh((free - middle) / half)
        sign, bound = self._one
        return free if sign == 0 else bound + sign * self.scale * np.logaddexp(0, sign * (free - bound) / self.scale)

    def slope(self, free: np.ndarray) -> np.ndarray:
        """Return dx/dq of q (n,)."""
        if self._both:
            middle, half = self._middle
            return 1 / np.cosh(np.clip((free - middle) / half, -300, 300)) ** 2
        sign, bound = self._one
        if sign == 0:
            return np.ones_like(free)
        return 0.5 * (1 + np.tanh(0.5 * sign * (free - bound) / self.scale))

    def deviation(self, free: np.ndarray, of_free: np.ndarray) -> np.ndarray:
        """Return that of x where q (n,) has the deviations (n,): half the way from one below to one above."""
        if not (self._both or self._one[0]):
            return of_free
        return 0.5 * (self.inside(free + of_free) - self.inside(free - of_free))

    def free(self, numbers: np.ndarray) -> np.ndarray:
        """Return q of x (n,) strictly between the bounds."""
        if self._both:
            middle, half = self._middle
            return middle + half * np.arctanh((numbers - middle) / half)
        sign, bound = self._one
        if sign == 0:
            return numbers
        above = sign * (numbers - bound) / self.scale
        return bound + sign * self.scale * (above + np.log(-np.expm1(-above)))

    @property
    def _both(self) -> bool:
        return bool(np.isfinite(self.lower) and np.isfinite(self.upper))

    @property
    def _middle(self) -> tuple[float, float]:
        return (self.lower + self.upper) / 2, (self.upper - self.lower) / 2

    @property
    def _one(self) -> tuple[int, float]:
        if np.isfinite(self.lower):
            return 1, self.lower
        return (-1, self.upper) if np.isfinite(self.upper) else (0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Prior of a parameter.

    Parameters
    ----------
    deviation : float or array, optional
        Standard deviation about the mean, in the parameter's unit; numbers with a deviation of 0 are fixed.
    covariance : (n, n) array, optional
        Covariance matrix, in place of ``deviation``.
    mean : float or array, optional
        Mean, from which a fit also starts; default: the model's start.
    length : float [m], optional
        Correlation length between neighbours; default: independent numbers. Needs `spacing`, or `vertices` and `faces`.
    spacing : tuple of float [m], optional
        Node distance along each axis of a parameter that is a grid; infinite: nodes are independent along that axis.
    level, slope : float, optional
        Deviations of a grid's mean and of its slopes along each axis [1/m]; ``deviation`` is that of the remainder.
        Mean and slopes are the first of the unknowns.
    vertices, faces : (n, 3) arrays, optional
        Mesh of a parameter with one number per vertex.
    lower, upper : float
        Bounds of the answer.
    classes : Classes, optional
        Classes of the numbers.

    Raises
    ------
    ValueError
        If a length has neither spacing nor mesh, spacing or mesh have no length, or both are given.
    """

    deviation: float | np.ndarray = 0.0
    mean: float | np.ndarray | None = None
    length: float | None = None
    spacing: tuple[float, ...] | None = None
    level: float | None = None
    slope: float | None = None
    covariance: np.ndarray | None = None
    vertices: np.ndarray | None = None
    faces: np.ndarray | None = None
    lower: float = -np.inf
    upper: float = np.inf
    classes: Classes | None = None

    def __post_init__(self):
        if (self.vertices is None) != (self.faces is None):
            raise ValueError("a prior on a mesh needs its vertices and its faces; give both")
        ways = (self.spacing is not None) + (self.vertices is not None)
        if self.length is not None and ways != 1:
            raise ValueError("a prior's length needs the nodes' spacing, or the mesh's vertices and faces: one of them")
        if self.length is None and ways:
            raise ValueError("a prior with nodes' spacing, or a mesh, needs a length; give it, or leave them out")
        if (self.level is None) != (self.slope is None) or self.level is not None and self.spacing is None:
            raise ValueError("a prior's plane needs level and slope both, and the nodes' spacing")
        if not min(1.0 if one is None else one for one in (self.level, self.slope)) > 0:
            raise ValueError(f"a prior's plane has the deviations {self.level:g} and {self.slope:g}; give numbers "
                             "above 0")
        if not self.lower < self.upper:
            raise ValueError(f"a prior has the bounds {self.lower:g} and {self.upper:g}; give a lower and a higher one")

    def bound(self, name: str, start: np.ndarray) -> BoundPrior:
        """Return it for the parameter of a name and a start.

        Raises
        ------
        ValueError
            If shapes do not fit, a deviation is not above zero or more than bounds have room for, or the mean is not
            between them.
        """
        mean = self._flat(name, "mean", start if self.mean is None else self.mean, start)
        deviation = self._flat(name, "deviation", self.deviation, start)
        if self.covariance is not None:
            deviation = np.sqrt(np.diag(self.covariance))
        if not ((deviation >= 0).all() and deviation.any()) or self.length is not None and not deviation.all():
            raise ValueError(f"the prior of {name} has deviations that are not above zero; give its standard deviation")
        outside = ~((mean > self.lower) & (mean < self.upper))
        if outside.any():
            raise ValueError(f"{name} begins at {mean[outside][0]:g}, which is not between the bounds {self.lower:g} "
                             f"and {self.upper:g}; begin inside")
        limits = Bounds(lower=self.lower, upper=self.upper, scale=deviation)
        widest = (self.upper - self.lower) / 2
        if (deviation > widest).any():
            raise ValueError(f"the prior of {name} has a deviation of {deviation.max():g} between the bounds "
                             f"{self.lower:g} and {self.upper:g}, where none is above {widest:g}; give a smaller one "
                             "or wider bounds")
        free = limits.free(mean)
        # the deviation asked for is that of x, about the mean
        root = self._root(name, start, deviation / limits.slope(free))
        return BoundPrior(mean=free, root=root, deviation=root.deviation * limits.slope(free), limits=limits,
                          classes=self.classes)

    def _root(self, name: str, start: np.ndarray, deviation: np.ndarray) -> Root:
        if self.covariance is not None:
            return covariance_root(self.covariance)
        if self.length is None:
            return independent_root(deviation)
        if self.spacing is not None:
            if len(self.spacing) != start.ndim:
                raise ValueError(f"{name} has the shape {start.shape}, and its prior {len(self.spacing)} spacings; "
                                 "give one an axis")
            plane = None if self.level is None or self.slope is None else (self.level, self.slope)
            return grid_root(start.shape, self.spacing, self.length, deviation, plane)
        assert self.vertices is not None and self.faces is not None
        if len(self.vertices) != start.size:
            raise ValueError(f"{name} has {start.size} numbers, and the mesh of its prior {len(self.vertices)} "
                             "vertices; a smooth prior needs one number per vertex, such as heights")
        return mesh_root(self.vertices, self.faces, self.length, deviation)

    @staticmethod
    def _flat(name: str, what: str, value: float | np.ndarray, start: np.ndarray) -> np.ndarray:
        array = np.asarray(value, float)
        if array.shape not in ((), start.shape):
            raise ValueError(f"the prior of {name} has a {what} of the shape {array.shape}; give one number, or "
                             f"{start.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"the prior of {name} has a {what} that is not finite")
        return np.broadcast_to(array, start.shape).ravel().copy()


@dataclass(frozen=True, kw_only=True, eq=False)
class BoundPrior:
    """A parameter's prior, for its own number of nodes; all arrays flat."""

    mean: np.ndarray  # of q, in which there are no bounds
    root: Root
    deviation: np.ndarray  # of x, at the mean
    limits: Bounds
    classes: Classes | None
