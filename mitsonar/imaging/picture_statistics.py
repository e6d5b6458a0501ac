"""Statistics of sidescan amplitudes, for both real and rendered records.

    x = A / <A> - 1                          <A> the slow trend, a Gaussian mean of 12 pings by 12 samples
    CV = std(A') / mean(A')                  A' = A over its fitted plane in windows of 16 x 16; Rayleigh: 0.523
    c(k) = <x_n x_(n+k)> / <x²>              along pings and along range, of amplitudes and of intensities, as the
                                             median of windows of 32 x 32, so single objects do not count
    S(f) = <|FFT(w x)|² / (<x²> Σ w²)>       runs of 64 samples under a Hann window; white: 1 at all f

A -> ``amplitude``. The gain of a real recorder is unknown. All statistics are ratios of neighbours in range, or of
pings at one range, which a gain over range does not change; only `dynamic_range_db` includes the gain. Windows lie on
open bed: `CLEAR` m beyond the first return, and within 3 dB of the bed's median at their range.

The first return is the first rise of 8 dB between the means of 16 samples before and after. Shadows are patches of
bed whose 5 x 5 means are at least 8 dB below the bed's median at their range; their depth excludes the edges.
"""
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

__all__ = ["PictureStatistics", "first_return", "measure", "open_bed"]

WINDOW, SQUARE, LONG = 16, 32, 64  # samples
WIDE = 128                         # samples, of windows that include the texture of the bed
TREND = 12.0                       # samples, standard deviation
CLEAR = 2.0                        # [m]
BLIND = 1.0                        # [m] blinded by the transmission
RISE_DB, STEP = 8.0, 16            # [dB] of the first return; [samples]
OPEN_DB = 3.0                      # [dB] from the bed's median at that range
DARK_DB, SMALLEST = 8.0, 60        # [dB] below the bed; [samples]: limits of shadows
LAGS = 5
QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)


@dataclass(frozen=True, kw_only=True)
class PictureStatistics:
    """Statistics of one side of a sidescan."""

    windows: int  # number of windows of 16 x 16 samples on open bed
    variation: float  # median coefficient of variation of amplitudes
    quantiles: np.ndarray  # (5,): 1, 10, 50, 90, 99 % of amplitudes over the local mean
    ping_correlation: np.ndarray  # (5,): of amplitudes at lags 1 to 5
    range_correlation: np.ndarray  # (5,)
    ping_intensity_correlation: np.ndarray  # (5,): of intensities at lags 1 to 5
    range_intensity_correlation: np.ndarray  # (5,)
    # correlation of amplitudes at lag 1 in windows of 128 x 128 less their mean, with the texture of the bed; or NaN
    ping_texture: float
    range_texture: float
    ping_spectrum: np.ndarray  # (5,): in octaves of 2-4, 4-8, 8-16, 16-32, 32-64 samples a wave; white: 1
    range_spectrum: np.ndarray  # (5,)
    shadows: int  # number of samples in shadows
    shadow_db: np.ndarray  # (3,) [dB]: quartiles of the depth of shadows below the bed, by intensity; or NaN
    rise: float  # [m]: of the first return's mean intensity from 10 to 90 % of its peak
    peak_db: float  # [dB]: first return relative to the bed 1 to 3 m beyond it
    water_db: float  # [dB]: mean intensity 0.5 to 2 m before the first return, relative to the same bed
    dynamic_range_db: float  # [dB]: 99.9 relative to 0.1 % quantile of amplitudes, with the recorder's gain
    values: int  # number of different amplitudes
    saturated: float  # share of samples with the highest amplitude


