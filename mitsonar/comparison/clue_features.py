"""Clues by which a classifier tells pictures apart: numbers of patches of bed, and of runs of pings.

    x = A / <A>,   CV = std(x) / mean(x),   r_k = <y_n y_(n+k)> / <y²>,   y = x - mean(x)

A -> ``patches``, amplitudes (n, row, range) over the median of their range; rows are pings, or beams of a frame.
<A>, the local mean, is a Gaussian one of `TREND` samples both ways. All these are ratios of neighbours, which no gain
over range changes.

A detector's low pass of three taps (k, 1 - 2k, k) along range, over independent Rayleigh amplitudes, gives

    CV² = CV0² (q - d),   r_1 = (2k (1 - 2k) - d) / (q - d),   r_2 = (k² - d) / (q - d),   q = (1 - 2k)² + 2k²

with CV0² = 4/π - 1. The taps' sum is 1, so that the slow part of the amplitudes is as before the filter, and the
local mean takes the same share d from each covariance: d = 2 g(0) - (g * g)(0) = 1.5 / (2π TREND²), g the Gaussian.
"""
from __future__ import annotations

import numpy as np
from scipy import ndimage, stats

TREND = 6.0                        # samples, standard deviation of the local mean
RUN = 64                           # pings a run, and samples along a side of a patch of a sidescan's bed
WATER, CLEAR = 1.0, 4.0            # [m]: blinded by the transmission; from the first return to even bed
DARK_DB, BRIGHT_DB = -11.0, 10.0   # [dB] about the bed's median at that range


def three_taps(k: float) -> tuple[float, float]:
    """Return r_1 and CV of independent Rayleigh amplitudes behind the taps (k, 1 - 2k, k)."""
    taken = 1.5 / (2 * np.pi * TREND ** 2)
    power = (1 - 2 * k) ** 2 + 2 * k ** 2 - taken
    return (2 * k * (1 - 2 * k) - taken) / power, np.sqrt((4 / np.pi - 1) * power)


def over_local_mean(patches: np.ndarray) -> np.ndarray:
    """Return patches (n, row, range) over their local means."""
    return patches / np.maximum(ndimage.gaussian_filter(patches, (0, TREND, TREND), mode="nearest"), 1e-9)


def correlation(y: np.ndarray, rows: int, samples: int) -> np.ndarray:
    """Return the correlation (n,) of zero-mean patches (n, row, range) at a lag of rows >= 0 and of samples."""
    first = y[:, :y.shape[1] - rows, max(0, -samples):y.shape[2] - max(0, samples)]
    second = y[:, rows:, max(0, samples):y.shape[2] - max(0, -samples)]
    return (first * second).mean((1, 2)) / np.maximum((y * y).mean((1, 2)), 1e-12)


