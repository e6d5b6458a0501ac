"""Echo levels as the 16-bit samples of recorders, and the way back.

    n = round(10^((level + gain(R) - offset) / 20)),  0 to 65535         amplitudes, as sidescan software expects them
    level = 20 log10(n) + offset - gain(R)                               dB re 1 µPa
    gain(R) = k log10(R) + 2 a R                                         k = 30 (seabed), 40 (target), or no gain at all

With the gain `counts`, samples are the counts of the instrument's recorder, and k, a and the offset are its own.

R is the slant range of the middle of a sample [m], a the absorption [dB/m]. Full scale is the record's highest level
after the gain, or 40 dB over its median where that is lower: few bright echoes
saturate, as they do in recorders, so that the bed keeps its steps. 0 means no sound, or less than half a step.
"""
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.imaging.gain import SPREADING, Tvg, absorption_of
from mitsonar.imaging.recording import settings_of
from mitsonar.units import NOTHING_DB

FULL = 65535
HEADROOM_DB = 40.0                 # over the median


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Scale of samples; its numbers are rounded to the digits that are written."""

    offset_db: float  # [dB re 1 µPa]: level, after the gain, of the sample 1
    spreading_db: float  # [dB]: k
    absorption_db: float  # [dB/m]: 2 a

    def gain(self, slant_range: np.ndarray) -> np.ndarray:
        """Return the gain [dB] at slant ranges [m]."""
        return self.spreading_db * np.log10(np.maximum(slant_range, 1e-3)) + self.absorption_db * slant_range

    def amplitude(self, level: np.ndarray, slant_range: np.ndarray) -> np.ndarray:
        """Return amplitudes (..., N), 1 for a step, of levels (..., N) [dB re 1 µPa] at slant ranges [m]."""
        sound = np.isfinite(level) & (level > NOTHING_DB)
        raised = np.where(sound, level, -np.inf) + self.gain(slant_range) - self.offset_db
        return 10 ** (np.minimum(raised, 200.0) / 20)

    def samples(self, level: np.ndarray, slant_range: np.ndarray) -> tuple[np.ndarray, int]:
        """Return samples (..., N) uint16 of levels (..., N) [dB re 1 µPa], and how many are saturated."""
        amplitude = np.rint(self.amplitude(level, slant_range))
        return np.minimum(amplitude, FULL).astype(np.uint16), int(np.count_nonzero(amplitude > FULL))

    def levels(self, samples: np.ndarray, slant_range: np.ndarray) -> np.ndarray:
        """Return levels (..., N) [dB re 1 µPa] of samples; -inf of 0."""
        with np.errstate(divide="ignore"):
            return 20 * np.log10(np.asarray(samples, float)) + self.offset_db - self.gain(slant_range)

    def words(self) -> str:
        """Write the way back in at most 64 characters; n is the sample and R the slant range in metres."""
        gain = f"-{self.spreading_db:g}lgR-{self.absorption_db:.4f}R" if self.spreading_db else ""
        return f"dB re 1uPa = 20lg n{self.offset_db:+.2f}{gain}"


def scale_of(record: xr.Dataset, tvg: Tvg) -> Scale:
    """Choose the scale of a record's levels, or return that of its counts."""
    if tvg == "counts":
        return _scale_of_counts(record)
    if tvg is not None and tvg not in SPREADING:
        raise ValueError(f"the gain is {tvg!r}; use 'seabed', 'target', 'recorder', 'counts' or None.")
    # rounded as it is written
    absorption = round(2 * absorption_of(record.attrs), 4) if tvg else 0.0
    plain = Scale(offset_db=0.0, spreading_db=SPREADING[tvg] if tvg else 0, absorption_db=absorption)
    level = record["level"].transpose("ping", "side", "range").values
    raised = level + plain.gain(record["range"].values).astype(np.float32)
    raised = raised[np.isfinite(level) & (level > NOTHING_DB)]
    if not raised.size:
        return plain
    full = min(float(raised.max()), float(np.median(raised)) + HEADROOM_DB)
    return Scale(offset_db=float(np.ceil(100 * (full - 20 * np.log10(FULL))) / 100),
                 spreading_db=plain.spreading_db, absorption_db=absorption)


def _scale_of_counts(record: xr.Dataset) -> Scale:
    recorder = settings_of(record)
    if recorder["law"] != "linear" or recorder["bits"] > FULL.bit_length():
        raise ValueError(f"the samples of an XTF are amplitudes of 16 bits, and these counts are {recorder['law']} "
                         f"ones of {recorder['bits']} bits; give another gain, and its levels are written.")
    return Scale(offset_db=round(recorder["full_scale_db"] - 20 * np.log10(2 ** recorder["bits"] - 1), 2),
                 spreading_db=recorder["spreading"], absorption_db=round(2 * recorder["absorption_db"], 4))