def measure(amplitude: np.ndarray, spacing: float, *, keep: np.ndarray | None = None) -> PictureStatistics:
    """Compute the statistics of one side of a sidescan.

    Parameters
    ----------
    amplitude : (ping, sample)
        Envelopes, not decibels, near range first.
    spacing : float [m]
        Spacing of samples in slant range.
    keep : (ping, sample) bool, optional
        Region to search for open bed; everything by default.

    Returns
    -------
    PictureStatistics

    Raises
    ------
    ValueError
        If there are fewer than 64 pings or samples, amplitudes are negative or not finite, or no bed is found.
    """
    amplitude = _checked(amplitude, spacing)
    first = first_return(amplitude, spacing)
    bed, level, middle = _bed(amplitude, first, spacing)
    open_ = _open(bed, level, middle, keep)
    weight = ndimage.gaussian_filter(open_.astype(float), TREND)
    around = ndimage.gaussian_filter(np.where(open_, amplitude, 0.0), TREND)
    ratio = np.where(open_, amplitude / (np.maximum(around, 1e-30) / np.maximum(weight, 1e-9)), np.nan)
    variations = [_variation(amplitude[part]) for part in _windows(open_, WINDOW)]
    squares = [ratio[part] for part in _windows(open_, SQUARE)]
    if not squares:
        raise ValueError("no window of 32 x 32 samples of open bed was found; give a record with more of an even bed.")
    wide = [amplitude[part] for part in _windows(bed if keep is None else bed & keep, WIDE)]
    dark = _shadows(bed, level, middle)
    low, high = np.quantile(amplitude, (0.001, 0.999))
    low = max(low, amplitude[amplitude > 0].min(initial=high))         # samples of 0 have no level
    return PictureStatistics(
        windows=len(variations), variation=float(np.median(variations)),
        quantiles=np.nanquantile(ratio, QUANTILES),
        ping_correlation=_correlation(squares, 0), range_correlation=_correlation(squares, 1),
        ping_intensity_correlation=_correlation([square ** 2 for square in squares], 0),
        range_intensity_correlation=_correlation([square ** 2 for square in squares], 1),
        ping_texture=float(_correlation(wide, 0)[0]), range_texture=float(_correlation(wide, 1)[0]),
        ping_spectrum=_spectrum(ratio, 0), range_spectrum=_spectrum(ratio, 1),
        shadows=dark.size, shadow_db=np.quantile(dark, (0.25, 0.5, 0.75)) if dark.size else np.full(3, np.nan),
        **_onset(amplitude, first, spacing),
        dynamic_range_db=float(20 * np.log10(max(high, 1e-30) / max(low, 1e-30))),
        values=int(np.unique(amplitude).size), saturated=float(np.mean(amplitude == amplitude.max())))


