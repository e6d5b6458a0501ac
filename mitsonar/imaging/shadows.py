"""Shadow and label of the bins of a picture: one rule for all kinds of sonar.

A bin is in shadow if it lies in a gap, in which nothing arrives by the main lobe, after the bed's first return in its
row. A shorter stretch without echoes is no gap:

    least length of a gap = max(pulse length / bin length, FEWEST / n)

The picture does not resolve less than a pulse. n -> mean number of echoes in those bins of the row that have any: a gap
in which fewer than `FEWEST` of them are expected may be chance. The beam's width is in the count: a row counts all
echoes within its main lobe, those of the beams beside it, too, if beams are closer than they are wide.

The first return is the first bin that sees the bed, or that lies in the shadow of an object which the row has received
before: an object in the water throws no shadow on the water behind it. A ping that sees no bed begins with its first
echo. ``object_shadow`` names the object that hides the bed, and also holds where other echoes fill the shadow.

A bin in which nothing arrives by the main lobe has no label, in shadow or not: only side lobes bring echoes there.
"""
from __future__ import annotations

import numpy as np

from .energy_record import EnergyRecord

FEWEST = 7.0                       # echoes expected in a gap: one in exp(7) = 1,100 such gaps is chance
WORK = 1 << 18                     # bins at a time


def labels_of(record: EnergyRecord) -> np.ndarray:
    """Return the labels (ping, ..., bins) of a record, uint32."""
    return np.where(record.echoes_in_beam > 0, record.truth.label, np.uint32(0))


def shadows_of(record: EnergyRecord, *, bin_length: float, pulse_length: float) -> np.ndarray:
    """Return the shadows (ping, ..., bins) of a record, uint8: 1 in shadow; from two lengths [s]."""
    echoes, known = record.echoes_in_beam, record.truth
    shadow = np.empty(echoes.shape, np.uint8)
    step = max(1, WORK * len(shadow) // max(shadow.size, 1))
    for start in range(0, len(shadow), step):
        block = slice(start, start + step)
        arrives = echoes[block] > 0
        seen = np.isfinite(known.seabed_place[block, ..., 0])
        seen |= np.logical_or.accumulate(arrives, -1) & (known.object_shadow[block] > 0)
        seen |= arrives & ~seen.any(tuple(range(1, seen.ndim)), keepdims=True)
        mean = echoes[block].sum(-1, keepdims=True) / np.maximum(arrives.sum(-1, keepdims=True), 1)
        gap = _gaps(arrives, np.maximum(FEWEST / np.maximum(mean, 1), round(pulse_length / bin_length)))
        shadow[block] = gap & np.logical_or.accumulate(seen, -1)
    return shadow


def _gaps(arrives: np.ndarray, shortest: np.ndarray) -> np.ndarray:
    """Return True for the bins of gaps that are at least ``shortest`` bins long, of each row."""
    bins = arrives.shape[-1]
    number = np.arange(bins, dtype=np.int32)
    before = np.maximum.accumulate(np.where(arrives, number, np.int32(-1)), -1)
    behind = np.minimum.accumulate(np.where(arrives, number, np.int32(bins))[..., ::-1], -1)[..., ::-1]
    return ~arrives & (behind - before - 1 >= shortest)
