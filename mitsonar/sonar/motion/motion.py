"""Random motion of a sonar: narrow-band roll, pitch, yaw, heave and sway, and the strum of a cable.

Each of the five is a sum of sinusoids

    a(t) = rms √(2/N) Σ_n cos(2π f_n t + φ_n),    f_n from a normal density about 1/period,  φ_n uniform

which for large N is a Gaussian process with that spectrum (Rice, Mathematical Analysis of Random Noise, 1944,
section 2.8). One f_n stands in each N-th part of the density; the mean square over a long time is rms², whatever the
seed. Surge is heave times a factor: what the cable of a tow pulls up, it pulls forward.

A cable sheds vortices, and shakes what it tows in heave and pitch, in a band about

    f = St U / d,    St = 0.2

U -> ``speed``, d -> ``diameter`` of `strum_frequency`. St holds for Reynolds numbers U d/ν of 300 to 2e5 (Blevins,
Flow-Induced Vibration, 1990, section 3.2), that is of cables of 1 to 50 mm at 1 to 8 knots. The band is narrow, as
shedding locks to a natural frequency of the cable.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

STROUHAL = 0.2
_LINES = 32
_RELATIVE_WIDTH = 0.15             # standard deviation of the frequencies about 1 / period, relative
_STRUM_WIDTH = 0.02                # of a strum about its frequency
_FASTEST = 3.0                     # standard deviations above its frequency beyond which a strum has no line
_NAMES = ("roll", "pitch", "yaw", "heave", "sway")
_ALONG_WITH = {"surge": "heave"}   # what has the same course, times a factor
_STREAM = {"roll": 0, "pitch": 1, "yaw": 2, "heave": 3, "sway": 6}                   # of chance
_STRUM = {"heave": 4, "pitch": 5}  # likewise


def strum_frequency(speed: float, diameter: float) -> float:
    """Return the frequency f [Hz] at which a cable of a diameter [m] sheds vortices at a speed [m/s]."""
    return STROUHAL * speed / diameter


@dataclass(frozen=True, kw_only=True)
class RandomMotion:
    """Random motion of a platform: its strength, its periods and its seed."""

    roll: float = 0.0  # [rad] rms
    pitch: float = 0.0  # [rad] rms
    yaw: float = 0.0  # [rad] rms
    heave: float = 0.0  # [m] rms, upwards
    surge: float = 0.0  # [m] rms, forward; it follows the course of heave
    sway: float = 0.0  # [m] rms, to starboard
    period: float = 8.0  # [s]: middle of the spectrum of the motion
    roll_period: float | None = None  # [s]: of the roll alone; None: `period`
    pitch_period: float | None = None  # [s]: likewise
    yaw_period: float | None = None  # [s]: likewise
    heave_period: float | None = None  # [s]: likewise
    sway_period: float | None = None  # [s]: likewise
    strum_heave: float = 0.0  # [m] rms of a cable's strum
    strum_pitch: float = 0.0  # [rad] rms of a cable's strum
    strum_frequency: float = 10.0  # [Hz]: middle of the spectrum of the strum
    seed: int = 0  # the same seed gives the same motion

    def __post_init__(self):
        periods = [f"{name}_period" for name in _NAMES if getattr(self, f"{name}_period") is not None]
        above = ("period", "strum_frequency", *periods)
        for name in (*_NAMES, "surge", "strum_heave", "strum_pitch", *above):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0 and (value > 0 or name not in above)):
                raise ValueError(f"random motion: {name} is {value!r}; give a finite number "
                                 f"{'above 0' if name in above else 'of 0 or more'}.")

    @property
    def moves(self) -> bool:
        """Return True if the platform moves randomly."""
        return self.strums or any(getattr(self, name) for name in (*_NAMES, "surge"))

    @property
    def strums(self) -> bool:
        """Return True if a cable strums."""
        return self.strum_heave + self.strum_pitch > 0

    @property
    def fastest(self) -> float:
        """Highest frequency of a strum [Hz]; 0 where there is none."""
        return self.strum_frequency * (1 + _FASTEST * _STRUM_WIDTH) if self.strums else 0.0

    def at(self, times: ArrayLike) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Realise the motion."""
        # times (...) [s] -> values, rates (...)
        times = np.asarray(times, dtype=np.float64)
        values = {name: np.zeros_like(times) for name in (*_NAMES, *_ALONG_WITH)}
        rates = {name: np.zeros_like(times) for name in values}
        for name, stream, rms, centre, width in self._bands():
            scale = rms * np.sqrt(2 / _LINES)
            for line, start in zip(*_lines(int(self.seed), stream, centre, width)):     # memory as of one
                values[name] += scale * np.cos(line * times + start)
                rates[name] -= scale * line * np.sin(line * times + start)
        return values, rates

    def _bands(self):
        """A moving component: name, random stream, rms, angular frequency [rad/s] and its relative width."""
        for name in (*_NAMES, *_ALONG_WITH):
            course = _ALONG_WITH.get(name, name)
            period = getattr(self, f"{course}_period") or self.period
            if rms := getattr(self, name):
                yield name, _STREAM[course], rms, 2 * np.pi / period, _RELATIVE_WIDTH
        for name, stream in _STRUM.items():
            if rms := getattr(self, f"strum_{name}"):
                yield name, stream, rms, 2 * np.pi * self.strum_frequency, _STRUM_WIDTH


@lru_cache(maxsize=64)
def _lines(seed: int, stream: int, centre: float, width: float) -> tuple[list[float], list[float]]:
    """Angular frequencies [rad/s] and phases [rad] of a band's lines."""
    from scipy.special import ndtri

    rng = np.random.default_rng([seed, stream])
    share = (np.arange(_LINES) + rng.uniform(0.05, 0.95, _LINES)) / _LINES
    omega = centre * (1 + width * ndtri(share))
    return omega.tolist(), rng.uniform(0, 2 * np.pi, _LINES).tolist()