def r1_and_variation(patches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return r_1 (n,) along range and CV (n,) of patches (n, row, range)."""
    x = over_local_mean(patches)
    return correlation(_centred(x), 0, 1), x.std((1, 2)) / x.mean((1, 2))


def patch_clues(patches: np.ndarray, row: str = "ping") -> dict[str, np.ndarray]:
    """Return clues {name: (n,)} of patches (n, row, range); `row` is what a row is called."""
    x = over_local_mean(patches)
    y, log = _centred(x), np.log(np.maximum(patches, 1e-3))
    size = x.shape[1]
    clues = {"speckle: CV": x.std((1, 2)) / x.mean((1, 2)),
             "speckle: skewness": stats.skew(x, (1, 2)), "speckle: kurtosis": stats.kurtosis(x, (1, 2))}
    clues |= {f"speckle: {share:.0%} quantile": value
              for share, value in zip((.01, .1, .5, .9, .99), np.quantile(x, (.01, .1, .5, .9, .99), (1, 2)))}
    for lag in (1, 2, 3, 5):
        clues[f"correlation in range, lag {lag}"] = correlation(y, 0, lag)
        clues[f"correlation from {row} to {row}, lag {lag}"] = correlation(y, lag, 0)
    # a sonar that crabs moves the bed's speckle in range from ping to ping: that is no decorrelation
    clues[f"correlation from {row} to {row}, best shift"] = np.max([correlation(y, 1, k) for k in range(-3, 4)], 0)
    up, down = correlation(y, 1, 1), correlation(y, 1, -1)
    clues |= {"correlation on the diagonals": (up + down) / 2,
              "correlation: difference of the diagonals": np.abs(up - down)}        # the other way round on port
    for axis, name in ((1, row + "s"), (2, "range")):
        window = np.hanning(size)[:, None] if axis == 1 else np.hanning(size)
        power = (np.abs(np.fft.rfft(y * window, axis=axis)) ** 2).mean(3 - axis)
        power /= np.maximum(power[:, 1:].mean(1, keepdims=True), 1e-12)
        for shortest in (2, 4, 8, 16):
            band = power[:, size // (2 * shortest):size // shortest + (shortest == 2)]
            clues[f"spectrum over {name}, {shortest}-{2 * shortest} samples a wave"] = np.log(band.mean(1) + 1e-12)
    chance = np.maximum(log.std((1, 2)), 1e-9) * np.sqrt(2 / size)               # of means that are independent
    clues |= {f"stripes: {row}s of another gain": np.diff(log.mean(2), axis=1).std(1) / chance,
              "stripes at fixed ranges": np.diff(log.mean(1), axis=1).std(1) / chance}
    for block in (4, 8, 16):
        means = _blocks(patches, block)
        clues[f"texture: CV of blocks of {block}"] = means.std((1, 2)) / means.mean((1, 2))
    means = _centred(_blocks(patches, 4))
    clues |= {f"texture: correlation from {row} to {row}": correlation(means, 1, 0),
              "texture: correlation in range": correlation(means, 0, 1), "texture: skewness": stats.skew(means, (1, 2))}
    clues |= {"single hits": (x - ndimage.median_filter(x, (1, 3, 3)) > 2.5).mean((1, 2)),
              "dropped samples": (x < .05).mean((1, 2))}
    step = np.log(np.maximum(x, .02))
    for axis, name in ((1, f"{row} to {row}"), (2, "sample to sample")):
        clues[f"heavy tails of steps from {name}"] = stats.kurtosis(np.diff(step, axis=axis), (1, 2))
    return clues


def run_clues(side: np.ndarray, other: np.ndarray, first: np.ndarray, spacing: float) -> dict[str, float]:
    """Return clues {name: value} of one run of pings of a side.

    Arguments are amplitudes of both sides (ping, sample), samples of the first return (ping,) and spacing [m].
    """
    power, count = side ** 2, side.shape[1]
    place = (np.arange(count) - first[:, None]) * spacing                        # [m] beyond the first return
    even = max(power[(place > 1) & (place < CLEAR)].mean(), 1e-12)

    def level(low: float, high: float) -> float:
        chosen = power[(place >= low) & (place < high) & (np.arange(count) * spacing > .4)]
        return 10 * np.log10(max(chosen.mean(), 1e-12) / even) if chosen.size else np.nan

    line = power[:, 1:max(3, int(.4 / spacing))].max(1).mean()
    clues = {"water column: level [dB]": level(-2, -.6), "before the first return: level [dB]": level(-.5, -.15),
             "transmission: level [dB]": 10 * np.log10(max(line, 1e-12) / even),
             "first return: peak [dB]": level(0, .4), **_onset(power, first, spacing),
             **_water(side, other, first, spacing), **_bed(side, first, spacing)}
    values = np.unique(side)
    return clues | {"recorder: different values, log10": np.log10(values.size),
                    "recorder: share of the largest": np.mean(side == values[-1]),
                    "recorder: share of zeros": np.mean(side == 0)}


def _centred(x):
    return x - x.mean((1, 2), keepdims=True)


def _blocks(patches, block):
    """Return the means (n, row / block, range / block) of square blocks."""
    count, rows, samples = patches.shape
    return patches.reshape(count, rows // block, block, samples // block, block).mean((2, 4))


def _onset(power, first, spacing):
    """Return how the first return rises, and how much its place differs from ping to ping."""
    before, after = 8, max(16, int(3 / spacing))
    index = np.clip(first[:, None] + np.arange(-before, after), 0, power.shape[1] - 1)
    aligned = np.take_along_axis(power, index, 1)
    mean = ndimage.uniform_filter1d(aligned.mean(0), 3)
    rise = float((mean > .9 * mean.max()).argmax() - (mean > .1 * mean.max()).argmax()) * spacing
    edge = (aligned[:, :3 * before] > .25 * np.median(aligned[:, before:])).argmax(1)
    return {"first return: rise [m]": rise, "first return: jitter [samples]": np.diff(edge).std()}


def _water(side, other, first, spacing):
    """Return clues of the water column between the transmission and the first return."""
    names = ("CV", "stripes at fixed ranges", "stripes of pings", "specks", "port with starboard")
    end = int(np.median(first) - .8 / spacing)
    start = min(int(WATER / spacing), end // 2)
    if end - start < 8:
        return {f"water column: {name}": np.nan for name in names}
    water, beside = side[:, start:end], other[:, start:end]
    ratio = water / max(water.mean(), 1e-12)
    log = np.log(np.maximum(ratio, 1e-3)).mean(0)
    together = [_without_stripes(part).ravel() for part in (water, beside)]
    common = np.corrcoef(*together)[0, 1] if min(part.std() for part in together) > 0 else 0.0
    return {f"water column: {name}": value for name, value in zip(
        names, (ratio.std(), log.std(), ratio.mean(1).std(), np.mean(ratio > 5), common))}


def _without_stripes(part):
    return part - part.mean(0)


def _bed(side, first, spacing):
    """Return clues of the bed of a run as a whole: gains, dark and bright areas, edges."""
    bed = side[:, int(np.median(first) + CLEAR / spacing):int(.9 * side.shape[1])]
    if bed.shape[1] < 64:
        return {}
    middle = max(np.median(bed), 1e-12)
    by_range = np.log(np.maximum(np.median(bed, 0), 1e-3 * middle))
    trend = ndimage.gaussian_filter1d(by_range, 25, mode="nearest")
    by_ping = np.log(np.maximum(bed / middle, 1e-3)).mean(1)
    even = bed / np.exp(trend)
    local = 10 * np.log10(ndimage.uniform_filter(even ** 2, 7) + 1e-6)
    half = bed.shape[1] // 2
    near, far = (correlation(_centred(over_local_mean(part[None])), 1, 0)[0] for part in (bed[:, :half], bed[:, half:]))
    slow = ndimage.gaussian_filter(np.log(np.maximum(even, 1e-2)), 4)
    steep = ndimage.gaussian_gradient_magnitude(local, 1.5)
    return {"bed: stripes at fixed ranges": ndimage.gaussian_filter1d(by_range - trend, 1.5).std(),
            "bed: steps of gain from ping to ping": np.diff(by_ping).std(),
            "bed: slow gain over pings": ndimage.gaussian_filter1d(by_ping, 4).std(),
            "bed: dark share": np.mean(local < DARK_DB), "bed: bright share": np.mean(local > BRIGHT_DB),
            "bed: darkest 0.1 % [dB]": np.quantile(local, .001), "bed: brightest 0.1 % [dB]": np.quantile(local, .999),
            "bed: slow variation": slow.std(), "bed: sharpness of edges": np.quantile(steep, .99),
            "bed: correlation of pings, far less near": far - near}
