"""Weed: patches of another strength, of irregular outline and with soft edges; drawn out, they are ribbons.

    σ(x) = σ [1 + f(x) (w - 1)],      f = Φ((n(x) - t) / e),      t = -√(1 + e²) Φ⁻¹(cover):   <f> = cover

Φ is the normal distribution function, w -> ``strength`` [-] of weed relative to the bed's. The field n has the normal
distribution N(0, 1) at every place, because its weights have the square sum 1:

    n = Σ_o q_o n_o / √(Σ_o q_o²),      q_o = 2^-o,      n_o = Σ_ij c_i(x) c_j(y) z_ij,      c = cos or sin of (π/2) S

over the corners of squares of the side ``size`` / 2^o, of which each octave o has its own, turned ones; z_ij are hashed
normal numbers, S = t² (3 - 2 t) at the share t of a side. The mean square of the slope of n_o is (3/5) π² / side². An
edge that goes from f = 0.1 to 0.9 over the width v -> ``edge`` [m] on average therefore has e = v √<|∇n|²> / 2.56.

Along ``heading`` a patch is ``stretch`` times as long as it is wide. Nothing is stored, so a bed may have any size, and
every element, ping, run and kind of sonar meets the same weed.
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import numpy as np
import scipy

from mitsonar.device.chance import Salt, gaussian, hashed_pair
from mitsonar.device.types import ArrayTypes, Float

OCTAVES, TURN = 3, 0.7             # TURN [rad]: from the squares of one octave to those of the next
EDGE_QUANTILE = 2.563              # from 0.1 to 0.9 of the normal distribution, standard deviations
SHARPEST = 1e-4                    # e of an edge of width 0


@dataclass(frozen=True, kw_only=True)
class Weed:
    """Patches of weed or another cover."""

    cover: float  # share of the bed, 0 to 1 without either end
    strength: float  # w [-]
    size: float  # [m]
    edge: float = 0.0  # [m]
    stretch: float = 1.0
    heading: float = 0.0  # [rad], clockwise from north

    def __post_init__(self) -> None:
        if not 0 < self.cover < 1:
            raise ValueError(f"weed_cover is {self.cover}; it must lie between 0 and 1.")
        if not (self.size > 0 and self.edge >= 0 and self.stretch >= 1 and self.strength >= 0):
            raise ValueError(f"weed has the size {self.size} m, edges of {self.edge} m, the stretch {self.stretch} and "
                             f"the strength {self.strength}; give a size above 0, edges and a strength of 0 or more, "
                             "and a stretch of 1 or more.")

    @property
    def sharpness(self) -> float:
        """Return e [-]."""
        share = 4.0 ** -np.arange(OCTAVES)
        square = 0.3 * np.pi ** 2 * (1 + self.stretch ** -2) * OCTAVES / share.sum() / self.size ** 2
        return max(self.edge * np.sqrt(square) / EDGE_QUANTILE, SHARPEST)

    def on(self, lib: ArrayTypes) -> WeedField:
        """Return the weed as a field on the device."""
        return WeedField(self, lib)


class WeedField:
    """Strength of a bed with weed relative to the bed without, at places."""

    def __init__(self, weed: Weed, lib: ArrayTypes):
        self._lib = lib
        across = np.array([np.cos(weed.heading), -np.sin(weed.heading)]) / weed.size
        along = np.array([np.sin(weed.heading), np.cos(weed.heading)]) / (weed.size * weed.stretch)
        self._per_metre = [[dr.opaque(lib.Float, float(part)) for part in row] for row in (across, along)]
        sharp = weed.sharpness
        self._threshold, self._steep, self._gain = (dr.opaque(lib.Float, float(value)) for value in (
            -np.sqrt(1 + sharp ** 2) * scipy.special.ndtri(weed.cover), np.sqrt(0.5) / sharp, weed.strength - 1))

    def share(self, x: Float, y: Float) -> Float:
        """Return f [-], Float (R,), at places x, y [m] Float (R,)."""
        return 0.5 * (1 + dr.erf((self._field(x, y) - self._threshold) * self._steep))

    def at(self, x: Float, y: Float) -> Float:
        """Return 1 + f (w - 1), Float (R,), at places x, y [m] Float (R,)."""
        return 1 + self.share(x, y) * self._gain

    def _field(self, x: Float, y: Float) -> Float:
        """Return n at places [m]."""
        u, v = (row[0] * x + row[1] * y for row in self._per_metre)
        total = self._lib.Float(0)
        for octave in range(OCTAVES):
            turn = (octave + 1) * TURN
            cosine, sine = float(np.cos(turn)), float(np.sin(turn))
            scale = 2.0 ** octave
            total += self._octave((cosine * u - sine * v) * scale, (sine * u + cosine * v) * scale, octave) / scale
        return total / float(np.sqrt((4.0 ** -np.arange(OCTAVES)).sum()))

    def _octave(self, u: Float, v: Float, octave: int) -> Float:
        """Return n_o at places in units of the squares' side."""
        lib, total = self._lib, self._lib.Float(0)
        corner = dr.floor(u), dr.floor(v)
        weights = []
        for place, low in zip((u, v), corner):
            part = place - low
            sine, cosine = dr.sincos((0.5 * np.pi) * part * part * (3 - 2 * part))
            weights.append((cosine, sine))
        i, j = (lib.UInt32(lib.Int32(low)) for low in corner)
        for right in (0, 1):
            for up in (0, 1):
                bits = hashed_pair(lib, i + right, j + up, lib.UInt32(Salt.WEED + octave))
                total += weights[0][right] * weights[1][up] * (float(np.sqrt(2)) * gaussian(lib, *bits)[0])
        return total
