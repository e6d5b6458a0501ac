"""Factors of a grid's spectrum, row by row: pulse, receiver, matched filter, and the bell in time.

    P_r(f) = S_η(f) F(f) S_r*(f) R(f) / (g K(f)) e^{-κ(f) t_m},        g = mean of S_1 S_r* F over f

S_η -> the pulse's spectrum with the two-way factor η of the row, S_r the replica's, F the receiver's filter, R the
response of the kernel `impulses.BandLimited`, K the bell's spectrum, κ and t_m as in `absorption`. An echo of amplitude
a peaks at its delay with the value a, as after `reception.received` and `matched_filter`.

Spectra are made at factors a step apart and interpolated: η_k = 1 + kδ. The turn of the pulse's middle, f0 (η - 1) T/2
cycles, is taken out before; what is left turns by π f0 δ T/2 from node to node at the pulse's ends. Nodes stay for the
next ping.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft

from mitsonar.device.types import Real
from mitsonar.sonar.pulses.pulse import Pulse, Window

from ..impulses import BandLimited
from ..matched_filtering import replica_spectra
from ..reception import band_filter, check_record, excess_loss_rate, padded_length
from .absorption import AbsorptionTerms, absorption_terms
from .spreading import PACKET
from .transforms import TILE

TURN = 0.045                       # [rad] halfway between two nodes at the pulse's ends: interpolated within 1e-3
DROPPED = 1e-3                     # of the sum of |P|: frequencies that are left out
MOST_NODES = 4096                  # kept from ping to ping,
MOST_KEPT = 1 << 27                # and numbers in them: a gigabyte
STRETCH = 1.05                     # of a pulse by Doppler


@dataclass(frozen=True, kw_only=True, eq=False)
class RowTransfers:
    """Transfer functions of rows."""

    pairs: np.ndarray  # (K, F, 2): P at the Doppler factors of a node and of the next, the turn of the middle taken out
    node: np.ndarray  # (R,): the one below a row's factor
    mix: np.ndarray  # (R, 2): what a row takes of either, times the turn of its own middle

    @property
    def rows(self) -> np.ndarray:
        """Return P of every row (R, F)."""
        return np.einsum("rfk,rk->rf", self.pairs[self.node], self.mix)


class PulseResponse:
    """Pulse and matched filter on the frequencies of a record's FFT."""
    # sampling_rate [Hz]; used (F,); offset (F,) [Hz]; replica (F,)

    def __init__(self, pulse: Pulse, window: Window | None, sampling_rate: float, samples: int, padding: int):
        check_record(pulse, sampling_rate, samples)
        length = padded_length(samples + padding, STRETCH * pulse.duration, sampling_rate)
        length = PACKET * fft.next_fast_len(-(-length // PACKET))
        self.pulse, self.sampling_rate, self.samples, self.length = pulse, sampling_rate, samples, length
        spectra = replica_spectra(pulse, sampling_rate, length, window)
        size = np.abs(spectra.echo)
        rising = np.argsort(size)
        count = np.count_nonzero(np.cumsum(size[rising]) > DROPPED * size.sum())
        self.used = np.sort(rising[-min(-(-count // TILE), length // TILE) * TILE:])
        self.offset = spectra.frequency[self.used]
        self.replica = (spectra.replica / spectra.gain)[self.used]
        kernel, cycles = BandLimited(), self.offset / sampling_rate
        keep = band_filter(self.offset, sampling_rate)
        self._received = self.replica * keep * kernel.response(cycles) / kernel.spectrum(cycles)
        self._loss: np.ndarray | float = 1.0
        self._nodes: dict[int, np.ndarray] = {}

    def weaken(self, absorption_db: Callable[[np.ndarray], np.ndarray], sound_speed: float, start: float,
               margin: int) -> AbsorptionTerms:
        """Apply the absorption at the middle of the record, and return the terms of the remaining absorption."""
        # sound_speed [m/s]; start [s]
        loss = excess_loss_rate(self.offset, self.sampling_rate, self.pulse.frequency, absorption_db, sound_speed)
        self._loss = np.exp(-loss * (start + 0.5 * self.samples / self.sampling_rate))
        self._nodes.clear()
        return absorption_terms(loss / self.sampling_rate, self.offset / self.sampling_rate, self.weight,
                                0.5 * self.samples + margin)

    @cached_property
    def weight(self) -> np.ndarray:
        """|P| of a target at rest, (F,) [-]."""
        return np.abs(self._received * self.pulse.spectrum(self.sampling_rate, self.length)[self.used])

    @property
    def step(self) -> float:
        """δ of the module [-]."""
        return 2 * TURN / (np.pi * self.pulse.frequency * self.pulse.duration)

    def transfers(self, doppler: np.ndarray) -> RowTransfers:
        """Return the transfer functions of rows with factors (R,) [-]."""
        if not (np.isfinite(doppler).all() and np.min(doppler) > 0):
            raise ValueError(f"Doppler factors reach from {np.min(doppler):.6g} to {np.max(doppler):.6g}; give finite "
                             "ones above 0.")
        place = (np.asarray(doppler, float) - 1) / self.step
        node = np.floor(place).astype(np.int64)
        share = place - node
        numbers = range(int(node.min()), int(node.max()) + 2)
        if len(numbers) * max(len(self.used), MOST_KEPT // MOST_NODES) > MOST_KEPT:
            raise ValueError(f"a pulse of {1000 * self.pulse.duration:g} ms with Doppler factors from "
                             f"{np.min(doppler):.6g} to {np.max(doppler):.6g} takes {len(numbers)} spectra; take a "
                             "shorter pulse or a slower platform, or picture elements")
        if len(self._nodes) + len(numbers) > MOST_NODES:
            self._nodes.clear()
        nodes = np.stack([self._node(number) for number in numbers])
        turn = np.exp(2j * np.pi * self._middle(np.asarray(doppler, float)))
        return RowTransfers(pairs=np.stack([nodes[:-1], nodes[1:]], -1), node=(node - numbers[0]).astype(np.uint32),
                            mix=np.stack([turn * (1 - share), turn * share], -1).astype(np.complex64))

    def _node(self, number: int) -> np.ndarray:
        if number not in self._nodes:
            factor = 1 + number * self.step
            check_record(self.pulse, self.sampling_rate, self.samples, factor)
            sent = self.pulse.spectrum(self.sampling_rate, self.length, factor)[self.used]
            turn = np.exp(-2j * np.pi * self._middle(factor))
            self._nodes[number] = (self._received * self._loss * sent * turn).astype(np.complex64)
        return self._nodes[number]

    def _middle(self, factor: Real) -> Real:
        """Turn of the pulse's middle [cycles]."""
        return 0.5 * self.pulse.frequency * self.pulse.duration * (factor - 1)
