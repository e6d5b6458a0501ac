"""Reject soundings that side lobes of the beams explain.

Through side lobes a beam receives the bed of other directions, as long and as coherent an echo as that of its own bed.
The beams themselves measure the intensities I_j of all other directions at the time of a sounding. P_ij -> power
pattern of beam i towards the axis of beam j, n_j -> beam spacing over beam width. Side lobes may bring

    4 sum_j P_ij I_j n_j over P_ij < 0.01

The factor 4 allows for the scatter of single pings. A sounding is of its own beam where the mean level [dB] of the
beams around, over five beam widths, is above that, since a single beam may fade or stand out by chance. A beam that is
not above it by itself also needs five widths to either side that are, else inner beams would confirm beams beyond an
edge. A weaker bed is indistinguishable from side lobes. The skirt of a main lobe at the edge of a bed passes;
`detection` rejects it by phase.
"""
from __future__ import annotations

import numpy as np
from scipy import ndimage

from .bottom_track import BottomEchoes

MARGIN = 4.0
AROUND = 5                         # beam widths over which beams decide together
HIGHEST = 0.01                     # of the pattern: nearer side lobes see much the same bed near normal incidence


def mean_between(echoes: BottomEchoes, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the mean intensities (J, B) [µPa²] of whole beams between times (B,) [s]."""
    blocks = echoes.power.shape[1]
    first = np.clip(((begin - echoes.start) / echoes.step).astype(int), 0, blocks - 1)
    last = np.clip(np.ceil((end - echoes.start) / echoes.step).astype(int), first + 1, blocks)
    # sums from one end of a span to the next end of any: some tenths of the blocks
    edges = np.unique([first, last])
    power, common = (np.add.reduceat(values[:, :edges[-1]], edges[:-1], axis=1)
                     for values in (echoes.power, echoes.common))
    total = np.zeros((len(power), len(edges)))
    np.cumsum(power + common, axis=1, out=total[:, 1:])
    sums = total[:, np.searchsorted(edges, last)] - total[:, np.searchsorted(edges, first)]
    return sums / (2 * (last - first))


def through_side_lobes(pattern: np.ndarray, intensity: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the largest level (B,) [µPa²] that side lobes may have brought."""
    # pattern (B, J); intensity (J, B) [µPa²]; share (J,)
    return MARGIN * np.where(pattern < HIGHEST, pattern * intensity.T, 0.0) @ share


def of_main_lobes(own: np.ndarray, brought: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return True for soundings of levels `own` (B,), ordered by beam, that are above those of side lobes `brought`."""
    tiny = np.finfo(float).tiny
    around = max(int(np.ceil(AROUND / np.median(share))), AROUND) | 1
    above = np.log(np.maximum(own, tiny) / np.maximum(brought, tiny))
    mean, beams, half = ndimage.uniform_filter1d(above, around, mode="nearest"), np.arange(len(own)), around // 2
    aside = [mean[np.clip(beams + step, min(half, len(own) - 1), max(len(own) - 1 - half, 0))]
             for step in (-half, half)]
    return (mean > 0) & ((above > 0) | (np.minimum(*aside) > 0))
