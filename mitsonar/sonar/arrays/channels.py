"""Errors of receivers: what amplifiers, filters and cables multiply their signals by, and beamformers do not correct.

    ε_n = (1 + σ g_n) e^{iσ h_n},      w_n -> w_n ε_n Σ|w| / Σ w ε                                                 (1)
    <|W|²> = ((1 + σ²) e^{σ²} - 1) Σ w_n² / (Σ|w_n|)²  ≈  2σ² / N                                                 (2)

g, h Gaussian of variance 1; σ -> ``rms``, of amplitude [-] and of phase [rad]; w_n -> ``weights``. The second factor of
(1) is a calibration on the axis of the beam. (2) is the mean power of the diffuse side lobes of N receivers relative to
that axis, everywhere (Steinberg 1976, Principles of aperture and array system design, ch. 13).
"""
from __future__ import annotations

import numpy as np

from mitsonar.device.chance import Salt


def flawed(weights: np.ndarray, rms: float, seed: int | None = None) -> np.ndarray:
    """Return weights (K, N) of K apertures of the same receivers with errors, each calibrated on its axis."""
    if not rms:
        return weights
    words = [weights.shape[1], Salt.RECEIVER_FLAWS] if seed is None else [weights.shape[1], Salt.RECEIVER_FLAWS, seed]
    draw = np.random.default_rng(words).standard_normal((2, weights.shape[1]))
    off = weights * (1 + rms * draw[0]) * np.exp(1j * rms * draw[1])
    return off * (np.abs(weights).sum(1, keepdims=True) / off.sum(1, keepdims=True))


def diffuse_level(weights: np.ndarray, rms: float) -> float:
    """Return (2), the mean power of the diffuse side lobes of weights (N,) relative to their axis."""
    share = np.square(weights).sum() / np.abs(weights).sum() ** 2
    return float(((1 + rms ** 2) * np.exp(rms ** 2) - 1) * share)
