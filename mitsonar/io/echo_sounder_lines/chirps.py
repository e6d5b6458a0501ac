"""Compression of chirps (FM) by the signal that was sent, as it leaves the receiver's filters.

    s(t) = cos(2π f_1 t + π (f_2 - f_1) t² / T) · ramps           at the converter's rate; Hann ramps of slope · T
    r = decimated(decimated(s * h_1) * h_2)                       h: coefficients of the filters (FIL1)
    y_c = y * conj(r(-t)) / Σ |r|²

(Andersen et al. 2024, Quantitative processing of broadband data as implemented in a scientific split-beam echosounder,
eqs. 1 to 4). The converter's rate is that of the samples times the filters' decimations.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

FILTER = np.dtype([("stage", "<i2"), ("spare", "S2"), ("channel", "S128"), ("count", "<i2"), ("decimation", "<i2")])
LONGEST = 10_000_000               # samples of a pulse at the converter's rate


@dataclass(frozen=True, kw_only=True, eq=False)
class Filter:
    """Coefficients (M,) of a stage of the receiver's filters, and the decimation after it."""

    stage: int
    coefficients: np.ndarray
    decimation: int

    @classmethod
    def of(cls, raw: bytes, at: int) -> Filter:
        """Return the filter of a datagram's content; raise `ValueError` if it is damaged."""
        header = np.frombuffer(raw.ljust(FILTER.itemsize, b"\0"), FILTER, 1)[0]
        count, decimation = int(header["count"]), int(header["decimation"])
        if count < 0 or FILTER.itemsize + 8 * count > len(raw) or decimation < 1:
            raise ValueError(f"the filter at byte {at} has {count} coefficients and a decimation of {decimation}; the "
                             "file is damaged there.")
        return cls(stage=int(header["stage"]), decimation=decimation,
                   coefficients=np.frombuffer(raw, "<c8", count, FILTER.itemsize).astype(complex))


def replica(filters: Sequence[Filter], *, first: float, last: float, length: float, slope: float, interval: float
            ) -> np.ndarray | None:
    """Return the pulse (M,) that samples are compressed with; None if the file does not describe it.

    Parameters
    ----------
    filters : sequence of Filter
    first, last : float [Hz]
        Frequencies at the beginning and the end.
    length, interval : float [s]
        Duration of the pulse, and time from sample to sample of the record.
    slope : float [-]
        Share of the pulse in which it rises, and in which it falls.
    """
    rate = np.prod([float(stage.decimation) for stage in filters]) / interval
    if not filters or not all(np.isfinite([first, last, length, slope])) or not 2 <= length * rate <= LONGEST:
        return None
    time = np.arange(int(np.float32(length * rate))) / rate
    sent = np.cos(2 * np.pi * first * time + np.pi * (last - first) / length * time ** 2)
    ramps = np.hanning(min(round(2 * length * rate * slope), sent.size))
    half = ramps.size // 2
    sent[:half] *= ramps[:half]
    sent[sent.size - (ramps.size - half):] *= ramps[half:]
    sent = sent / max(sent.max(), 1e-12)
    for stage in sorted(filters, key=lambda stage: stage.stage):
        sent = signal.convolve(sent, stage.coefficients)[::stage.decimation]
    return sent if np.isfinite(sent).all() and np.any(sent) else None


def compressed(samples: np.ndarray, pulse: np.ndarray) -> np.ndarray:
    """Return samples (..., N) compressed with a pulse (M,), a sample's place being that of an echo's beginning."""
    matched = pulse[::-1].conj() / np.sum(np.abs(pulse) ** 2)
    rows = [signal.convolve(row, matched)[pulse.size - 1:] for row in samples.reshape(-1, samples.shape[-1])]
    return np.reshape(rows, samples.shape)
