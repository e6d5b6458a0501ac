"""Likelihood of a record whose means a model predicts.

    Gaussian    D = (y - m)² / σ²
    gamma       D = 2 L (y / m - 1 - ln(y / m)),    variance m² / L

y -> the record; m -> ``predicted``; σ -> ``deviation``; L -> ``looks``: speckle's intensity, averaged over L looks, is
gamma distributed about its mean (Goodman, 1976, Some fundamental properties of speckle, eq. 18; the deviance is that of
McCullagh and Nelder, 1989, table 2.1). Half the sum of D is the misfit. It is lowest at the truth on average; least
squares of intensities is not, once it weighs bins by what they came out as, and of levels it is off by ψ(L) - ln L.

A step needs each bin's slope ½ dD/dm and weight w, the expected curvature (Fisher's scoring). With
``robust`` = k, deviances beyond k² grow like their root (Huber, 1964), and weigh less.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

QUANTILES, NODES = 1000, 65         # numbers that averages of robust deviances are taken over; looks between them
LEAST_SHARE = 1e-6                 # of the record's mean: a mean below is no echo, and gamma's log has no value there


@dataclass(frozen=True, kw_only=True, eq=False)
class Terms:
    """A record's misfit, bin by bin; bins that do not count have zeros."""

    deviance: np.ndarray  # (N,)
    slope: np.ndarray  # (N,): ½ dD/dm
    weight: np.ndarray  # (N,): expected ½ d²D/dm², at least 0

    @property
    def misfit(self) -> float:
        """Half the sum of deviances."""
        return 0.5 * float(self.deviance.sum())


class Likelihood(Protocol):
    """Interface between a fit and its data.

    Attributes
    ----------
    counted : (N,) bool
        Bins that count.
    expected : float
        What the sum of deviances is on average, at the truth.
    """

    counted: np.ndarray
    expected: float

    def terms(self, predicted: np.ndarray) -> Terms:
        """Return the misfit of means (N,).

        Raises
        ------
        ValueError
            If the shape does not fit, or a mean that counts is not finite.
        """
        ...


class Gaussian:
    """A record with normal errors.

    Parameters
    ----------
    record : (...) float
        NaN where a bin does not count.
    deviation : float or (...) float
        σ, in the record's unit.
    robust : float, optional
        Deviations beyond which a bin counts less.

    Raises
    ------
    ValueError
        If no bin counts, a deviation is not above zero, or shapes do not fit.
    """

    def __init__(self, record: np.ndarray, deviation: float | np.ndarray, *, robust: float | None = None):
        self._record, self.counted = _record(record)
        self._deviation = _positive("deviation", deviation, np.shape(record))
        self._robust = _checked_robust(robust)
        self.expected = float(self.counted.sum()) * _normal_deviance(self._robust)

    def terms(self, predicted: np.ndarray) -> Terms:
        """Return the misfit of means (N,); see `Likelihood.terms`."""
        means = _means(predicted, self.counted)
        rest = np.where(self.counted, means - self._record, 0) / self._deviation
        weight = np.where(self.counted, 1 / self._deviation ** 2, 0)
        return _tamed(rest ** 2, rest / self._deviation, weight, self._robust)


class Gamma:
    """A record of speckled intensities.

    Parameters
    ----------
    record : (...) float [µPa²]
        Intensities; NaN, or 0 where there is no echo at all, where a bin does not count.
    looks : float or (...) float
        L, effective looks of each bin: 1 is full speckle. An error of the model of the relative deviation s makes them
        1 / (1/L + s²).
    background : float or (...) float [µPa²]
        Added to the model's means: noise that the record has.
    robust : float, optional
        Deviations beyond which a bin counts less.

    Raises
    ------
    ValueError
        If no bin counts, an intensity is below zero, looks are not above zero, or shapes do not fit.
    """

    def __init__(self, record: np.ndarray, looks: float | np.ndarray = 1.0, *,
                 background: float | np.ndarray = 0.0, robust: float | None = None):
        given = np.asarray(record, float)
        if np.any(given < 0):
            raise ValueError(f"{int((given < 0).sum())} intensities are below zero; give intensities, not levels")
        self._record, self.counted = _record(np.where(given == 0, np.nan, given))
        self._looks = _positive("looks", looks, given.shape)
        floor = np.broadcast_to(np.asarray(background, float), given.shape).ravel()
        if not (np.isfinite(floor).all() and (floor >= 0).all()):
            raise ValueError("background holds numbers that are below zero or not finite; give intensities")
        # a mean of nothing would be infinitely unlikely where there is an echo
        self._floor = np.maximum(floor, LEAST_SHARE * float(self._record[self.counted].mean()))
        self._robust = _checked_robust(robust)
        self.expected = float(_gamma_deviance(self._looks[self.counted], self._robust).sum())

    def terms(self, predicted: np.ndarray) -> Terms:
        """Return the misfit of means (N,); see `Likelihood.terms`."""
        means = np.where(self.counted, np.maximum(_means(predicted, self.counted), 0) + self._floor, 1)
        looks = np.where(self.counted, self._looks, 0)
        ratio = np.where(self.counted, self._record, 1) / means
        deviance = np.where(self.counted, 2 * looks * (ratio - 1 - np.log(ratio)), 0)
        return _tamed(deviance, looks * (1 - ratio) / means, looks / means ** 2, self._robust)


