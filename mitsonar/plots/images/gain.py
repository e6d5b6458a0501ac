"""Display gain of pictures, see `mitsonar.imaging.gain`: where it ends, and which levels are black and white.

Of a fan the gain is held from where noise hides the bed, as instruments hold it (`heard_to`).
"""
import numpy as np
from scipy import ndimage

STRETCH = 0.05  # of a record: over which levels are smoothed where noise is looked for
NEAR_NOISE_DB = 3.0


def heard_to(level: np.ndarray, gain: np.ndarray) -> int:
    """Find where noise hides the bed: where levels no longer fall although the gain of an even bed goes on rising."""
    # level (B, N) [dB]; gain (N,) [dB]
    bins = level.shape[-1]
    stretch = max(round(STRETCH * bins), 1)
    middle = ndimage.uniform_filter1d(np.median(level, axis=0), stretch, mode="nearest")
    above = np.flatnonzero(middle > np.median(middle[-stretch:]) + NEAR_NOISE_DB)
    first = int(above[-1]) + 1 if above.size else bins
    return first if first < bins and gain[-1] - gain[first] > 2 * NEAR_NOISE_DB else bins


def display_window(values: np.ndarray) -> tuple[float, float]:
    """Return the levels of black and white of a picture."""
    # values [dB] -> [dB]
    values = values[np.isfinite(values)]
    if not values.size:
        return 0.0, 1.0
    # Speckle spreads an even bed over some 25 dB. Steep beams, shadows and targets must not widen that much, else the
    # bed loses its contrast; in a smooth record it may shrink.
    low, middle, high = np.percentile(values, [2, 50, 99.8])
    low = np.clip(low, middle - 16, middle - 6)
    return float(low), float(np.clip(high, middle + 0.75 * (middle - low), middle + 16))
