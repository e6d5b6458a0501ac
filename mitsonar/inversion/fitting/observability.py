"""Observability of unknowns: posterior covariance by the few directions that a record determines.

    A = U s Vᵀ,     posterior of z = I - V s² / (1 + s²) Vᵀ,     q = m + S z,     x = b(q)

A -> the whitened Jacobian at the answer (`misfit`); s -> singular values: at s = 1 record and prior determine a
combination equally well. With few unknowns, A is computed whole. Otherwise its range is found by random probes and one
power iteration (Halko, Martinsson and Tropp, 2011, algorithm 4.4). Singular values beyond the requested number of
directions are left out, which understates the information. Σ s² / (1 + s²) is the number of parameters that the record
determines (Rodgers, 2000, eq. 2.56).

The least determined combinations are the leading eigenvectors of the posterior covariance of q. The bounds b are not
linear: shares of variance refer to q, which no bound cuts. The deviation of x is half the distance from b(q - σ) to
b(q + σ), which stays within the bounds.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .misfit import MisfitLinearised

PRODUCTS = 3                       # a direction, of the randomised way
BLOCK = 2048                       # bins of a record that are looked at together
SPARE = 8                          # probes beyond the directions
TINY = 1e-150                      # for a deviation of 0
UNSEEN = 6                         # patterns that are given


@dataclass(frozen=True, kw_only=True, eq=False)
class Observability:
    """Observability of x."""

    singular_values: np.ndarray  # s, falling
    complete: bool  # whether these are all, or there may be more, none above the last
    deviation: np.ndarray  # of the posterior of x
    resolved: np.ndarray  # 1 - posterior / prior variance
    seen: np.ndarray  # patterns of x, each as large as the prior's deviation along it
    unseen: np.ndarray  # patterns of x that are least known, each of one posterior deviation
    unseen_resolved: np.ndarray  # share of each that the record determines

    @property
    def effective(self) -> float:
        """Return the number of parameters that the record determines."""
        square = self.singular_values ** 2
        return float((square / (1 + square)).sum())


def observe(about: MisfitLinearised, directions: int, seed: int) -> Observability:
    """Return the observability of the unknowns at some z."""
    size = about.z.size
    complete = size <= PRODUCTS * (directions + SPARE)
    values, right = _whole(about) if complete else _ranged(about, directions, seed)
    told = values ** 2 / (1 + values ** 2)
    seen = np.stack([about.spread(one) for one in right])
    prior = about.prior_deviation ** 2            # 0 of what stands still
    variance = np.maximum(prior - told @ seen ** 2, 0)
    unseen, share = _unseen(about, told, right)
    resolved = np.where(prior > 0, np.clip(1 - variance / np.maximum(prior, TINY), 0, 1), 0)
    return Observability(singular_values=values, complete=complete, deviation=about.mapped(np.sqrt(variance)),
                         resolved=resolved, seen=about.between_bounds(seen),
                         unseen=about.between_bounds(unseen), unseen_resolved=share)


def _whole(about: MisfitLinearised) -> tuple[np.ndarray, np.ndarray]:
    """Return all singular values, and right vectors in rows."""
    matrix = about.matrix()
    # the same values, without the record's length; block by block, so that only a block is copied
    small = [np.linalg.qr(matrix[begin:begin + BLOCK], mode="r") for begin in range(0, len(matrix), BLOCK)]
    _, values, right = np.linalg.svd(np.linalg.qr(np.concatenate(small), mode="r"))
    full = np.zeros(about.z.size)
    full[:values.size] = values
    return full, right


def _ranged(about: MisfitLinearised, directions: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest singular values, and right vectors in rows."""
    from mitsonar.device.chance import Salt

    random = np.random.default_rng([seed, Salt.PROBES])
    probes = random.standard_normal((directions + SPARE, about.z.size))
    left = np.linalg.qr(np.stack([about.forward(one) for one in probes], 1))[0]
    right = np.linalg.qr(np.stack([about.backward(one) for one in left.T], 1))[0]
    _, values, turned = np.linalg.svd(np.stack([about.forward(one) for one in right.T], 1), full_matrices=False)
    return values[:directions], (turned @ right.T)[:directions]


def _unseen(about: MisfitLinearised, told: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return leading patterns of the posterior covariance of q, and the shares of them that the record determines."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    scale = np.maximum(about.prior_deviation, TINY)            # parameters of different units weigh alike
    size = scale.size

    def covariance(q: np.ndarray) -> np.ndarray:
        z = about.gathered(np.ravel(q) / scale)
        return about.spread(z - right.T @ (told * (right @ z))) / scale

    count = min(UNSEEN, size)
    if size <= 2 * UNSEEN + 2:
        values, vectors = np.linalg.eigh(np.stack([covariance(one) for one in np.eye(size)]))
        values, vectors = values[-count:], vectors[:, -count:]
    else:
        first = np.cos(np.arange(size) * 2.399963)             # any vector that is orthogonal to no pattern
        operator = LinearOperator((size, size), matvec=covariance, dtype=np.float64)
        values, vectors = eigsh(operator, k=count, v0=first, tol=1e-3)
    order = np.argsort(values)[::-1]
    patterns = (vectors[:, order] * np.sqrt(np.maximum(values[order], 0))).T
    before = np.array([float(np.sum(about.gathered(one / scale) ** 2)) for one in vectors[:, order].T])
    return patterns * scale, np.clip(1 - values[order] / np.maximum(before, 1e-300), 0, 1)
