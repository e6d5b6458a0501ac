"""Constants of a recorder, found in the counts that it wrote; the chain is that of `mitsonar.imaging.recorder`.

    detector, w, k, τ the chain of the twin is run over Rayleigh speckle for every window w of a peak detector, every
                      low pass k, several pulses τ and glints, and the one whose CV, r1, dark quantiles and kurtosis
                      are nearest to those of open bed is taken
    bits              2^B - 1 is the least of its kind that holds the highest count, in steps of the counts
    noise             the median of the water column by range; its common part is √ρ, ρ the correlation of the sides
    line              the highest count of the first metre, while it is above half of it, and its fall afterwards

A detector is told by the skewness of its speckle: that of the root of a Rayleigh amplitude is about 0, of its logarithm
below -0.5, of its square 2, of the amplitude itself 0.63.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from mitsonar.imaging.picture_statistics import open_bed
from mitsonar.imaging.recorder import DECAY, MOST_BITS, Detector
from mitsonar.imaging.sidescan import mean_intensity, peaks, realisation
from mitsonar.signal.gates import envelope_steps, pulse_shares, speckle_gates
from mitsonar.units import db_from_power

from .sidescan_line import SidescanLine

WINDOW = 32                        # samples and pings of a patch of open bed
TREND = 6.0                        # samples: standard deviation of the local mean
PEAKS = (0.0, 0.25, 1.0, 1.5, 2.0)
TAPS = np.linspace(0, 0.3, 7)
PULSES = (1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 4.0)             # samples
PINGS, BINS = 200, 64              # of a trial
CLEARLY = 2.0                      # times nearer, from where a longer pulse than the assumed one is found
GLINTS = (0.0, 0.0), *((each, share) for each in (0.02, 0.05, 0.1, 0.2, 0.5) for share in (0.1, 0.2, 0.3, 0.4, 0.5))
OFF = np.array([0.03, 0.02, 0.05, 0.05, 0.2])              # of the features, by which one tells as much as another
CLEAR = 1.15                       # times the first return, from where there is bed
DARK = 0.05                        # of the median ping's mean: a lost ping
BRIGHT = 1.5                       # times the mean of its neighbours: a bright ping
SKEW = {"log": -0.5, "root": 0.25}                         # upper limits of the detectors' skewness
SQUARE = 0.75                      # CV above which a detector is a square one
WATER = 0.85                       # of the first return, up to which there is water
FEW, MANY = 16, 256                # samples of water at a range, and of all
LATE = 0.25                        # samples after the last loud one, when the transmission ends
LINE = 1.0                         # [m] in which the line of the transmission lies


@dataclass(frozen=True, kw_only=True, eq=False)
class FoundRecorder:
    """Constants of a recorder; levels are relative to full scale."""

    bits: int
    step: float  # counts of the file to a count of the recorder
    law: str
    peak: float
    low_pass: float
    decimation: int
    line_db: float
    line_length: float  # [s]
    ringing: float  # [s]
    line_ends: int  # sample where it has ended
    ping_gain_db: float
    lost: float
    repeated: float
    bright: float
    bright_db: float
    pulse_length: float  # [s]: of the speckle
    glints: tuple[float, float]  # number of a gate of its speckle, and their share of its strength
    amplitude: np.ndarray  # sorted amplitudes of its detector over speckle of mean power 1, behind the low pass
    usable: np.ndarray  # (P,): pings that are not lost
    words: tuple[str, ...]

    @property
    def highest(self) -> float:
        """Return the highest count of the file."""
        return self.step * (2 ** self.bits - 1)

    def output(self, counts: np.ndarray) -> np.ndarray:
        """Return amplitudes, 1 at full scale, of counts of any law."""
        return np.sqrt(Detector(law=self.law).power(counts / self.highest))

    def clipped(self, scale: np.ndarray) -> np.ndarray:
        """Return the mean output <min(1, s a)> of speckle with amplitudes s."""
        total = np.concatenate([[0.0], np.cumsum(self.amplitude)]) / self.amplitude.size
        below = np.searchsorted(self.amplitude, 1 / np.maximum(scale, 1e-12))
        return scale * total[below] + 1 - below / self.amplitude.size

    def scale(self, mean: np.ndarray, noise: np.ndarray | float = 0.0) -> np.ndarray:
        """Return the amplitudes s (root of mean power) that give mean outputs, less a power of noise, unsaturated."""
        trial = np.logspace(-5, 2, 701)
        scale = np.interp(mean, self.clipped(trial), trial)
        return np.sqrt(np.maximum(scale ** 2 - noise, 0.01 * scale ** 2))


@dataclass(frozen=True, kw_only=True)
class FoundNoise:
    """Powers of the noise of a side, 1 at full scale."""

    own: float = 0.0  # behind the gain
    common: float = 0.0  # behind the gain, alike in both sides
    before: float = 0.0  # before a gain of 1
    words: tuple[str, ...] = ()


def recorder_of(line: SidescanLine, pulse_length: float) -> FoundRecorder:
    """Return the constants of the recorder of a line, whose pulse [s] is assumed unless speckle has a longer one."""
    counts, words = line.counts, []
    step, bits = _bits(counts)
    highest = step * (2 ** bits - 1)
    lost, repeated, bright, bright_db = _faults(counts, line.first, line.spacing)
    usable = ~lost
    law = _law(line, usable, highest)
    output = np.sqrt(Detector(law=law).power(counts[usable] / highest))
    saturated = float(np.mean(counts[usable] >= highest))
    time = 2 * line.slant_range / line.sound_speed
    line_db, length, ringing, ends = _transmission(output, time, line.slant_range)
    peak, low_pass, pulse_length, glints, amplitude, text = _detector(line, usable, highest, law, pulse_length)
    words += [f"recorder: {bits} bits" + (f" in steps of {step:g}" if step != 1 else "")
              + f", {100 * saturated:.2g} % of samples at the highest count", text]
    words.append(f"line of the transmission: {line_db:.3g} dB re full scale for {1e3 * length:.2g} ms" if length
                 else "there is no line of the transmission")
    gain_db = _ping_gain_db(output, line.slant_range, line.first[usable], usable)
    words.append(f"pings: {int(lost.sum())} lost, {int(repeated.sum())} repeated, {int(bright.sum())} bright, gains of "
                 f"{gain_db:.2g} dB rms from ping to ping")
    return FoundRecorder(
        bits=bits, step=step, law=law, peak=peak, low_pass=low_pass, decimation=_decimation(counts[usable]),
        line_db=line_db, line_length=length, ringing=ringing, line_ends=ends,
        ping_gain_db=gain_db, lost=float(lost.mean()), repeated=float(repeated.mean()), bright=float(bright.mean()),
        bright_db=bright_db, pulse_length=pulse_length, glints=glints, amplitude=amplitude, usable=usable,
        words=tuple(words))


def _bits(counts):
    """Return the step of counts and the bits that hold the highest."""
    values = np.unique(counts)
    whole = np.rint(values).astype(np.int64)
    if not np.array_equal(whole, values):
        raise ValueError("the samples of the record are no whole numbers; a recorder's counts are needed.")
    step = max(int(np.gcd.reduce(whole)), 1)
    step = max(float(step), whole[-1] / (2 ** MOST_BITS - 1))
    return step, max(int(np.ceil(np.log2(whole[-1] / step + 1) - 1e-9)), 1)


def _faults(counts, first, spacing):
    """Return masks (P,) of pings that are lost, repeated and bright, and how bright [dB] these are."""
    mean = counts.mean((1, 2))
    lost = mean <= DARK * np.median(mean)
    repeated = np.concatenate([[False], (counts[1:] == counts[:-1]).all((1, 2))]) & ~lost
    usual = ndimage.median_filter(mean, 9, mode="nearest")
    ratio = mean / np.maximum(usual, 1e-9)
    bright = (ratio > BRIGHT) & ~lost
    return lost, repeated, bright, float(20 * np.log10(np.median(ratio[bright]))) if bright.any() else 6.0


def _law(line, usable, highest):
    """Return the law of the detector, by the skewness and the CV of the speckle of open bed."""
    found = [_features(patch) for patch in _patches(line, usable, highest)]
    cv, *_, skew = np.median(found, axis=0) if found else (0.5, 0.6)
    return "square" if cv > SQUARE else next((name for name, limit in SKEW.items() if skew < limit), "linear")


def _detector(line, usable, highest, law, pulse_length):
    """Return peak window, low pass, pulse [s], glints and sorted amplitudes of a detector, and a clause."""
    sample = 2 * line.spacing / line.sound_speed
    found = [_features(patch) for patch in _patches(line, usable, highest)]
    if not found:
        return 0.25, 0.0, pulse_length, (0.0, 0.0), np.sort(_trial(sample, pulse_length, 0.25).ravel()), (
            "no open bed of 32 pings by 32 samples was found: a detector of one sample without a low pass is assumed")
    wanted = np.median(found, axis=0)
    pulses = [(pulse_length, peak) for peak in PEAKS]
    pulses += [(float(one) * sample, 0.25) for one in PULSES if one * sample > pulse_length]
    best = np.inf, 0.25, pulse_length, (0.0, 0.0), 0.0, wanted
    for pulse, peak in pulses:
        for glints in GLINTS if pulse == pulse_length else GLINTS[:1]:
            drawn = Detector(law=law).detected(_trial(sample, pulse, peak, *glints) ** 2 / 30)
            k = 0.0 if pulse > pulse_length else _tap(drawn, wanted[1])
            features = _features(Detector(low_pass=k).smoothed(drawn))
            far = float(np.sum(((wanted - features)[:-1] / OFF) ** 2)) * (CLEARLY if pulse > pulse_length else 1)
            if far < best[0]:
                best = far, peak, pulse, glints, k, features
    _, peak, pulse, glints, low_pass, features = best
    amplitude = np.sort(Detector(low_pass=low_pass).smoothed(_trial(sample, pulse, peak, *glints)).ravel())
    return peak, low_pass, pulse, glints, amplitude, (
        f"speckle on open bed: CV {wanted[0]:.3f}, r1 {wanted[1]:.3f}, 1 and 10 % quantiles {wanted[2]:.2f} and "
        f"{wanted[3]:.2f}, kurtosis {np.expm1(wanted[4]):.2g}; a {law} detector with a peak window of {peak:g} samples "
        f"and a low pass of {low_pass:.2g} makes {features[0]:.3f}, {features[1]:.3f}, {features[2]:.2f} and "
        f"{features[3]:.2f}, {np.expm1(features[4]):.2g} of a pulse of {1e3 * pulse:.2g} ms " + (
            f"over glints, {glints[0]:g} a cell with {100 * glints[1]:.0f} % of the strength" if glints[1]
            else "without glints"))


def _tap(drawn, wanted):
    """Return the low pass k that gives detected amplitudes the correlation of neighbours r1."""
    found = [_neighbours(Detector(low_pass=float(k)).smoothed(drawn)) for k in TAPS]
    return round(float(np.interp(wanted, np.maximum.accumulate(found), TAPS)), 3)


def _neighbours(values):
    """Return the correlation of neighbours in range."""
    y = values - values.mean()
    return float((y[:, 1:] * y[:, :-1]).mean() / max(float((y * y).mean()), 1e-12))


def _patches(line, usable, highest):
    """Yield patches of open bed without saturated samples, as outputs."""
    counts = line.counts[usable]
    for side in (0, 1):
        try:
            mask = open_bed(counts[:, side], line.spacing)
        except ValueError:
            continue
        mask &= line.slant_range > CLEAR * line.first[usable, None]
        mask &= counts[:, side] < highest
        for ping in range(0, mask.shape[0] - WINDOW + 1, WINDOW):
            for start in range(0, mask.shape[1] - WINDOW + 1, WINDOW):
                part = np.s_[ping:ping + WINDOW, start:start + WINDOW]
                if mask[part].mean() > 0.98:
                    yield counts[part[0], side, part[1]].astype(float)


def _features(patch):
    """Return CV, r1, 1 and 10 % quantiles over the mean, log of 1 + kurtosis, and skewness of a patch.

    They are those of the patch over its local mean, which has the texture of the bed.
    """
    x = patch / np.maximum(ndimage.gaussian_filter(patch, TREND, mode="nearest"), 0.05 * patch.mean())
    y = x - x.mean()
    spread = max(float(y.std()), 1e-6)
    y3, y4 = (float((y ** power).mean()) / spread ** power for power in (3, 4))
    return np.array([spread / x.mean(), _neighbours(x), *np.quantile(x / x.mean(), (0.01, 0.1)),
                     np.log1p(max(y4 - 3, -0.5)), y3])


def _trial(length, pulse_length, peak, glints=0.0, share=0.0):
    """Return amplitudes (PINGS, BINS) of a peak detector over speckle of mean power 1, by samples [s].

    So many glints, by Poisson's distribution, have a share of the strength of a gate.
    """
    shares, random = pulse_shares(length, pulse_length), np.random.default_rng(1)
    gates = BINS * speckle_gates(length, pulse_length)
    steps = envelope_steps(length, pulse_length) if peak else 1
    fine = random.standard_normal((PINGS, gates * steps + steps - 1, 2)) @ [1, 1j]
    speckle = np.lib.stride_tricks.sliding_window_view(fine, steps, 1).sum(-1).reshape(PINGS, gates, steps)
    speckle /= np.sqrt(2 * steps)
    if share:
        speckle *= np.sqrt(1 - share + share * random.poisson(glints, speckle.shape[:2]) / glints)[..., None]
    even = np.ones((PINGS, BINS))
    drawn = (peaks(even, shares, speckle, 0.0, random, peak) if peak
             else realisation(even, shares, speckle[..., 0], 0.0, random))
    return np.sqrt(drawn / mean_intensity(even, shares)[0, BINS // 2])


def _transmission(output, time, slant_range):
    """Return level [dB], length and ringing [s] of the line of the transmission, and the sample where it has ended."""
    near = max(3, int(np.searchsorted(slant_range, LINE)))
    profile = np.median(output, axis=(0, 1))[:2 * near]
    top = float(profile[:near].max())
    floor = float(np.median(profile[near:])) if profile.size > near else 0.0
    if top < 3 * max(floor, 1e-9):
        return -200.0, 0.0, 0.0, 0
    last = int(np.flatnonzero(profile[:near] > 0.5 * top)[-1])
    after = np.flatnonzero(profile[last:] < 2 * max(floor, 1e-9))
    ends = last + (int(after[0]) if after.size else near)
    level, step = 6.0 if top > 0.99 and last >= 3 else float(20 * np.log10(top)), float(time[1] - time[0])
    # the fall is that to the next sample if it is steep, else that to the noise
    fallen = last + 1 if profile[last + 1] < 0.1 * top else ends
    drop = level - 20 * np.log10(max(profile[min(fallen, profile.size - 1)], 1e-6))
    ringing = (fallen - last - LATE) * step * float(10 * np.log10(np.exp(DECAY))) / max(float(drop), 6.0)
    return level, float(time[last] + LATE * step), ringing, ends


def noise_of(line: SidescanLine, recorder: FoundRecorder, gained: np.ndarray) -> FoundNoise:
    """Return the noise of the water column; `gained` (S,) is the gain over range, as a power.

    Noise before the gain grows with it, noise behind does not: P(R) = N_0 + N_1 g(R), with N_0, N_1 >= 0.
    """
    from scipy.optimize import nnls

    output = recorder.output(line.counts[recorder.usable])
    water = (np.arange(gained.size) > recorder.line_ends + 2) & (
        line.slant_range < WATER * line.first[recorder.usable, None])
    used = np.flatnonzero(water.sum(0) >= FEW)
    if water.sum() < MANY or not used.size:
        return FoundNoise(words=("the water column is too short for its noise: none is added",))
    # the median, which fish and wrecks do not move: of Rayleigh amplitudes its square is ln 2 of the power
    power = np.array([np.mean([np.median(output[water[:, k], side, k]) ** 2 for side in (0, 1)]) for k in used])
    power = np.maximum(power / np.log(2), 1e-12)
    weight = np.sqrt(water.sum(0)[used]) / power
    behind, before = nnls(np.stack([np.ones(used.size), gained[used]], 1) * weight[:, None], power * weight)[0]
    darkest = _darkest(line, output, recorder.usable)
    before = min(before, float(np.min(darkest / gained)))
    behind = max(float(np.average(power - before * gained[used], weights=weight)), 0.0)
    port, starboard = output[:, 0][water], output[:, 1][water]
    inside = (port <= np.quantile(port, 0.98)) & (starboard <= np.quantile(starboard, 0.98))
    # less the means by range and ping, which noise does not have
    ping, place = (numbers[inside] for numbers in np.nonzero(water))
    parts = [_less_means(_less_means(side[inside], place), ping) for side in (port, starboard)]
    together = float(np.mean(parts[0] * parts[1])) / max(float(parts[0].std() * parts[1].std()), 1e-12)
    common = float(behind * np.sqrt(np.clip(together, 0.0, 1.0)))
    return FoundNoise(own=float(behind) - common, common=common, before=float(before), words=(
        f"noise of the water column: {_told(power.mean())} in the mean, {_told(behind)} of it behind the gain and "
        f"{_told(before * gained[used].mean())} before it; {_told(common)} is alike in both sides",))


def _darkest(line, output, usable):
    """Return the powers (S,) of the darkest 1 % of means of 5 by 5 samples of bed, at every range."""
    mean = np.stack([ndimage.uniform_filter(output[:, side] ** 2, 5) for side in (0, 1)], 1)
    bed = np.repeat((line.slant_range > CLEAR * line.first[usable, None])[:, None], 2, 1)
    quantiles = np.full(mean.shape[-1], np.inf)
    for k in np.flatnonzero(bed.sum((0, 1)) >= MANY // FEW):
        quantiles[k] = np.quantile(mean[:, :, k][bed[:, :, k]], 0.01)
    return quantiles


def _told(power):
    return f"{float(db_from_power(power)):.3g} dB re full scale" if power > 1e-12 else "nothing"


def _less_means(values, group):
    """Return values (N,) less the means of their groups (N,)."""
    count = np.bincount(group)
    return values - (np.bincount(group, values) / np.maximum(count, 1))[group]


def _ping_gain_db(output, slant_range, first, usable):
    """Return the rms gain [dB] by which pings differ from their neighbours, beyond the chance of speckle."""
    bed = (slant_range > CLEAR * first[:, None])[:, None] & (output < 0.99)
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.where(bed, np.log(np.maximum(output, 1e-4)), np.nan)
    of_sides = np.nanmean(log, axis=2)
    if len(of_sides) < 8 or not np.isfinite(of_sides).all():
        return 0.0
    # what both sides have in common is the ping's, so that speckle and texture of either drop out
    steps = np.diff(of_sides, axis=0)
    steps = steps[np.abs(steps - np.median(steps, 0)).max(1) < 4 * np.median(np.abs(steps), 0).max() + 1e-9]
    shared = float(np.mean(np.prod(steps - steps.mean(0), axis=1)))
    return float(20 / np.log(10) * np.sqrt(max(shared, 0.0) / 2))


def _decimation(counts):
    """Return by how many samples counts repeat in groups."""
    equal = (counts[..., 1:] == counts[..., :-1]).mean((0, 1))
    for every in (4, 3, 2):
        within = np.arange(equal.size) % every != every - 1
        if equal[within].min() > 0.98 and equal[~within].mean() < 0.5:
            return every
    return 1
