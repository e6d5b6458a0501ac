"""Levels that side lobes bring to beams, and soundings that stand out of them.

Where no bed lies in its main lobe, a beam still receives the bed that other beams look at, through side lobes. That
echo is as long, and as coherent, as one of a bed of its own. At the time of a sounding the beams themselves say how
strong echoes are from all other directions, I_j. With P_ij the power pattern of beam i towards the axis of beam j, 0
within the main lobe, and n_j the share of a beam's width that lies between the axes, side lobes may have brought

    4 sum_j P_ij I_j n_j over P_ij < 0.01

4 because levels of single pings scatter. A sounding is of its own beam where the levels of the beams around, over five
widths of a beam, are on average (of dB) above that: one beam alone may fade, or stand out, by chance. At an edge the
beams within would vouch for those beyond. So a beam that is not above it by itself needs five widths to either side
that are. A bed that is weaker cannot be told from side lobes. What the skirt of a main lobe receives at the edge of a
bed stands out of them; detection tells by its phase that it comes from beside the axis (`detection`).
"""
from __future__ import annotations

import numpy as np
from scipy import ndimage

from .bottom_track import BottomEchoes

MARGIN = 4.0
AROUND = 5                         # widths of a beam over which beams decide together
HIGHEST = 0.01                     # of the pattern: nearer side lobes hear much the same bed near normal incidence


def mean_between(echoes: BottomEchoes, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the mean intensities (J, B) [µPa²] of J beams between times (B,) [s]."""
    whole = (echoes.power + echoes.common) / 2
    total = np.concatenate([np.zeros((len(whole), 1)), np.cumsum(whole, axis=1)], axis=1)
    blocks = whole.shape[1]
    first = np.clip(((begin - echoes.start) / echoes.step).astype(int), 0, blocks - 1)
    last = np.clip(np.ceil((end - echoes.start) / echoes.step).astype(int), first + 1, blocks)
    return (total[:, last] - total[:, first]) / (last - first)


def through_side_lobes(pattern: np.ndarray, intensity: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return the level (B,) [µPa²] that side lobes may have brought."""
    # pattern (B, J); intensity (J, B) [µPa²]; share (J,)
    return MARGIN * np.where(pattern < HIGHEST, pattern * intensity.T, 0.0) @ share


def of_main_lobes(own: np.ndarray, brought: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return where soundings of levels `own` (B,), in the order of beams, are above what side lobes brought (B,)."""
    tiny = np.finfo(float).tiny
    around = max(int(np.ceil(AROUND / np.median(share))), AROUND) | 1
    above = np.log(np.maximum(own, tiny) / np.maximum(brought, tiny))
    mean, beams, half = ndimage.uniform_filter1d(above, around, mode="nearest"), np.arange(len(own)), around // 2
    aside = [mean[np.clip(beams + step, min(half, len(own) - 1), max(len(own) - 1 - half, 0))]
             for step in (-half, half)]
    return (mean > 0) & ((above > 0) | (np.minimum(*aside) > 0))
