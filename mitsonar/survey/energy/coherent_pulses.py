"""Pulses of coherent echoes, summed before they are squared.

    z(t) = Σ_i a_i Π((t - τ_i) / T)

a_i is the pressure of an echo and τ_i its delay (`coherent_sides`), Π the rectangular pulse of length T, centred on
its echo as in `imaging.sidescan`. z is sampled several times a pulse. A bin keeps the mean of |z|², and the mean of z
over every stretch of the bin in which the bed's echo is one number (a pulse, or the bin where that is shorter): with
these means, the bed's random echo adds to z as a pressure.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.imaging.energy_record import CoherentRecord, CoherentSums, joined, powers
from mitsonar.signal.gates import pulse_cells

from .sidescan_survey import SidescanSurvey

PER_PULSE, PER_BIN = 4, 4          # least samples of z
CYCLES = 2.5                       # least cycles of the carrier in a sample, except for the shortest pulses
WORK = 1 << 21                     # samples of z at a time


@dataclass(frozen=True, kw_only=True)
class PulseArrivals:
    """Echoes as the faces receive them, one an entry, on the host."""

    row: np.ndarray  # (R,): row of the group
    label: np.ndarray  # (R,): number of the shape
    path: np.ndarray  # (R,): index of the path
    delay: np.ndarray  # (R,) [s]: of the middle of the pulse
    real: np.ndarray  # (R,) [µPa]: of a_i
    imaginary: np.ndarray  # (R,) [µPa]: of a_i
    depth: np.ndarray  # (R,) [m]
    in_beam: np.ndarray  # (R,): True if the echo comes through the main lobe

    @property
    def pressure(self) -> np.ndarray:
        """Return a_i, (R,) complex [µPa]."""
        return self.real + 1j * self.imaginary.astype(float)


class CoherentPulses:
    """Sums of pulses on the host."""

    def __init__(self, survey: SidescanSurvey):
        sonar, window = survey.sonar, survey.window
        self._survey = survey
        self._cells = pulse_cells(survey.bin_length, sonar.pulse_length)
        # the k of Kirchhoff's integral is that of the carrier, so each sharp edge of a pulse would have a zone of its
        # own on a bent surface. Samples of several cycles round the edges off.
        per_pulse = min(PER_BIN * sonar.pulse_length / survey.bin_length, sonar.pulse_length * sonar.frequency / CYCLES)
        self._per_pulse = max(PER_PULSE, int(per_pulse))
        self._step = sonar.pulse_length / self._per_pulse
        self._start = window[0] - sonar.pulse_length
        self._samples = int(np.ceil((window[1] + sonar.pulse_length - self._start) / self._step)) + 2
        self.pings_at_once = max(1, WORK // (2 * self._samples))

    def sum(self, blocks: Sequence[PulseArrivals], rows: int) -> CoherentSums:
        """Return the sums of blocks of arrivals in a number of rows; arrays (rows, ..., bins)."""
        arrivals, survey = joined(blocks), self._survey
        slot, pressure, path_intensity = self._pulses(arrivals, rows)
        bin, in_beam = self._bin(arrivals), np.zeros((rows, survey.bins), np.uint32)
        in_beam[arrivals.row[arrivals.in_beam], bin[arrivals.in_beam]] = 1
        label_power, depth = self._by_instance(arrivals, bin, slot, rows)
        record = CoherentRecord(
            pressure=self._means(pressure, self._cells).astype(np.complex64),
            intensity=self._means(np.abs(pressure) ** 2, 1)[..., 0], depth=depth, in_beam=in_beam,
            path_intensity=path_intensity)
        return CoherentSums(record=record, label_power=label_power)

    def silence(self, rows: int) -> CoherentSums:
        """Return the sums of no arrivals in a number of rows."""
        survey, paths = self._survey, len(self._survey.paths)
        record = CoherentRecord(
            pressure=np.zeros((rows, survey.bins, self._cells), np.complex64), intensity=np.zeros((rows, survey.bins)),
            depth=np.zeros((rows, survey.bins), np.float32), in_beam=np.zeros((rows, survey.bins), np.uint32),
            path_intensity=np.zeros((rows, paths, survey.bins)) if paths > 1 else None)
        return CoherentSums(record=record, label_power=np.zeros((rows, len(survey.labels), survey.bins), np.float32))

    def _pulses(self, arrivals: PulseArrivals, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
        """Return the first sample of each pulse (R,), the sums [µPa], and the intensities of paths [µPa²]."""
        survey, samples, paths = self._survey, self._samples, len(self._survey.paths)
        size = rows * samples
        begin = (arrivals.delay - 0.5 * survey.sonar.pulse_length - self._start) / self._step
        slot = np.floor(begin).astype(np.int64)
        place = arrivals.row.astype(np.int64) * samples + slot
        # the samples at both ends are filled in part, so that successive echoes add without steps; each keeps the
        # energy of its pulse
        late = begin - slot
        scale = 1 / np.sqrt(1 - 2 * late * (1 - late) / self._per_pulse)
        shares = scale * (1 - late), scale * late
        by_path = np.zeros((rows, paths, survey.bins)) if paths > 1 else None
        total = np.zeros((rows, samples), complex)
        for path in np.unique(arrivals.path):
            on_path = arrivals.path == path
            real, imaginary = np.zeros(size), np.zeros(size)
            for step, share in enumerate(shares):
                weights = arrivals.pressure[on_path] * share[on_path]
                real += np.bincount(place[on_path] + step, weights.real, size)
                imaginary += np.bincount(place[on_path] + step, weights.imag, size)
            z = np.cumsum((real + 1j * imaginary).reshape(rows, samples), axis=1)
            z[:, self._per_pulse:] -= z[:, :-self._per_pulse].copy()
            if by_path is not None:
                by_path[:, path] = self._means(np.abs(z) ** 2, 1)[..., 0]
            total += z
        return slot, total, by_path

    def _means(self, samples: np.ndarray, parts: int) -> np.ndarray:
        """Return means of samples (rows, samples) over `parts` parts of every bin, (rows, bins, parts)."""
        survey = self._survey
        edge = survey.window[0] + survey.bin_length / parts * np.arange(survey.bins * parts + 1)
        edge = (edge - self._start) / self._step
        whole = np.floor(edge).astype(np.int64)
        share = (edge - whole) * samples[:, whole]
        sums = np.add.reduceat(samples, whole, axis=1)[:, :-1]
        # where two edges fall into one sample, reduceat returns that sample
        sums[:, np.diff(whole) == 0] = 0
        sums += np.diff(share, axis=1)
        return (sums * (parts * self._step / survey.bin_length)).reshape(len(samples), survey.bins, parts)

    def _bin(self, arrivals: PulseArrivals) -> np.ndarray:
        """Return the bins of the middles of pulses; those just outside the record count in its first or last bin."""
        survey = self._survey
        bin = np.floor((arrivals.delay - survey.window[0]) / survey.bin_length).astype(np.int64)
        return np.clip(bin, 0, survey.bins - 1)

    def _by_instance(self, arrivals: PulseArrivals, bin: np.ndarray, slot: np.ndarray,
                     rows: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the power of each instance [µPa²] and the depth of the strongest [m], by bin of the pulses' middles.
        """
        bins, labels = self._survey.bins, len(self._survey.labels)
        label_power = np.zeros((rows, labels, bins), np.float32)
        strongest_depth = np.zeros((rows, bins), np.float32)
        number = (arrivals.row.astype(np.int64) * bins + bin) * (labels + 1) + arrivals.label
        # echoes of an instance that begin in the same sample add as pressures, other echoes as powers
        of_sample, power = powers(number * self._samples + slot, arrivals.real, arrivals.imaginary)
        key, which = np.unique(of_sample // self._samples, return_inverse=True)
        power = np.bincount(which, power)
        energy = arrivals.real.astype(float) ** 2 + arrivals.imaginary.astype(float) ** 2
        which = np.searchsorted(key, number)
        depth = np.bincount(which, energy * arrivals.depth) / np.bincount(which, energy)
        place, of = np.divmod(key, labels + 1)
        label_power[place // bins, of - 1, place % bins] = power
        order = np.lexsort((power, place))
        best = order[np.flatnonzero(np.diff(place[order], append=-1))]
        strongest_depth[np.divmod(place[best], bins)] = depth[best]
        return label_power, strongest_depth
