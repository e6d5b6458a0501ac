"""Echogram of an echo sounder: levels, strengths of targets and volumes, angles and depths over ping and range.

    S_v = p² + 20 log r + 2 ∫ α dr - SL - 10 log(c τ / 2) - Ψ                             of the mean power in a bin
    TS  = p² + 40 log r + 2 ∫ α dr - SL                                                   of its strongest sample
    sin θ = φ λ / (2π d),    φ = arg Σ z_2 z_1*                                           over the bin's samples

SL -> source level, Ψ = 10 log ∫ |b_t b_r|² dΩ, τ = ∫ |χ|² dt of the compressed pulse χ, z_1 and z_2 -> signals of two
halves whose middles lie d apart (Simmonds and MacLennan 2005, Fisheries Acoustics, ch. 5; Demer et al. 2015, ICES
Cooperative Research Report 326). The compensated TS is raised by the pattern of the face in the direction θ; beyond
`STEEPEST_DB` of it there is none.

The depth of a ping is that of the strongest echo in the gate, which a sounder takes to lie on its axis. The echo begins
where S_v, averaged over a pulse, first reaches `EDGE` of its maximum; its place is later by as much as |χ|² takes to
rise from `EDGE`. Over a level bed this place is the depth itself where the pulse is longer than the bed's echo, and up
to 0.3 c T / 2 below it where the pulse is short, T the duration before compression.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.signal.matched_filtering import compression
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.beam_patterns import beam_pattern
from mitsonar.sonar.motion.track import Track
from mitsonar.sonar.pulses.pulse import Pulse
from mitsonar.units import NOTHING_DB, db_from_power

from . import picture
from .energy_record import EnergyRecord

DIMS = ("ping", "range")
STEEPEST_DB = 12.0                 # two-way pattern, from the axis
EDGE = 0.1                         # share of the strongest echo's power at which the bed's echo begins
GAP = 0.02                         # share of the range for which speckle may part the bed's echo, beside a pulse
NEAREST = 1.0                      # [m]: gain over range is constant up to here
RINGS, TURNS = 4000, 64            # steps of the quadrature of Ψ, away from the axis and around it


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredPing:
    """Measurements of a ping, arrays (bins,)."""

    power: np.ndarray  # [µPa²], mean
    volume_strength_db: np.ndarray  # [dB re 1/m]
    target_strength_db: np.ndarray  # [dB re 1 m²]
    angles: tuple[np.ndarray, ...]  # [rad], along and athwart; empty: a single beam
    compensated_db: np.ndarray | None  # [dB re 1 m²]
    bottom: float  # [m], range of the bed; NaN: not detected


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedSounder:
    """Echo sounder as calibrated: terms of the sonar equation, and the geometry of its face."""

    time: np.ndarray  # (samples,) [s]
    bins: int
    sound_speed: float  # [m/s]
    loss_db: np.ndarray  # (samples,) [dB], two-way absorption
    source_level_db: float
    pulse: Pulse
    wavelength: float  # [m]
    face: Array
    quadrants: Array | None
    depth_gate: tuple[float, float] | None  # [m]
    bottom_level_db: float  # [dB re 1/m]

    @cached_property
    def sampling_rate(self) -> float:
        """Return the sampling rate [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])

    @cached_property
    def pulse_length(self) -> float:
        """Return τ [s]."""
        return float(compression(self.pulse, self.sampling_rate)[0])

    @property
    def range(self) -> np.ndarray:
        """Return the slant ranges of the samples [m]."""
        return 0.5 * self.sound_speed * self.time

    @cached_property
    def equivalent_beam_angle_db(self) -> float:
        """Return Ψ [dB re 1 sr]."""
        cosine = 1 - (np.arange(RINGS) + 0.5) ** 2 / RINGS ** 2              # finest about the axis
        turn = 2 * np.pi * (np.arange(TURNS) + 0.5) / TURNS
        sine = np.sqrt(1 - cosine ** 2)
        power = self._pattern(sine[:, None] * np.cos(turn), sine[:, None] * np.sin(turn)) ** 4
        return float(db_from_power(2 * np.pi * np.sum(power.mean(1) * (2 * np.arange(RINGS) + 1)) / RINGS ** 2))

    def _pattern(self, along: np.ndarray, athwart: np.ndarray) -> np.ndarray:
        """Return the one-way pressure of the face towards sines along and athwart it."""
        ahead = np.sqrt(np.maximum(1 - along ** 2 - athwart ** 2, 0))
        normal, forward = self.face.normal[0], self.face.along[0]
        towards = (along[..., None] * forward + athwart[..., None] * np.cross(normal, forward)
                   + ahead[..., None] * normal)
        return np.abs(beam_pattern(self.face, towards, self.wavelength))

    def measured(self, whole: np.ndarray, halves: Sequence[np.ndarray]) -> MeasuredPing:
        """Return the measurements from the signals of the face (samples,) and of pairs of halves (2, samples) [µPa]."""
        power, spread = np.abs(whole).astype(float) ** 2, np.log10(np.maximum(self.range, NEAREST))
        strength = np.maximum(db_from_power(power), NOTHING_DB) + self.loss_db - self.source_level_db
        volume = self._volume_db + 20 * spread + strength
        mean = self._by_bin(power).mean(1)
        volume_bins = np.maximum(db_from_power(mean), NOTHING_DB) + self._by_bin(
            self.loss_db + 20 * spread).mean(1) - self.source_level_db + self._volume_db
        target = self._by_bin(strength + 40 * spread).max(1)
        sines = [np.angle(self._by_bin(high * np.conj(low)).sum(1)) * self.wavelength / (2 * np.pi * self._apart)
                 for low, high in halves]
        compensated = None
        if sines:
            along, athwart = sines
            more = -4 * db_from_power(np.maximum(self._pattern(along, athwart), 1e-6))
            compensated = np.where(more <= STEEPEST_DB, target + more, np.nan)
        return MeasuredPing(power=mean, volume_strength_db=volume_bins, target_strength_db=target,
                            angles=tuple(np.arcsin(np.clip(sine, -1, 1)) for sine in sines),
                            compensated_db=compensated, bottom=self._bottom(volume))

    @cached_property
    def _volume_db(self) -> float:
        """Return the term of S_v that is the same at all ranges [dB]."""
        return -float(db_from_power(0.5 * self.sound_speed * self.pulse_length)) - self.equivalent_beam_angle_db

    @property
    def _apart(self) -> float:
        """Return the distance of the middles of two halves [m]."""
        return float(np.ptp(self.quadrants.position @ self.face.along[0])) if self.quadrants is not None else np.nan

    def _by_bin(self, samples: np.ndarray) -> np.ndarray:
        """Return samples as (bins, samples of each)."""
        return samples.reshape(self.bins, -1)

    def _bottom(self, volume_db: np.ndarray) -> float:
        """Return the range of the bed [m] from the S_v of samples; NaN where no echo in the gate is strong enough."""
        window = self._window
        strength = ndimage.uniform_filter1d(10 ** (0.1 * volume_db), window, mode="nearest")
        low, high = self.depth_gate or (0.0, np.inf)
        down = float(self.face.normal[0][2])
        inside = (self.range * down >= low) & (self.range * down <= high) & (self.range > NEAREST)
        strength = np.where(inside, strength, 0)
        peak = int(np.argmax(strength))
        if not strength[peak] > 10 ** (0.1 * self.bottom_level_db):
            return np.nan
        loud = strength >= EDGE * strength[peak]
        before = np.flatnonzero(loud[:peak + 1])
        gap = window + GAP * self.range[peak] * 2 / self.sound_speed * self.sampling_rate
        first = before[np.flatnonzero(np.diff(before, prepend=-np.inf) > gap)[-1]]
        return float(self.range[first]) + 0.5 * self.sound_speed * self._rise

    @property
    def _window(self) -> int:
        """Return the number of samples of a compressed pulse."""
        return max(int(round(self.pulse_length * self.sampling_rate)), 1)

    @cached_property
    def _rise(self) -> float:
        """Return the time [s] in which the averaged power of the compressed pulse rises from `EDGE` to its maximum."""
        power = compressed_power(self.pulse, self.sampling_rate)
        power = ndimage.uniform_filter1d(power, self._window, mode="constant")
        return float(len(power) // 2 - np.flatnonzero(power >= EDGE * power.max())[0]) / self.sampling_rate


def compressed_power(pulse: Pulse, sampling_rate: float) -> np.ndarray:
    """Return |χ|² of a pulse at a sampling rate [Hz], with its maximum in the middle."""
    sent = pulse.sampled_at(sampling_rate)
    return np.abs(np.correlate(sent, sent, "full")) ** 2 / np.sum(np.abs(sent) ** 2) ** 2


def image(sounder: CalibratedSounder, measured: Sequence[MeasuredPing], record: EnergyRecord, *, track: Track,
          depth_below: np.ndarray, labels: Mapping[int, str], class_of: Mapping[int, int],
          attrs: Mapping[str, Any]) -> xr.Dataset:
    """Return the echogram of a run; the record's intensities are mean powers [µPa²]."""
    time, entry = sounder.time.reshape(sounder.bins, -1).mean(1), partial(picture.entry, DIMS)
    # an echo lasts for a pulse, which may be longer than the bins
    lit = replace(record, rays_in_beam=(record.intensity > 0).astype(np.uint32))

    def column(name: str) -> np.ndarray:
        return np.stack([getattr(ping, name) for ping in measured])

    def strengths(name: str, units: str, words: str) -> tuple:
        return entry(column(name).astype(np.float32), units, words)

    split = {}
    if measured[0].angles:
        for number, (name, way) in enumerate((("along", "ahead"), ("athwart", "to starboard"))):
            angle = np.stack([ping.angles[number] for ping in measured]).astype(np.float32)
            split[f"angle_{name}"] = entry(angle, "rad", f"direction of the echo, {way} of the axis")
        split["compensated_target_strength"] = strengths(
            "compensated_db", "dB re 1 m²", "target strength, compensated for the pattern of the face")
    down = float(sounder.face.normal[0][2])
    bottom = -track.position[:, 2] + down * np.array([ping.bottom for ping in measured])
    bins = picture.bins_of(time, sounder.sound_speed, attrs["pulse"])
    return picture.picture(
        "echo_sounder", DIMS,
        {"level": entry(picture.levels(column("power")), "dB re 1 µPa", "echo level"),
         "mean_level": entry(picture.levels(record.intensity.astype(float)), "dB re 1 µPa",
                             "level of the direct echoes of bed and objects, without speckle and noise"),
         "volume_strength": strengths("volume_strength_db", "dB re 1 m⁻¹", "volume strength S_v"),
         "target_strength": strengths("target_strength_db", "dB re 1 m²",
                                      "target strength of the strongest sample, as if on the axis"),
         **split,
         "measured_depth": picture.entry("ping", bottom, "m", "depth of the bed, by the leading edge of its echo")},
        lit, bins=bins, pings=picture.pings_of(track, depth_below), rows={}, labels=labels, class_of=class_of,
        attrs={"looks": "down", **attrs, "source_level_db": sounder.source_level_db,
               "pulse_length": sounder.pulse_length, "equivalent_beam_angle_db": sounder.equivalent_beam_angle_db,
               "absorption_db": float(sounder.loss_db[-1] / (2 * sounder.range[-1]))})
