"""Gates of a picture: the cells of a pulse in a time bin, steps between them, and the highest power about a bin."""
from collections.abc import Callable

import numpy as np

SAMPLES_OF_A_BIN = 4               # at least, among which a peak detector finds the highest


def pulse_shares(bin_length: float, pulse_length: float) -> np.ndarray:
    """Return the overlap of a pulse, centred on a bin, with that bin or with the half bins that it covers."""
    ratio = pulse_length / bin_length
    if ratio <= 1:
        return np.array([ratio])
    reach = int(np.ceil(ratio))
    start = np.arange(-reach, reach)
    return np.clip(np.minimum(start + 1, ratio) - np.maximum(start, -ratio), 0, 1)


def pulse_cells(bin_length: float, pulse_length: float) -> int:
    """Return the number of pulse lengths in a bin: the cells whose intensities are averaged."""
    return max(1, round(bin_length / pulse_length))


def speckle_gates(bin_length: float, pulse_length: float) -> int:
    """Return the number of gates with independent speckle in a bin: its cells, or 2 for a longer pulse."""
    return pulse_cells(bin_length, pulse_length) if pulse_length <= bin_length else 2


def envelope_steps(bin_length: float, pulse_length: float) -> int:
    """Return the steps from gate to gate in which a peak detector looks for the highest intensity."""
    return max(1, SAMPLES_OF_A_BIN // pulse_cells(bin_length, pulse_length)) if pulse_length <= bin_length else 1


def between(values: np.ndarray, steps: int, share: Callable[[np.ndarray], np.ndarray] = np.asarray) -> np.ndarray:
    """Return values (..., gates) at steps from each gate to the next, (..., gates, steps).

    Those of a gate and of the next have the shares f(1 - s) and f(s) in the step s, f -> `share`: with the root, what
    is independent from gate to gate keeps its variance.
    """
    following = np.concatenate([values[..., 1:], values[..., -1:]], -1)
    s = (np.arange(steps) / steps).astype(np.finfo(values.dtype).dtype)
    return values[..., None] * share(1 - s) + following[..., None] * share(s)


def highest(power: np.ndarray, window: float, samples: int = 1) -> np.ndarray:
    """Return the highest powers (..., bins) in windows of so many bins, of powers (..., bins x samples)."""
    wide = max(1, round(window * samples))
    before = max(0, wide - samples) // 2
    padded = np.pad(power, [(0, 0)] * (power.ndim - 1) + [(before, max(0, wide - samples - before))])
    return np.lib.stride_tricks.sliding_window_view(padded, wide, -1)[..., ::samples, :].max(-1)
