"""Range from which the display gain (`mitsonar.imaging.gain`) is constant, and the levels of black and white."""
import numpy as np
from scipy import ndimage

STRETCH = 0.05           # share of a record over which levels are smoothed to find the noise
NEAR_NOISE_DB = 3.0


def heard_to(
        level: np.ndarray,     # (B, N) [dB]
        gain: np.ndarray,      # (N,) of an even bed [dB]
) -> int:
    """Return the first bin at which noise hides the bed: levels no longer fall although the gain still rises.

    Instruments, too, keep the gain of a fan constant from there on.
    """
    bins = level.shape[-1]
    stretch = max(round(STRETCH * bins), 1)
    middle = ndimage.uniform_filter1d(np.median(level, axis=0), stretch, mode="nearest")
    above = np.flatnonzero(middle > np.median(middle[-stretch:]) + NEAR_NOISE_DB)
    first = int(above[-1]) + 1 if above.size else bins
    return first if first < bins and gain[-1] - gain[first] > 2 * NEAR_NOISE_DB else bins


def display_window(values: np.ndarray) -> tuple[float, float]:
    """Return the levels of black and white of a picture [dB]."""
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    # Speckle spreads an even bed over some 25 dB. Steep beams, shadows and targets must not widen this range much, or
    # the bed loses its contrast; in a smooth record the range may shrink.
    low, middle, high = np.percentile(values, [2, 50, 99.8])
    low = np.clip(low, middle - 16, middle - 6)
    return float(low), float(np.clip(high, middle + 0.75 * (middle - low), middle + 16))
