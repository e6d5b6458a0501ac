"""Phases without jumps of a turn, over an image.

    minimise  Σ w_pq (u_p - u_q - W(φ_p - φ_q))²                 over neighbours p, q; w of the less coherent of two
    φ + 2π round((u - φ) / 2π)                                   so that what comes out is the phase itself, and turns

φ -> ``phase``, W wraps into -π ... π. Solved by conjugate gradients, preconditioned with the same sum without weights,
which cosine transforms invert (Ghiglia and Romero 1994, J. Opt. Soc. Am. A 11, 107).

It follows any bed whose neighbours differ by less than half a turn. Where a step is higher, as at a wall, the turns of
what lies beyond are right only if some way round the step is not; and the whole is known but for a common turn.
"""
from __future__ import annotations

import numpy as np
from scipy import fft, ndimage

__all__ = ["unwrapped"]

ROUNDS, ENOUGH = 200, 1e-4


def unwrapped(phase: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Unwrap phases.

    Parameters
    ----------
    phase : (A, C) [rad]
        NaN where there is none.
    weight : (A, C) [-]
        0 where a phase counts for nothing.

    Returns
    -------
    (A, C) [rad]
        `phase` plus whole turns; the mean over the weights is within half a turn of 0. NaN where it was.

    Raises
    ------
    ValueError
        If the shapes differ, or a weight is negative or no number.
    """
    if phase.ndim != 2 or phase.shape != weight.shape or not np.all(weight >= 0):
        raise ValueError(f"phases of the shape {phase.shape} and weights of {weight.shape} were given; give two "
                         "dimensions, the same for both, and weights of 0 or more")
    known = np.isfinite(phase)
    flat, share = np.where(known, phase, 0.0), np.where(known, weight, 0.0)
    if not share.any():
        return np.where(known, phase, np.nan)
    share = share / share.max()
    links = [np.minimum(share[1:], share[:-1]), np.minimum(share[:, 1:], share[:, :-1])]
    steps = [_wrapped(np.diff(flat, axis=axis)) for axis in (0, 1)]
    smooth = _solved(_divergence([link * step for link, step in zip(links, steps)], phase.shape), links)
    smooth = smooth - np.angle(np.sum(share * np.exp(1j * (smooth - flat))))
    result = flat + 2 * np.pi * np.round((smooth - flat) / (2 * np.pi))
    parts, count = ndimage.label(share > 0)
    for part in range(1, count + 1):                    # patches apart know nothing of each other's turns
        inside = parts == part
        mean = np.sum(share[inside] * result[inside]) / np.sum(share[inside])
        result[inside] -= 2 * np.pi * np.round(mean / (2 * np.pi))
    return np.where(known, result, np.nan)


def _solved(right: np.ndarray, links: list[np.ndarray]) -> np.ndarray:
    found, rest = np.zeros_like(right), right.copy()
    size, before, along = float(np.linalg.norm(right)), 0.0, np.zeros_like(right)
    for _ in range(ROUNDS):
        if np.linalg.norm(rest) <= ENOUGH * size:
            break
        better = _without_weights(rest)
        product = float(np.sum(rest * better))
        along = better + (product / before if before else 0.0) * along
        before = product
        pushed = _divergence([link * np.diff(along, axis=axis) for axis, link in enumerate(links)], right.shape)
        length = product / float(np.sum(along * pushed))
        found, rest = found + length * along, rest - length * pushed
    return found


def _divergence(flows: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """What flows (A - 1, C), (A, C - 1) to later neighbours leave behind, (A, C), with the sign of a positive sum."""
    total = np.zeros(shape)
    total[1:] += flows[0]
    total[:-1] -= flows[0]
    total[:, 1:] += flows[1]
    total[:, :-1] -= flows[1]
    return total


def _without_weights(right: np.ndarray) -> np.ndarray:
    waves = [2 - 2 * np.cos(np.pi * np.arange(size) / size) for size in right.shape]
    total = waves[0][:, None] + waves[1]
    total[0, 0] = np.inf
    return fft.idctn(fft.dctn(right, type=2) / total, type=2)


def _wrapped(phase: np.ndarray) -> np.ndarray:
    return phase - 2 * np.pi * np.round(phase / (2 * np.pi))
