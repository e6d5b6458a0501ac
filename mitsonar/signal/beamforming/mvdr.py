"""Minimum variance distortionless response: weights of gain 1 in the look direction and least power elsewhere.

The element signals are brought into line for the look direction and every range (near field, wide band), so that the
steering vector is 1 in every component; then, per sample,

    w = R⁻¹ 1 / (1ᵀ R⁻¹ 1),   y = mean over the subarrays of  wᴴ x                       (Capon 1969)

Echoes of one ping are coherent, and a plain covariance would cancel them: R is the mean over all L-element subarrays of
the line (spatial smoothing: Evans, Johnson & Sun 1982; in pulse-echo imaging Synnevåg, Austeng & Holm 2007), forwards
and backwards (J R* J; Pillai & Kwon 1989), and over 2 K + 1 samples, and carries a diagonal load δ tr(R) / L.

For L of E elements there are 2 (E - L + 1) (2 K + 1) snapshots, of which those of neighbouring subarrays share
elements. L <= E / 2 resolves up to E / 2 coherent echoes; smaller L and larger δ lean towards delay-and-sum.
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.ndimage import uniform_filter1d

from mitsonar.device.types import DrJitArray

from .alignment import ElementSignals, device_arrays
from .delay_and_sum import aligned
from .recording import beam_signals, look_directions, read_recording, uniform_line

COVARIANCE_BYTES = 1 << 26         # of the samples worked on at once


def mvdr(signals: xr.DataArray, directions: ArrayLike, *, subarray: int | None = None, half_width: int = 2,
         loading: float = 0.01, interpolation: str = "band_limited",
         like: DrJitArray | type | None = None) -> xr.DataArray:
    """Form adaptive beams along directions, focused at every range."""
    # directions (B, 3)
    recording, vectors = read_recording(signals), look_directions(directions)
    pings, transmitters, elements, samples = recording.values.shape
    if transmitters != 1:
        raise ValueError(f"the signals have {transmitters} transmitters; mvdr takes one: select it with "
                         "signals.isel(tx=[0]), or use delay_and_sum, which focuses them all")
    for ping in range(pings):
        uniform_line(recording.receivers[ping], recording.wavelength)
    length = max(1, elements // 2) if subarray is None else subarray
    if not 1 <= length <= elements:
        raise ValueError(f"a subarray of {length} elements does not fit; the line has {elements}, give 1 to {elements}")
    if not half_width >= 0:
        raise ValueError(f"half_width is {half_width} samples; give 0 or more")
    if not (np.isfinite(loading) and loading > 0):
        raise ValueError(f"loading is {loading}; give a number > 0, 0.01 of the diagonal is usual")
    beams = np.empty((pings, len(vectors), samples), np.complex64)
    array = ElementSignals(device_arrays(like), recording, interpolation, np.ones(elements))
    for ping in range(pings):
        array.load(ping, np.zeros(3))
        for beam, vector in enumerate(vectors):
            lined = aligned(array, vector, recording.transmitters[ping, 0])
            beams[ping, beam] = _adapted(lined.T, length, half_width, loading)
    return beam_signals(recording, beams, vectors, "mvdr")


def _adapted(lined: np.ndarray, length: int, half_width: int, loading: float) -> np.ndarray:
    """Return the adaptive sum, complex (S,), of aligned signals (S, E)."""
    samples, elements = lined.shape
    at_once = max(1, COVARIANCE_BYTES // (16 * length * (length + elements)))
    out = np.empty(samples, np.complex64)
    for begin in range(0, samples, at_once):
        end = min(begin + at_once, samples)
        low, high = max(begin - half_width, 0), min(end + half_width, samples)
        out[begin:end] = _capon(lined[low:high].astype(complex), length, half_width, loading)[begin - low:end - low]
    return out


def _capon(lined: np.ndarray, length: int, half_width: int, loading: float) -> np.ndarray:
    parts = sliding_window_view(lined, length, axis=1)       # (sample, subarray, element)
    covariance = np.swapaxes(parts, 1, 2) @ parts.conj()
    covariance += covariance[:, ::-1, ::-1].conj()           # forwards and backwards
    covariance = uniform_filter1d(covariance, 2 * half_width + 1, axis=0, mode="constant")
    diagonal = np.arange(length)
    mean = covariance[:, diagonal, diagonal].real.mean(axis=1)
    # silence has no covariance: any load then gives the plain mean
    covariance[:, diagonal, diagonal] += np.where(mean > 0, loading * mean, 1)[:, None]
    solved = np.linalg.solve(covariance, np.ones((len(lined), length, 1)))[..., 0]
    weights = solved / solved.sum(axis=1, keepdims=True)
    return (weights.conj() * parts.mean(axis=1)).sum(axis=1)
