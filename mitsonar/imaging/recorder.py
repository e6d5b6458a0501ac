"""Recorder of an instrument: what stands behind its receivers, from the echo level to the counts in its file.

    a   = 10^((L + G(R) - A) / 20) g_b g_p s_j                        amplitude, as a share of full scale
    a  <- max a  within w samples                                     peak detector
    u²  = |a + √(N_b + x <a²>) n_b + √(N + I) n|² + e²                noise, crosstalk, interference, transmission
    d   = u², u, √u or 1 + 20 log u / D                               detector
    d_j = k d_(j-1) + (1 - 2k) d_j + k d_(j+1)                        its low pass along range
    d_p = m d_(p-1) + (1 - m) d_p                                     and from ping to ping
    C   = ⌊(2^B - 1) d + 1/2 + δ⌋, 0 to 2^B - 1                       converter

    G(R) = k_s log R + 2 α R,  R held within the limits of the gain, in whole steps

L -> ``level``, A -> ``full_scale_db``, B -> ``bits``, D -> ``range_db``, k -> ``low_pass``, m -> ``along_track``, w ->
``peak``, k_s -> ``spreading``; g_b the gains of rows and sectors, g_p of pings, s_j of samples; n complex Gaussian of
unit variance, n_b of each row and n of all rows alike; N_b -> ``noise``, N -> ``common_noise``, x -> ``crosstalk``, I
interference, e the line of the transmission, δ dither, uniform within half a step. `recording.recorded_levels` is the
way back.

Three taps (k, 1 - 2k, k) over independent samples of a coefficient of variation CV leave them correlated:

    r_1 = 2k (1 - 2k) / q,   r_2 = k² / q,   CV -> CV √q,   q = (1 - 2k)² + 2k²
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

DECAY = np.log(1e6)                # of a power over the ringing: 60 dB
LAWS = ("linear", "square", "root", "log")
MOST_BITS = 24                     # what float32 resolves
MOST_TAP = 1 / 3                   # three equal taps
MOST_SAMPLES = 16                  # of a peak detector's window


@dataclass(frozen=True, kw_only=True)
class TimeVariedGain:
    """Gain over slant range."""

    spreading: float = 0.0  # [dB]: per factor of 10 in range
    absorption_db: float | None = None  # [dB/m]: one way; None: the water's
    start: float = 1.0  # [m]: the gain is constant before
    end: float = np.inf  # [m]: and after
    step_db: float = 0.0  # [dB]: of an amplifier with steps; 0: smooth
    sectors_db: tuple[float, ...] = (0.0,)  # [dB]: more gain of each of as many equal parts of the rows

    def __post_init__(self):
        if not 0 < self.start < self.end or self.step_db < 0 or not self.sectors_db:
            raise ValueError(f"the gain starts at {self.start:g} m, ends at {self.end:g} m and has steps of "
                             f"{self.step_db:g} dB in {len(self.sectors_db)} sectors; give a start above 0, an end "
                             "after it, steps of 0 or more, and one sector or more.")

    def over(self, slant_range: np.ndarray) -> np.ndarray:
        """Return the gain [dB] at slant ranges [m]."""
        R = np.clip(slant_range, self.start, self.end)
        gain = self.spreading * np.log10(R) + 2 * (self.absorption_db or 0.0) * R
        return np.floor(gain / self.step_db) * self.step_db if self.step_db else gain

    def of_rows(self, rows: int) -> np.ndarray:
        """Return the gain (B,) [dB] of rows beside that over range."""
        return np.asarray(self.sectors_db)[np.arange(rows) * len(self.sectors_db) // rows]


@dataclass(frozen=True, kw_only=True)
class Detector:
    """Detector behind the gain, and what smooths its output."""

    law: str = "linear"  # one of `LAWS`
    range_db: float = 60.0  # [dB]: below full scale, where a log detector gives 0
    peak: float = 0.0  # [samples]: window in which the highest amplitude is taken; 0: the sample's own
    low_pass: float = 0.0  # share k of each neighbour in range
    along_track: float = 0.0  # share m of the ping before
    decimation: int = 1  # one of so many samples is kept and repeated

    def __post_init__(self):
        if self.law not in LAWS:
            raise ValueError(f"the detector is {self.law!r}; it is one of {', '.join(LAWS)}.")
        if not (0 <= self.low_pass <= MOST_TAP and 0 <= self.along_track < 1 and self.decimation >= 1
                and 0 < self.range_db < np.inf and 0 <= self.peak <= MOST_SAMPLES):
            raise ValueError(f"the detector has a low pass of {self.low_pass:g}, {self.along_track:g} along the track, "
                             f"a decimation of {self.decimation}, a range of {self.range_db:g} dB and a window of "
                             f"{self.peak:g} samples; give at most {MOST_TAP:.3g}, less than 1, 1 or more, a range "
                             f"above 0, and 0 to {MOST_SAMPLES} samples.")

    def detected(self, power: np.ndarray) -> np.ndarray:
        """Return the output for powers u², 1 at full scale."""
        if self.law == "square":
            return power
        if self.law == "log":
            with np.errstate(divide="ignore"):
                return np.maximum(1 + 10 * np.log10(power) / self.range_db, 0)
        amplitude = np.sqrt(power)
        return amplitude if self.law == "linear" else np.sqrt(amplitude, out=amplitude)

    def power(self, detected: np.ndarray) -> np.ndarray:
        """Return the powers u² of outputs; those of a log detector's 0 are below its range."""
        if self.law == "log":
            return np.where(detected > 0, 10 ** ((detected - 1) * self.range_db / 10), 0)
        return detected ** {"square": 1, "linear": 2, "root": 4}[self.law]

    def smoothed(self, detected: np.ndarray) -> np.ndarray:
        """Return the output (..., S) after the low pass along range and the decimation."""
        if k := self.low_pass:
            found = (1 - 2 * k) * detected
            found[..., 1:] += k * detected[..., :-1]
            found[..., :-1] += k * detected[..., 1:]
            found[..., [0, -1]] += k * detected[..., [0, -1]]                # the ends repeat beyond the record
            detected = found
        if (every := self.decimation) == 1:
            return detected
        return np.repeat(detected[..., ::every], every, -1)[..., :detected.shape[-1]]


