"""Seabed of measured backscatter strength: a table over grazing angle and frequency.

    σ(θ_i, θ_s) = sqrt(σ_b(θ_i) σ_b(θ_s)),        σ_b = 10^(S_b / 10)

S_b -> ``strengths_db``, linear in θ -> ``angles`` between its entries and in ln f -> ``frequencies`` between columns,
constant beyond the last angle and the outer frequencies; below the first angle σ_b falls as sin² θ. The bistatic
extension is reciprocal, equals the table in backscatter, and is the same in all azimuths, which were not measured. A
table is refused if it returns more energy than arrives:  2π sqrt(σ_b(θ_i)) ∫ sqrt(σ_b) cos θ dθ / sin θ_i > 1.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

STEPS = 4000                       # of the integral over θ


@dataclass(frozen=True, kw_only=True, eq=False)
class EmpiricalSeabed:
    """Seabed with a table of backscatter strength.

    Parameters
    ----------
    angles : array (A,) [rad]
        Grazing angles, increasing, above 0 and up to π/2.
    strengths_db : array (A,) or (A, F) [dB re 1 m^2/m^2]
    frequencies : array (F,) [Hz], optional
        Increasing frequencies of the columns, required for several columns. A single column applies at all frequencies.
    name : str
        Name in error messages.

    Raises
    ------
    ValueError
        If the shapes do not fit, a number is invalid, or the seabed would return more energy than arrives.
    """

    angles: np.ndarray
    strengths_db: np.ndarray
    frequencies: np.ndarray | None = None
    name: str = "empirical"

    def __post_init__(self):
        angles, strengths = np.atleast_1d(np.asarray(self.angles, float)), np.asarray(self.strengths_db, float)
        strengths = strengths[:, None] if strengths.ndim == 1 else strengths
        if angles.ndim != 1 or not angles.size or not ((0 < angles) & (angles <= np.pi / 2 + 1e-6)).all() \
                or (np.diff(angles) <= 0).any():
            raise ValueError(f"{self.name}: the grazing angles must increase, from above 0 to at most 90 degrees.")
        if strengths.ndim != 2 or len(strengths) != len(angles) or not np.isfinite(strengths).all():
            raise ValueError(f"{self.name}: {len(angles)} grazing angles need as many rows of finite strengths [dB], "
                             f"got an array of shape {np.shape(self.strengths_db)}.")
        frequencies = np.atleast_1d(np.asarray(1.0 if self.frequencies is None else self.frequencies, float))
        if frequencies.shape != strengths.shape[1:] or not (frequencies > 0).all() or (np.diff(frequencies) <= 0).any():
            raise ValueError(f"{self.name}: {strengths.shape[1]} columns of strengths need as many frequencies [Hz], "
                             "above 0 and increasing.")
        for field, value in (("angles", angles), ("strengths_db", strengths), ("frequencies", frequencies)):
            object.__setattr__(self, field, value)
        for frequency in frequencies:
            share, angle = self._largest_share(frequency)
            if share > 1 + 1e-6:
                column = "" if len(frequencies) == 1 else f" at {frequency / 1e3:g} kHz"
                raise ValueError(f"{self.name}: more comes back than arrives{column}: {share:.3g} of what comes in at "
                                 f"{np.degrees(angle):.1f} degrees; check the strengths, in dB re 1 m²/m².")

    def backscatter_strength(self, grazing: ArrayLike, frequency: ArrayLike) -> np.ndarray:
        """Return σ_b [-] at grazing angles [rad] and frequencies [Hz] that broadcast."""
        grazing, frequency = np.broadcast_arrays(np.asarray(grazing, float), frequency)
        first, last = self.angles[[0, -1]]
        row, rest = _place(self.angles, np.clip(grazing, first, last))
        frequencies = np.asarray(self.frequencies)             # an array from the start
        column, part = _place(np.log(frequencies), np.log(frequency))
        after = np.minimum(row + 1, len(self.angles) - 1), np.minimum(column + 1, len(frequencies) - 1)
        table = self.strengths_db
        low = table[row, column] * (1 - rest) + table[after[0], column] * rest
        high = table[row, after[1]] * (1 - rest) + table[after[0], after[1]] * rest
        below = np.minimum(np.sin(grazing) / np.sin(first), 1) ** 2
        return 10 ** ((low * (1 - part) + high * part) / 10) * below

    def scattering_strength(self, grazing_in: ArrayLike, grazing_out: ArrayLike, azimuth: ArrayLike,
                            frequency: ArrayLike, sound_speed: ArrayLike) -> np.ndarray:
        """Return σ [-], for angles [rad] and frequency [Hz]; azimuth and sound speed are only broadcast."""
        way_in, way_out, frequency, *_ = np.broadcast_arrays(grazing_in, grazing_out, frequency, azimuth, sound_speed)
        return np.sqrt(self.backscatter_strength(way_in, frequency) * self.backscatter_strength(way_out, frequency))

    def _largest_share(self, frequency: float) -> tuple[float, float]:
        """Return the largest share of incident energy that is scattered, and its grazing angle of incidence [rad]."""
        angle = np.union1d(np.linspace(0, np.pi / 2, STEPS + 1), self.angles)[1:]
        root = np.sqrt(self.backscatter_strength(angle, frequency))
        whole = 2 * np.pi * np.trapezoid(np.append(0, root * np.cos(angle)), np.append(0, angle))
        share = whole * root / np.sin(angle)
        return float(share.max()), float(angle[share.argmax()])


def _place(nodes: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the index of the node before each value and its fraction towards the next, 0..1, clipped at both ends."""
    index = np.clip(np.searchsorted(nodes, value, side="right") - 1, 0, max(len(nodes) - 2, 0))
    if len(nodes) == 1:
        return index, np.zeros(np.shape(value))
    return index, np.clip((value - nodes[index]) / (nodes[index + 1] - nodes[index]), 0, 1)