def _tamed(deviance: np.ndarray, slope: np.ndarray, weight: np.ndarray, robust: float | None) -> Terms:
    """Return the terms, where deviances above robust² grow as their roots."""
    if robust is None:
        return Terms(deviance=deviance, slope=slope, weight=weight)
    tamed, less = huber(deviance, robust)
    return Terms(deviance=tamed, slope=less * slope, weight=less * weight)


def huber(deviance: np.ndarray, robust: float) -> tuple[np.ndarray, np.ndarray]:
    """Return deviances that grow as their roots above robust², and the factors of their weights."""
    root = np.sqrt(np.maximum(deviance, 0))
    return (np.where(root > robust, robust * (2 * root - robust), deviance),
            np.minimum(1, robust / np.maximum(root, robust)))


def _normal_deviance(robust: float | None) -> float:
    """Return the mean deviance of a normal number at the truth."""
    from scipy.special import ndtri

    if robust is None:
        return 1.0
    rest = ndtri((np.arange(QUANTILES) + 0.5) / QUANTILES)
    return float(_tamed(rest ** 2, rest, rest, robust).deviance.mean())


def _gamma_deviance(looks: np.ndarray, robust: float | None) -> np.ndarray:
    """Return the mean deviances of intensities of looks (n,) at the truth."""
    from scipy.special import digamma, gammaincinv

    if robust is None:
        return 2 * looks * (np.log(looks) - digamma(looks))
    nodes = np.unique(looks) if np.unique(looks).size <= NODES else np.geomspace(looks.min(), looks.max(), NODES)
    quantile = (np.arange(QUANTILES) + 0.5) / QUANTILES
    ratio = np.maximum(gammaincinv(nodes[:, None], quantile) / nodes[:, None], 1e-300)
    plain = 2 * nodes[:, None] * (ratio - 1 - np.log(ratio))
    return np.interp(looks, nodes, _tamed(plain, plain, plain, robust).deviance.mean(1))


def _record(record: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the record as a flat array, with zeros where it does not count, and a flag where it counts."""
    flat = np.asarray(record, float).ravel()
    counted = np.isfinite(flat)
    if not counted.any():
        raise ValueError("the record has no finite value that counts; check its values and mask")
    return np.where(counted, flat, 0), counted


def _positive(name: str, value: float | np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return an array of numbers above zero, one for each value of the record."""
    array = np.asarray(value, float)
    if array.shape not in ((), shape):
        raise ValueError(f"{name} has the shape {array.shape}; give one number, or an array of the record's {shape}")
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise ValueError(f"{name} holds numbers that are not finite and above zero; mask bins in the record, by NaN")
    return np.broadcast_to(array, shape).ravel()


def _checked_robust(robust: float | None) -> float | None:
    if robust is not None and not (np.isfinite(robust) and robust > 0):
        raise ValueError(f"robust is {robust:g}; give a number of deviations above zero, or leave it out")
    return robust


def _means(predicted: np.ndarray, counted: np.ndarray) -> np.ndarray:
    """Return a model's means after a check."""
    means = np.asarray(predicted, float).ravel()
    if means.shape != counted.shape:
        raise ValueError(f"the model gives {means.size} values, and the record has {counted.size}; fit a record of the "
                         "same sonar")
    if not np.isfinite(means[counted]).all():
        raise ValueError("the model gives values that are not finite where the record counts")
    return means