@dataclass(frozen=True, kw_only=True)
class Converter:
    """Analogue-to-digital converter."""

    bits: int  # of a count
    full_scale_db: float  # [dB re 1 µPa]: level after the gain that is the highest count
    dither: bool = False

    def __post_init__(self):
        if not 1 <= self.bits <= MOST_BITS or not np.isfinite(self.full_scale_db):
            raise ValueError(f"the converter has {self.bits} bits and a full scale of {self.full_scale_db:g} dB; give "
                             f"1 to {MOST_BITS} bits and a finite level.")

    @property
    def highest(self) -> int:
        """Return the highest count."""
        return 2 ** self.bits - 1

    @property
    def dtype(self) -> np.dtype:
        """Return the smallest type that holds the counts."""
        return np.dtype(np.uint8 if self.bits <= 8 else np.uint16 if self.bits <= 16 else np.uint32)

    def counts(self, detected: np.ndarray, random: np.random.Generator) -> np.ndarray:
        """Return the counts of a detector's output, 1 at full scale."""
        scaled = detected * np.float32(self.highest) + np.float32(0.5)
        if self.dither:
            scaled += random.random(scaled.shape, np.float32) - np.float32(0.5)
        return np.clip(scaled, 0, self.highest, out=scaled).astype(self.dtype)


