"""Blur of energies over beams and bins, as in an image: by side lobes of the beams and by the compressed pulse.

    shown[b, t] = Σ_b' M[b, b'] Σ_τ k[τ] E[b', t - τ],     M[b, b'] = mean over beam b' of |W(s' - s_b)|²,
    k a squared sinc of the pulse's bandwidth, of sum 1

M is kept where it exceeds the share `FAINTEST` of its maximum, and is scaled up by the part that is left out.

Both sums run on the host: M is a sparse matrix, whose product reads whole rows of bins.
"""
from __future__ import annotations

import numpy as np
from scipy import sparse

from mitsonar.sonar.arrays.array_factor import array_factor

PARTS = 4                          # directions in a beam over which the pattern is averaged
FAINTEST = 3e-5                    # share of the maximum of M below which M is left out
FINER = 16                         # oversampling of the table of the pattern
WIDEST = 48                        # largest number of beams to either side
HALF_POWER = 0.5
REACH = 3                          # bins to either side that the compressed pulse reaches
LEAST = np.finfo(np.float32).tiny  # smaller numbers have no inverse in 32 bits
ROWS = 16                          # beams whose bins are summed together: they stay in a core's cache


class Blur:
    """Blur of planes of energies."""
    # sines (B,) [-]; place (N,) [wavelengths]; weight (N,) [-]

    def __init__(self, sines: np.ndarray, place: np.ndarray, weight: np.ndarray, bandwidth_share: float):
        self.beams = len(sines)
        middle = 0.5 * (sines[1:] + sines[:-1])
        self.edges = np.concatenate([[2 * sines[0] - middle[0]], middle, [2 * sines[-1] - middle[-1]]])
        band = _band(sines, self.edges, place, weight)
        self.reach = band.shape[1] // 2
        middle = band[self.beams // 2]
        #: beams to either side within the half-power width of a beam
        self.lobe = int(np.abs(np.flatnonzero(middle > HALF_POWER * middle.max()) - self.reach).max())
        spread = np.sinc(bandwidth_share * np.arange(-REACH, REACH + 1)) ** 2
        self._spread = (spread / spread.sum()).astype(np.float32)
        place = np.indices(band.shape)
        beam, other = place[0], place[0] + place[1] - self.reach
        kept = (other >= 0) & (other < self.beams)
        self._mix = sparse.csr_array((band[kept].astype(np.float32), (beam[kept], other[kept])),
                                     shape=(self.beams, self.beams))

    def grown(self, box: tuple[int, int, int, int], bins: int) -> tuple[int, int, int, int]:
        """Return the box that the energies of a box reach: first beam, end of beams, first bin, end of bins."""
        b0, b1, t0, t1 = box
        return max(b0 - self.reach, 0), min(b1 + self.reach, self.beams), max(t0 - REACH, 0), min(t1 + REACH, bins)

    def shown(self, energy: np.ndarray, first_beam: int) -> np.ndarray:
        """Return the blurred energies, float32 (b, t), of energies (b, t) of the beams from `first_beam` on."""
        beams, bins = energy.shape
        mix = self._mix[first_beam:first_beam + beams, first_beam:first_beam + beams]
        mixed = mix @ np.ascontiguousarray(energy, np.float32)
        shown = np.empty_like(mixed)
        for first in range(0, beams, ROWS):
            wide, block = np.pad(mixed[first:first + ROWS], ((0, 0), (REACH, REACH))), shown[first:first + ROWS]
            np.multiply(wide[:, :bins], self._spread[0], out=block)
            for k, weight in enumerate(self._spread[1:], 1):
                block += weight * wide[:, k:k + bins]
            block[block < LEAST] = 0
        return shown


class OneBeam:
    """Blur of energies of a single beam, which resolves no sines: by the compressed pulse alone. See `Blur`."""

    beams, lobe = 1, 0

    def __init__(self, widest: float, bandwidth_share: float):
        self.edges = np.array([-widest, widest])
        spread = np.sinc(max(bandwidth_share, 1.0 / REACH) * np.arange(-REACH, REACH + 1)) ** 2
        # a bin longer than the pulse keeps its energy
        self._spread = np.array([1.0]) if bandwidth_share >= 1 else spread / spread.sum()

    def grown(self, box: tuple[int, int, int, int], bins: int) -> tuple[int, int, int, int]:
        """Return the box that the energies of a box reach."""
        aside = len(self._spread) // 2
        return 0, 1, max(box[2] - aside, 0), min(box[3] + aside, bins)

    def shown(self, energy: np.ndarray, first_beam: int) -> np.ndarray:
        """Return the blurred energies, float32 (1, t), of energies (1, t)."""
        return np.convolve(energy[0], self._spread, "same")[None, :energy.shape[1]].astype(np.float32)


def _band(sines: np.ndarray, edges: np.ndarray, place: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Return M as a band (B, 2 h + 1): column h + k of row b is M[b, b + k], 0 outside the fan."""
    beams = len(sines)
    half = min(WIDEST, beams - 1)
    share = (np.arange(PARTS) + 0.5) / PARTS
    # the pattern depends on the gap of sines alone: one table serves all beams
    widest = edges[-1] - edges[0]
    gaps = np.linspace(0, widest, int(np.ceil(FINER * 2 * np.ptp(place) * widest)) + 2)
    table = np.abs(array_factor(place, np.asarray(weight, float) / np.abs(weight).sum(), first=0, step=gaps[1],
                                count=len(gaps))) ** 2
    fine = edges[:-1, None] + np.diff(edges)[:, None] * share                                     # (B, parts)
    band = np.zeros((beams, 2 * half + 1))
    for k in range(-half, half + 1):
        b = np.arange(max(0, -k), beams - max(0, k))
        band[b, half + k] = np.interp(np.abs(fine[b + k] - sines[b, None]), gaps, table).mean(1)
    needed = int(np.abs(np.flatnonzero(band.max(0) > FAINTEST * band.max()) - half).max(initial=0))
    band = band[:, half - needed:half + needed + 1]
    # on an even bed, side lobes farther off add this to the middle beam
    middle = beams // 2
    total = float(np.interp(np.abs(fine - sines[middle]), gaps, table).mean(1).sum())
    return band * (total / band[middle].sum())
