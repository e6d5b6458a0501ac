"""Sand ripples: crests with a given cross-section, wandering crest lines and dislocations.

    cycles   q = u / wavelength + wander / wavelength + dislocations + c,   f = q - floor(q)
    angle    t = pi (f / c - 1) up the stoss side (f < c),   pi (f - c) / (1 - c) down the lee
             c = (1 + asymmetry) / 2
    height   h = (height / 2) (1 - 2 |sin(t / 2)|^m - mean),   m = 2 - sharpness

u -> metres along ``heading``. The phase grows by one cycle around a dislocation, where a crest ends or forks.
Dislocations come in pairs of opposite sense, so that their effect is local, and the height fades at their cores.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from .places import around, tiles, wander
from .relief import Relief, along, check, step

_TILE = 16             # wavelengths; seed and position of a tile determine its pairs
_GAP = (2.0, 5.0)      # wavelengths between the dislocations of a pair, from and to
_REACH = 2.0           # gaps from the middle of a pair to the end of its effect
_CORE = 0.5            # wavelengths over which the height fades at a dislocation


@dataclass(frozen=True, kw_only=True)
class Ripples(Relief):
    """Field of sand ripples; the defaults give a sinusoid with a crest at the origin."""

    wavelength: float  # [m]
    height: float  # [m]: from trough to crest
    heading: float = 0.0  # [rad]: compass heading normal to the crests, towards which the steep sides face
    asymmetry: float = 0.0  # 0 for equal sides, near 1 for a vertical lee; the stoss side has (1 + asymmetry) / 2
    sharpness: float = 0.0  # 0 for sinusoidal, 1 for pointed crests between rounded troughs
    wander: float = 0.0  # [m]: root-mean-square displacement of the crests along ``heading``
    wander_length: float | None = None  # [m]: scale of the wander, at least 2 ``wander``; None: 8 wavelengths
    defect_density: float = 0.0  # [1/m^2]: dislocations (forks and ends of crests) per area
    seed: int = 0  # of wander and dislocations, independent of the grid

    def __post_init__(self):
        for name, holds, expected in (
                ("wavelength", 0 < self.wavelength < np.inf, "a finite number [m] above 0"),
                ("height", 0 <= self.height < np.inf, "a finite number [m], at least 0"),
                ("asymmetry", 0 <= self.asymmetry < 1, "at least 0 and below 1"),
                ("sharpness", 0 <= self.sharpness <= 1, "from 0 to 1"),
                ("wander", 0 <= self.wander < np.inf, "a finite number [m], at least 0"),
                ("defect_density", 0 <= self.defect_density * self.wavelength**2 <= 1, "from 0 to 1 per wavelength^2")):
            check("ripples", name, getattr(self, name), holds, expected)
        check("ripples", "wander_length", self.wander_length, self._wander_length >= 2 * self.wander,
              f"at least twice the wander of {self.wander} m, or crests would overtake each other")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.asarray(x, float), np.asarray(y, float)
        crest = (1 + self.asymmetry) / 2
        cycles = along(self.heading, x, y) / self.wavelength + crest
        if self.wander:
            cycles += wander(self.seed, 0, x, y, rms=self.wander, length=self._wander_length) / self.wavelength
        strength = self._dislocate(cycles, x, y) if self.defect_density else 1.0
        fraction = cycles - np.floor(cycles)
        angle = np.pi * np.where(fraction < crest, fraction / crest - 1, (fraction - crest) / (1 - crest))
        power = 2 - self.sharpness
        mean = 1 - 2 * scipy.special.gamma((power + 1) / 2) / (np.sqrt(np.pi) * scipy.special.gamma(power / 2 + 1))
        return self.height / 2 * strength * (1 - 2 * np.abs(np.sin(angle / 2)) ** power - mean)

    @property
    def _wander_length(self) -> float:
        return 8 * self.wavelength if self.wander_length is None else self.wander_length

    def _dislocate(self, cycles: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Add the dislocations to ``cycles`` in place, and return the factor of the height at their cores."""
        strength = np.ones_like(cycles)
        d_x, d_y = step("x", x), step("y", y)
        for middle, half in self._pairs(x, y):
            reach = 2 * abs(half) * _REACH
            columns, rows = around(middle.real, reach, x, d_x), around(middle.imag, reach, y, d_y)
            place = x[columns] + 1j * y[rows, None] - middle
            if place.size == 0:
                continue
            # the angle jumps only between the two, by a whole cycle, which does not change the cross-section
            turns = np.angle((place - half) * (place + half).conj()) / (2 * np.pi)
            cycles[rows, columns] += turns * _fade((np.abs(place) - 1.5 * abs(half)) / (reach - 1.5 * abs(half)))
            for core in (half, -half):
                strength[rows, columns] *= -np.expm1(-(np.abs(place - core) / (_CORE * self.wavelength)) ** 2)
        return strength

    def _pairs(self, x: np.ndarray, y: np.ndarray) -> Iterator[tuple[complex, complex]]:
        """Yield the middle and half distance, complex x + iy [m], of the pairs that may affect the grid."""
        side, margin = _TILE * self.wavelength, _GAP[1] * _REACH * self.wavelength
        for generator, corner in tiles(self.seed, 1, x, y, side=side, margin=margin):
            count = generator.poisson(self.defect_density / 2 * side**2)
            place = generator.uniform(0, side, (count, 2)) + corner
            half = generator.uniform(*_GAP, count) / 2 * self.wavelength
            turn = generator.uniform(0, 2 * np.pi, count)
            yield from zip(place[:, 0] + 1j * place[:, 1], half * np.exp(1j * turn))


def _fade(share: np.ndarray) -> np.ndarray:
    """Return a smooth step from 1 (share <= 0) to 0 (share >= 1)."""
    share = np.clip(share, 0, 1)
    return 1 - share * share * (3 - 2 * share)