@dataclass(frozen=True, kw_only=True)
class Electronics:
    """Noise, line of the transmission, stripes and interference; powers are shares of full scale."""

    noise: float = 0.0  # of each row
    noise_edge_db: float = 0.0  # [dB]: more of it in the outermost rows, by the square of the row from the middle
    noise_rows_db: float = 0.0  # [dB]: rms of the rows' noises
    noise_ranges_db: float = 0.0  # [dB]: rms of the noises of samples at fixed ranges
    common_noise: float = 0.0  # of all rows alike
    crosstalk: float = 0.0  # share of the rows' mean power in every row
    line: float = 0.0  # of the transmission at range zero
    line_length: float = 0.0  # [s]: of the transmission
    ringing: float = 0.0  # [s]: in which it falls by 60 dB afterwards
    row_gain_db: float = 0.0  # [dB]: rms of the rows' gains
    stripe_db: float = 0.0  # [dB]: rms of the gains of samples at fixed ranges
    interference: float = 0.0  # of another sonar's pulses
    interference_rate: float = 0.0  # [Hz]: of its pings
    interference_length: float = 0.0  # [s]: of its pulses

    def __post_init__(self):
        for name, value in vars(self).items():
            if not 0 <= value < np.inf:
                raise ValueError(f"{name} of the recorder is {value:g}; give a finite number of 0 or more.")

    def row_noise(self, rows: int, samples: int, random: np.random.Generator) -> np.ndarray | None:
        """Return the noise (B, S) of an instrument's rows and samples over `noise`, in power; None where all are 1."""
        if not (self.noise_edge_db or self.noise_rows_db or self.noise_ranges_db):
            return None
        edge = self.noise_edge_db * np.linspace(-1, 1, rows) ** 2 if rows > 1 else np.zeros(1)
        more = (edge + self.noise_rows_db * random.standard_normal(rows))[:, None] + (
            self.noise_ranges_db * random.standard_normal(samples))
        return (10 ** (more / 10)).astype(np.float32)

    def transmission(self, time: np.ndarray) -> np.ndarray:
        """Return the power e² of the transmission at times [s] after its beginning."""
        if not self.line:
            return np.zeros_like(time)
        after = np.maximum(time - self.line_length, 0)
        if not self.ringing:
            return self.line * (after == 0)
        return self.line * np.exp(-DECAY * after / self.ringing)

    def interfering(self, time: np.ndarray) -> np.ndarray:
        """Return the power I of another sonar's pulses at times [s] since the run began."""
        if not self.interference or not self.interference_rate:
            return np.zeros_like(time)
        # the phase of the other sonar is that of a ping half an interval before the run
        since = np.mod(time + 0.5 / self.interference_rate, 1 / self.interference_rate)
        return self.interference * (since < self.interference_length)


@dataclass(frozen=True, kw_only=True)
class PingFaults:
    """Faults of whole pings."""

    gain_db: float = 0.0  # [dB]: rms of the pings' gains
    lost: float = 0.0  # share of pings that are written as zeros
    repeated: float = 0.0  # share of pings in whose place the ping before is written again
    bright: float = 0.0  # share of brighter pings
    bright_db: float = 6.0  # [dB]: by which these are brighter

    def __post_init__(self):
        shares = self.lost, self.repeated, self.bright
        if min(shares) < 0 or sum(shares) > 1 or self.gain_db < 0:
            raise ValueError(f"shares of {self.lost:g} lost, {self.repeated:g} repeated and {self.bright:g} brighter "
                             f"pings and gains of {self.gain_db:g} dB rms were given; give shares of 0 or more with a "
                             "sum of at most 1, and gains of 0 or more.")


@dataclass(frozen=True, kw_only=True)
class Recorder:
    """Recorder of an instrument."""

    converter: Converter
    gain: TimeVariedGain = field(default_factory=TimeVariedGain)
    detector: Detector = field(default_factory=Detector)
    electronics: Electronics = field(default_factory=Electronics)
    faults: PingFaults = field(default_factory=PingFaults)
    interpolation: int = 1  # one of so many rows is formed, and those between are interpolated
    serial: int = 0  # number of the instrument: draws the gains of its rows and samples

    def __post_init__(self):
        if self.interpolation < 1 or self.serial < 0:
            raise ValueError(f"one of {self.interpolation} rows is formed, by the instrument {self.serial}; give 1 or "
                             "more, and a number of 0 or more.")


def formed_rows(rows: int, every: int) -> np.ndarray:
    """Return the numbers (F,) of rows that are formed: one of `every`, and the last."""
    return np.unique(np.append(np.arange(0, rows, every), rows - 1))


def interpolated(values: np.ndarray, formed: np.ndarray) -> np.ndarray:
    """Return the values of all rows (B, S) from those of the formed ones (F, S), linear between them."""
    if len(formed) == formed[-1] + 1:
        return values
    number = np.arange(formed[-1] + 1)
    after = np.clip(np.searchsorted(formed, number, "right"), 1, len(formed) - 1)
    share = (number - formed[after - 1]) / (formed[after] - formed[after - 1])
    return values[after - 1] + share.astype(values.dtype)[:, None] * (values[after] - values[after - 1])


def gains(decibels: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return amplitudes of gains [dB], float32."""
    return (10 ** (np.asarray(decibels) / 20)).astype(np.float32)
