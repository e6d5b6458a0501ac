"""Residual Doppler of an echo relative to its row's factor: a delay and phase of its compressed pulse.

    S_{1+d}(f) ≈ S_1(f) e^{-2πi f τ(d)} e^{2πi φ(d)}

d -> relative difference of the echo's factor from the row's; τ -> ``delay`` [s], φ -> ``phase`` [cycles], both
polynomials of d without a constant. They maximise the correlation of both sides, computed from the spectra of the pulse
itself, so that they hold for any pulse: a cw turns by f0 d T/2; a sweep is also delayed by about -f0 d T/B.

The remaining error is a change of shape: the frequency of a cw, which no delay corrects, and the ends of a sweep that
leave the replica's band. It is -29 dB of a cw's peak where f0 d T = 0.05, and -38 dB of an lfm's of BT = 10 where that
is 0.09.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import drjit as dr
import numpy as np
from scipy.fft import fftfreq
from scipy.optimize import minimize_scalar

from mitsonar.device.types import Numbers
from mitsonar.sonar.pulses.pulse import Pulse

WIDEST = 0.003                     # residuals that are looked at: 2.2 m/s
BAND = 0.25                        # of the pulse's band: further a residual may not move it
NODES = 24                         # on either side of 0
RATIO = 2 ** 0.5                   # from each to the next
DEGREE = 3
FINER = 4                          # frequencies a 1/T


@dataclass(frozen=True, kw_only=True, eq=False)
class ResidualDoppler:
    """Polynomials of the module."""

    delay_powers: np.ndarray  # (3,) [s]: of d, d², d³
    phase_powers: np.ndarray  # (3,) [cycles]
    widest: float  # largest |d| that they were fitted for

    def delay(self, residual: Numbers) -> Numbers:
        """Return τ [s], to be added to the echo's delay; NumPy and Dr.Jit arrays alike."""
        return _polynomial(self.delay_powers, residual)

    def phase(self, residual: Numbers) -> Numbers:
        """Return φ [cycles], by which the echo's amplitude is turned; NumPy and Dr.Jit arrays alike."""
        return _polynomial(self.phase_powers, residual)


@lru_cache(maxsize=32)
def residual_doppler(pulse: Pulse) -> ResidualDoppler:
    """Find the polynomials of a pulse."""
    rate = 2 * (pulse.suggested_sampling_rate + 2 * BAND * pulse.bandwidth)
    samples = int(np.ceil(FINER * pulse.duration * rate)) + FINER
    frequency, still = fftfreq(samples, 1 / rate), pulse.spectrum(rate, samples)
    widest = min(WIDEST, BAND * pulse.bandwidth / pulse.frequency)
    size = widest * RATIO ** np.arange(1 - NODES, 1)
    found = np.array([_followed(pulse, rate, samples, frequency, still, sign * size) for sign in (-1, 1)])
    d = np.concatenate([-size, size])
    powers = (d[:, None] / widest) ** np.arange(1, DEGREE + 1)
    delay, phase = (np.linalg.lstsq(powers, found[..., one].ravel(), rcond=None)[0] / widest ** np.arange(1, DEGREE + 1)
                    for one in (0, 1))
    return ResidualDoppler(delay_powers=delay, phase_powers=phase, widest=widest)


def _followed(pulse: Pulse, rate: float, samples: int, frequency: np.ndarray, still: np.ndarray,
              residuals: np.ndarray) -> list[tuple[float, float]]:
    """Follow delay [s] and phase [cycles] of the best match from residual to residual, outwards from 0."""
    found = [(0.0, 0.0)]
    for d in residuals:
        # the replica weighs what a matched filter lets through
        product = pulse.spectrum(rate, samples, 1 + d) * np.conj(still) * np.abs(still) ** 2

        def match(delay: float, product: np.ndarray = product) -> complex:
            return complex(np.sum(product * np.exp(2j * np.pi * frequency * delay)))

        guess = RATIO * found[-1][0]
        reach = 0.3 / pulse.bandwidth
        best = minimize_scalar(lambda delay: -abs(match(delay)), bounds=(guess - reach, guess + reach),
                               method="bounded", options={"xatol": 1e-6 * reach})
        turn = np.angle(match(best.x)) / (2 * np.pi)
        found.append((float(best.x), float(turn + np.round(RATIO * found[-1][1] - turn))))
    return found[1:]


def _polynomial(powers: np.ndarray, value: Numbers) -> Numbers:
    # opaque on the device, so that another pulse makes no other kernel
    first, second, third = (dr.opaque(type(value), float(power)) if dr.is_jit_v(value) else float(power)
                            for power in powers)
    return value * (first + value * (second + value * third))
