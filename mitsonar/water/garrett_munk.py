"""Internal waves of the deep sea as a field of sound speed: the spectrum of Garrett and Munk.

    dc = c_0(z - η) - c_0(z)
    η = √(N_0/N) Σ_m 2 a sin(π j_m ξ) cos(k_m·x - ω_m t + φ_m),    ξ = 1 - e^(-z/b),  N = N_0 e^(-z/b),  + down

    |k| = π j √(ω² - f²) / (b N_0),    j by 1/(j² + j*²),    ω by √(ω² - f²) / ω³ from f to N_0,    a² = E b² / 2M

f -> inertial frequency; N_0 = 5.2e-3 1/s, b = 1300 m, j* = 3, E = 6.3e-5 times ``level``: the canonical ocean of Munk
(1981, Internal waves and small-scale processes, in Evolution of Physical Oceanography, eq. 9.7 to 9.23), with modes by
WKB. M waves stand for equal parts of the spectrum over frequency and mode. So <η²> = E b² N_0 / 2N on average over
depth, 53 m² where N is N_0, and 0 at the surface. The displaced water keeps its sound speed: of c_0 that includes the
adiabatic gradient, 0.016 1/s, which a real displacement does not feel.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.device.types import Numbers

from .fields import SpeedAt, SpeedChange

BUOYANCY, SCALE, BANDWIDTH, ENERGY = 5.2e-3, 1300.0, 3, 6.3e-5     # N_0 [1/s], b [m], j*, E
EARTH = 7.292e-5                   # [rad/s]: rate of turn
WAVES, MODES = 32, 100
STREAM = 0x6A77                    # of chance
NEAREST_POLE = 0.01                # [rad]: least latitude, where f does not vanish


@dataclass(frozen=True, kw_only=True, eq=False)
class GarrettMunk:
    """Internal waves of the deep sea."""

    amplitude: Numbers  # [m]: a
    waves: tuple[tuple[Numbers, Numbers, Numbers, Numbers], ...]  # k east and north [rad/m], phase [rad], π j
    rates: tuple[float, ...]  # [rad/s]: ω
    surface: float = 0.0  # [m]: its height above depth 0

    @classmethod
    def of(cls, *, latitude: float, level: float = 1.0, seed: int = 0, waves: int = WAVES) -> GarrettMunk:
        """Return the waves at a latitude [rad], at a level of energy over that of the model."""
        inertial = 2 * EARTH * np.sin(max(abs(latitude), NEAREST_POLE))
        omega = np.geomspace(inertial, BUOYANCY, 20001)
        share = np.concatenate([[0.0], np.cumsum(_density(omega, inertial) * np.diff(omega))])
        mode = np.arange(1, MODES + 1)
        by_mode = np.cumsum(1 / (mode**2 + BANDWIDTH**2))
        rng = np.random.default_rng([seed, STREAM])
        # even over frequency and over modes, in orders that have nothing to do with each other
        first, second = ((rng.permutation(waves) + rng.random(waves)) / waves for _ in range(2))
        rate = np.interp(first, share / share[-1], omega)
        number = mode[np.searchsorted(by_mode / by_mode[-1], second)]
        k = np.pi * number * np.sqrt(rate**2 - inertial**2) / (SCALE * BUOYANCY)
        heading, phase = rng.uniform(0, 2 * np.pi, (2, waves))
        rows = np.stack([k * np.sin(heading), k * np.cos(heading), phase, np.pi * number], 1)
        return cls(amplitude=float(np.sqrt(level * ENERGY * SCALE**2 / (2 * waves))),
                   waves=tuple(tuple(row) for row in rows.tolist()), rates=tuple(rate.tolist()))

    @property
    def moves(self) -> bool:
        """Return True: the waves change with time, until they are taken at one."""
        return bool(self.rates)

    def at(self, time: float, start: float) -> GarrettMunk:
        """Return the field as it is at a time [s] of a track that begins at `start` [s]."""
        waves = tuple((east, north, float(np.mod(phase - rate * (time - start), 2 * np.pi)), mode)
                      for (east, north, phase, mode), rate in zip(self.waves, self.rates))
        return replace(self, waves=waves, rates=()) if self.rates else self

    def placed(self, frame: Frame | None, track: np.ndarray, start: float) -> GarrettMunk:
        """Return the field itself, which is everywhere."""
        return self

    def lifted(self, height: float) -> GarrettMunk:
        """Return the field of water whose surface lies `height` [m] above depth 0."""
        return replace(self, surface=height)

    def on_device(self, kind: type) -> GarrettMunk:
        """Return the field with opaque numbers."""
        return replace(self, amplitude=dr.opaque(kind, self.amplitude), waves=tuple(
            tuple(dr.opaque(kind, one) for one in wave) for wave in self.waves))

    def displacement(self, x: Numbers, y: Numbers, depth: Numbers) -> tuple[Numbers, Numbers, Numbers, Numbers]:
        """Return η [m] at places [m], and its derivatives east, north and down."""
        lib = np if isinstance(x, (np.ndarray, float)) else dr
        below = lib.maximum(depth + self.surface, 0.0)
        thinner = lib.exp(below * (-1 / SCALE))
        total = [0 * x + 0 * depth for _ in range(4)]
        for east, north, phase, mode in self.waves:
            psi, turn = east * x + north * y + phase, mode * (1 - thinner)
            across, sine, cosine = lib.sin(turn), lib.sin(psi), lib.cos(psi)
            total[0] = total[0] + across * cosine
            total[1] = total[1] - across * sine * east
            total[2] = total[2] - across * sine * north
            total[3] = total[3] + mode * thinner * lib.cos(turn) * cosine
        scale = 2 * self.amplitude / lib.sqrt(thinner)
        value, down = scale * total[0], scale * total[3] * (1 / SCALE)
        return value, scale * total[1], scale * total[2], down + value * (0.5 / SCALE)

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        displaced, east, north, down = self.displacement(x, y, depth)
        (there, slope), (here, own) = speed_at(depth - displaced), speed_at(depth)
        return SpeedChange(there - here, -slope * east, -slope * north, slope * (1 - down) - own)


def _density(omega: np.ndarray, inertial: float) -> np.ndarray:
    """Return √(ω² - f²) / ω³ in the middles of steps."""
    middle = 0.5 * (omega[1:] + omega[:-1])
    return np.sqrt(middle**2 - inertial**2) / middle**3