def first_return(amplitude: np.ndarray, spacing: float) -> np.ndarray:
    """Return the sample of the bed's first return of every ping (P,), int, smoothed over 15 pings."""
    power = ndimage.uniform_filter1d(np.asarray(amplitude, float) ** 2, 9, axis=0)
    level = np.log10(np.maximum(ndimage.uniform_filter1d(power, STEP, axis=1), 1e-300))
    rise = 10 * (np.roll(level, -STEP // 2, 1) - np.roll(level, STEP // 2, 1))
    blind = int(np.ceil(BLIND / spacing)) + STEP
    rise[:, :blind], rise[:, -STEP:] = 0, 0
    risen = rise > RISE_DB
    if np.mean(risen.any(1)) < 0.5:
        raise ValueError("no first return was found: fewer than half of the pings rise by 8 dB beyond the water; "
                         "give a record that begins at the sonar.")
    start = risen.argmax(1)
    ahead = start[:, None] + np.arange(2 * STEP)
    best = np.take_along_axis(rise, np.minimum(ahead, rise.shape[1] - 1), 1).argmax(1)
    place = np.where(risen.any(1), start + best, -1)
    known = np.flatnonzero(place >= 0)
    place = np.interp(np.arange(place.size), known, place[known])
    return np.rint(ndimage.median_filter(place, 15, mode="nearest")).astype(int)


def open_bed(amplitude: np.ndarray, spacing: float) -> np.ndarray:
    """Return a mask (ping, sample) of the bed without objects, shadows and strong patches."""
    amplitude = _checked(amplitude, spacing)
    return _open(*_bed(amplitude, first_return(amplitude, spacing), spacing), None)


def _checked(amplitude, spacing):
    amplitude = np.asarray(amplitude, float)
    if amplitude.ndim != 2 or min(amplitude.shape) < LONG or not 0 < spacing < np.inf:
        raise ValueError(f"amplitudes have the shape {amplitude.shape} and samples of {spacing:g} m; at least {LONG} "
                         f"pings by {LONG} samples are needed, and a spacing above 0.")
    if not np.all(amplitude >= 0) or not np.isfinite(amplitude).all():
        raise ValueError("amplitudes are negative or not finite; give envelopes, not decibels.")
    return amplitude


def _bed(amplitude, first, spacing):
    """Return a mask of the bed (P, N), levels of 5 x 5 samples (P, N) and their medians by range (N,) [dB]."""
    bed = np.arange(amplitude.shape[1]) >= first[:, None] + int(np.ceil(CLEAR / spacing))
    bed[:, bed.sum(0) < max(8, len(bed) // 20)] = False      # too few pings for a median
    if not bed.any():
        raise ValueError("no bed lies beyond the first return; give a record of a longer range.")
    level = 10 * np.log10(np.maximum(ndimage.uniform_filter(amplitude ** 2, 5), 1e-300))
    middle = np.full(amplitude.shape[1], np.median(level[bed]))
    known = bed.any(0)
    middle[known] = np.nanmedian(np.where(bed, level, np.nan)[:, known], 0)
    return bed, level, middle


def _open(bed, level, middle, keep):
    """Return a mask (P, N) of bed whose mean level over 16 x 16 samples is usual for its range."""
    deviation = ndimage.uniform_filter(level, WINDOW) - ndimage.median_filter(middle, 31)
    # altitude and sediments shift all levels slowly: subtract the median of each ping
    known, shift = bed.any(1), np.zeros((len(bed), 1))
    shift[known, 0] = np.nanmedian(np.where(bed, deviation, np.nan)[known], 1)
    usual = bed & (np.abs(deviation - shift) < OPEN_DB)
    return usual if keep is None else usual & keep


def _windows(open_, size):
    """Yield the slices of squares that lie wholly on open bed."""
    for ping in range(0, open_.shape[0] - size + 1, size):
        for start in range(0, open_.shape[1] - size + 1, size):
            part = np.s_[ping:ping + size, start:start + size]
            if open_[part].all():
                yield part


def _variation(window):
    y, x = np.meshgrid(*(np.arange(size) - (size - 1) / 2 for size in window.shape), indexing="ij")
    plane = np.stack((np.ones(window.size), y.ravel(), x.ravel()), 1)
    fitted = plane @ np.linalg.lstsq(plane, window.ravel(), rcond=None)[0]
    ratio = window.ravel() / np.maximum(fitted, 0.05 * window.mean() + 1e-12)
    return ratio.std(ddof=3) / ratio.mean()


def _correlation(windows, axis):
    """Return the correlation at lags 1 to 5, as the median over windows."""
    if not windows:
        return np.full(LAGS, np.nan)
    correlations = []
    for window in windows:
        values = np.moveaxis(window - window.mean(), axis, 0)
        power = max(np.mean(values ** 2), 1e-300)
        correlations.append([np.mean(values[:-lag] * values[lag:]) / power for lag in range(1, LAGS + 1)])
    return np.median(correlations, 0)


def _spectrum(ratio, axis):
    """Return mean periodograms of runs of 64 samples without gaps, in octaves of the wavelength."""
    lines = np.moveaxis(ratio, axis, -1)
    lines = lines[:, :lines.shape[1] // LONG * LONG].reshape(-1, LONG)
    lines = lines[np.isfinite(lines).all(1)]
    if not len(lines):
        return np.full(LAGS, np.nan)
    lines = lines - lines.mean(1, keepdims=True)
    window = np.hanning(LONG)
    scale = np.maximum(lines.var(1, keepdims=True), 1e-300) * np.sum(window ** 2)
    power = (np.abs(np.fft.rfft(lines * window)) ** 2 / scale).mean(0)
    octaves = [LONG // 2 ** octave for octave in range(1, LAGS + 2)]          # 32, 16, ... cycles per run
    return np.array([power[low:high].mean() for high, low in zip(octaves, octaves[1:])])


def _shadows(bed, level, middle):
    """Return the depths [dB] of shadows below the bed, without their edges."""
    number, count = ndimage.label(bed & (level < middle - DARK_DB))
    if not count:
        return np.empty(0)
    large = np.flatnonzero(np.bincount(number.ravel())[1:] >= SMALLEST) + 1
    inside = ndimage.binary_erosion(np.isin(number, large), iterations=2)
    return (middle - level)[inside]


def _onset(amplitude, first, spacing):
    """Return rise, peak and water level from means over pings aligned by their first returns."""
    before, after = int(np.ceil(2.2 / spacing)), int(np.ceil(3.2 / spacing))
    offsets = np.arange(-before, after)
    usable = np.flatnonzero((first - before >= int(BLIND / spacing)) & (first + after < amplitude.shape[1]))
    if usable.size < 8:
        return {"rise": np.nan, "peak_db": np.nan, "water_db": np.nan}
    power = amplitude[usable[:, None], first[usable, None] + offsets] ** 2
    smooth = ndimage.uniform_filter1d(power, 3, axis=1)
    span = np.abs(offsets * spacing) < 0.6
    bed = _mean(power, (offsets * spacing > 1) & (offsets * spacing < 3))
    water = _mean(power, (offsets * spacing > -2) & (offsets * spacing < -0.5))
    rises, peaks = [], []
    for start in range(0, len(usable), 8):                         # averages speckle at nearly constant altitude
        rows = smooth[start:start + 8].mean(0)
        peak = rows[span].max()
        top = np.flatnonzero(span)[rows[span].argmax()]
        floor = rows[:before // 2].mean()
        rising = (rows[:top + 1] - floor) / max(peak - floor, 1e-300)
        low = top - np.argmax(rising[::-1] < 0.1)
        rises.append((np.flatnonzero(rising[low:] > 0.9)[0]) * spacing)
        peaks.append(10 * np.log10(peak / power[start:start + 8][:, offsets * spacing > 1].mean()))
    return {"rise": float(np.median(rises)), "peak_db": float(np.median(peaks)),
            "water_db": float(10 * np.log10(max(water, 1e-30) / max(bed, 1e-30)))}


def _mean(power, columns):
    """Return the median over pings of the mean over columns, robust to pings that meet a wreck first."""
    return float(np.median(power[:, columns].mean(1)))
