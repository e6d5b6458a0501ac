"""Sand ripples: a train of crests with a cross-section, wandering crest lines and dislocations.

    cycles   q = u / wavelength + wander / wavelength + dislocations + c,   f = q - floor(q)
    angle    t = pi (f / c - 1) up the stoss side (f < c),   pi (f - c) / (1 - c) down the lee
             c = (1 + asymmetry) / 2
    height   h = (height / 2) (1 - 2 |sin(t / 2)|^m - mean),   m = 2 - sharpness

u -> metres along ``heading``. A dislocation adds one cycle to the phase on the way round it: a crest ends or forks
there. They come in pairs of opposite sense, so that each is felt only near by, and the height fades at its core.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import gamma

from .relief import Relief, along, check, step

_WAVES = 64            # plane waves that make up the wander of the crests
_TILE = 16             # wavelengths; the pairs of a tile follow from the seed and the tile's place
_GAP = (2.0, 5.0)      # wavelengths between the two dislocations of a pair, shortest and longest
_REACH = 2.0           # gaps from a pair's middle to where its phase has faded to nothing
_CORE = 0.5            # wavelengths over which the height fades at a dislocation


@dataclass(frozen=True, kw_only=True)
class Ripples(Relief):
    """A field of sand ripples; all defaults give a sinusoid with a crest at the origin.

    Parameters
    ----------
    wavelength : float [m]
    height : float [m]
        From trough to crest.
    heading : float [rad]
        Compass heading at right angles to the crests, the way the steep sides face.
    asymmetry : float [-]
        0 for equal sides, towards 1 for a vertical lee: the stoss side takes the share (1 + asymmetry) / 2.
    sharpness : float [-]
        0 for sinusoidal, 1 for pointed crests between rounded troughs.
    wander : float [m]
        Root-mean-square displacement of the crests along ``heading``.
    wander_length : float [m], optional
        Distance over which the crests wander; 8 wavelengths by default, and at least twice ``wander``.
    defect_density : float [1/m^2]
        Dislocations (forks and ends of crests) per area.
    seed : int
        Realisation of wander and dislocations, independent of the grid.
    """

    wavelength: float
    height: float
    heading: float = 0.0
    asymmetry: float = 0.0
    sharpness: float = 0.0
    wander: float = 0.0
    wander_length: float | None = None
    defect_density: float = 0.0
    seed: int = 0

    def __post_init__(self):
        for name, holds, expected in (
                ("wavelength", 0 < self.wavelength < np.inf, "a finite number [m] above 0"),
                ("height", 0 <= self.height < np.inf, "a finite number [m], at least 0"),
                ("asymmetry", 0 <= self.asymmetry < 1, "at least 0 and below 1"),
                ("sharpness", 0 <= self.sharpness <= 1, "from 0 to 1"),
                ("wander", 0 <= self.wander < np.inf, "a finite number [m], at least 0"),
                ("defect_density", 0 <= self.defect_density * self.wavelength**2 <= 1, "from 0 to one a wavelength^2")):
            check("ripples", name, getattr(self, name), holds, expected)
        check("ripples", "wander_length", self.wander_length, self._wander_length >= 2 * self.wander,
              f"at least twice the wander of {self.wander} m, or crests would overtake each other")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Return the heights (Y, X) [m] of the ripples."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        crest = (1 + self.asymmetry) / 2
        cycles = along(self.heading, x, y) / self.wavelength + crest
        if self.wander:
            cycles += self._wander(x, y) / self.wavelength
        strength = self._dislocate(cycles, x, y) if self.defect_density else 1.0
        fraction = cycles - np.floor(cycles)
        angle = np.pi * np.where(fraction < crest, fraction / crest - 1, (fraction - crest) / (1 - crest))
        power = 2 - self.sharpness
        mean = 1 - 2 * gamma((power + 1) / 2) / (np.sqrt(np.pi) * gamma(power / 2 + 1))
        return self.height / 2 * strength * (1 - 2 * np.abs(np.sin(angle / 2)) ** power - mean)

    @property
    def _wander_length(self) -> float:
        return 8 * self.wavelength if self.wander_length is None else self.wander_length

    def _wander(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        # A sum of plane waves needs no grid: e^(i(kx x + ky y)) is an outer product.
        generator = np.random.default_rng([self.seed, 0])
        k_x, k_y = generator.standard_normal((2, _WAVES)) / self._wander_length
        phase = generator.uniform(0, 2 * np.pi, _WAVES)
        rows = np.exp(1j * (y[:, None] * k_y + phase))
        columns = np.exp(1j * k_x[:, None] * x)
        return self.wander * np.sqrt(2 / _WAVES) * (rows @ columns).real

    def _dislocate(self, cycles: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Add the dislocations to ``cycles`` in place; give the factor by which the height fades at their cores."""
        strength = np.ones_like(cycles)
        d_x, d_y = step("x", x), step("y", y)
        for middle, half in self._pairs(x, y):
            reach = 2 * abs(half) * _REACH
            columns, rows = _around(middle.real, reach, x, d_x), _around(middle.imag, reach, y, d_y)
            place = x[columns] + 1j * y[rows, None] - middle
            if place.size == 0:
                continue
            # The angle jumps by one whole cycle between the two, which the cross-section does not see, nowhere else.
            turns = np.angle((place - half) * (place + half).conj()) / (2 * np.pi)
            cycles[rows, columns] += turns * _fade((np.abs(place) - 1.5 * abs(half)) / (reach - 1.5 * abs(half)))
            for core in (half, -half):
                strength[rows, columns] *= -np.expm1(-(np.abs(place - core) / (_CORE * self.wavelength)) ** 2)
        return strength

    def _pairs(self, x: np.ndarray, y: np.ndarray) -> Iterator[tuple[complex, complex]]:
        """Return middle and half distance, complex x + iy [m], of the pairs whose reach may touch the grid."""
        side, margin = _TILE * self.wavelength, _GAP[1] * _REACH * self.wavelength
        for row in range(int((y[0] - margin) // side), int((y[-1] + margin) // side) + 1):
            for column in range(int((x[0] - margin) // side), int((x[-1] + margin) // side) + 1):
                # Seeds must not be negative: an offset no bed reaches.
                generator = np.random.default_rng([self.seed, 1, row + 2**40, column + 2**40])
                count = generator.poisson(self.defect_density / 2 * side**2)
                place = generator.uniform(0, side, (count, 2)) + (column * side, row * side)
                half = generator.uniform(*_GAP, count) / 2 * self.wavelength
                turn = generator.uniform(0, 2 * np.pi, count)
                yield from zip(place[:, 0] + 1j * place[:, 1], half * np.exp(1j * turn))


def _around(middle: float, reach: float, axis: np.ndarray, step_length: float) -> slice:
    low, high = np.ceil((middle - reach - axis[0]) / step_length), np.floor((middle + reach - axis[0]) / step_length)
    return slice(max(int(low), 0), max(min(int(high) + 1, axis.size), 0))


def _fade(share: np.ndarray) -> np.ndarray:
    """Return 1 up to share 0, a smooth step to 0 at share 1, and 0 beyond."""
    share = np.clip(share, 0, 1)
    return 1 - share * share * (3 - 2 * share)
