"""Groups of patches that lie together: which patches of a scene may have a scatterer at all.

A patch has one where the number m that it needs exceeds its own threshold, a number drawn from 0 to 1 that stays the
same for all pings (`nested_points`). Far off a narrow lobe m is small, and few patches need a look. Patches are put in
order of a horizontal grid's cells, and in each cell of the octaves of their thresholds. The largest m of a cell says
how many octaves of it to take.
"""
from __future__ import annotations

import numpy as np

FEWEST = 1 << 17                   # patches for which groups are made
BLOCK = 1 << 19                    # patches whose groups are measured at once
CELLS, OCTAVES = 1 << 13, 8        # of a key of 16 bits, which NumPy sorts in linear time


class PatchGroups:
    """Groups of patches, which do not move."""
    # table (P, 8): centre [m], area [m²], unit normal, radius [m]; threshold (P,), least m with a scatterer; still (P,)

    def __init__(self, table: np.ndarray, threshold: np.ndarray, still: np.ndarray):
        x, y = (np.ascontiguousarray(table[:, axis]) for axis in (0, 1))
        cell = _cells(x, y)
        octave = np.clip(-np.frexp(np.maximum(threshold, 1e-30))[1], 0, OCTAVES - 1)       # threshold < 2^-octave
        key = (cell * OCTAVES + (OCTAVES - 1 - octave)).astype(np.uint16)
        self._patches, self._others = len(table), np.flatnonzero(~still)
        order = np.argsort(key, kind="stable").astype(np.uint32)
        self._order = order[still[order]] if len(self._others) else order
        count = np.bincount(key if len(self._order) == len(key) else key[self._order], minlength=CELLS * OCTAVES)
        ends = np.cumsum(count).reshape(-1, OCTAVES)
        begin = np.append(0, ends[:-1, -1])
        there = ends[:, -1] > begin
        self._begin, self._ends = begin[there], ends[there]
        parts = np.array_split(np.arange(len(self._begin)), -(-len(table) // BLOCK))
        boxes = [self._box(table, part) for part in parts if len(part)]
        low, high = (np.concatenate(ends).astype(float) for ends in zip(*boxes))
        self.area, radius = high[:, 3], high[:, 7]                                # (G,), largest [m²], [m]
        self.centre = 0.5 * (low[:, :3] + high[:, :3])                            # (G, 3) [m]
        self.radius = 0.5 * np.linalg.norm(high[:, :3] - low[:, :3], axis=1) + radius          # (G,) [m]
        self.normal = 0.5 * (low[:, 4:7] + high[:, 4:7])                          # (G, 3), middle of the normals
        self.spread = 0.5 * np.linalg.norm(high[:, 4:7] - low[:, 4:7], axis=1)    # (G,), how far they are from it

    def _box(self, table: np.ndarray, groups: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest numbers (G, 8) of patches in consecutive groups."""
        first = self._begin[groups[0]]
        rows = table[self._order[first:self._ends[groups[-1], -1]]]
        low, high = (limit.reduceat(rows, self._begin[groups] - first, axis=0) for limit in (np.minimum, np.maximum))
        return low, high

    def reaching(self, most: np.ndarray) -> np.ndarray:
        """Return the numbers, uint32, of patches whose threshold may lie below the `most` (G,) that their group needs.

        A group needs nothing where it is 0 or less. Numbers increase.
        """
        # patches of the octave k have thresholds of 2^-(k + 1) at least, those of the last octave any
        octaves = np.clip(-np.frexp(np.maximum(most, 1e-30))[1], 0, OCTAVES - 1)
        count = np.where(most > 0, self._ends[np.arange(len(most)), OCTAVES - 1 - octaves] - self._begin, 0)
        before = np.cumsum(count) - count
        place = np.arange(count.sum()) + np.repeat(self._begin - before, count)
        taken = np.zeros(self._patches, bool)
        taken[self._order[place]] = True
        taken[self._others] = True
        return np.flatnonzero(taken).astype(np.uint32)


def _cells(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the cells, int32 below `CELLS`, of a grid over places (P,)."""
    low, size = (x.min(), y.min()), np.maximum([np.ptp(x), np.ptp(y)], 1e-6).astype(float)
    edge = max(np.sqrt(size.prod() / CELLS), size.max() / CELLS)
    # one more in each direction than fit may be needed
    while np.prod(shape := np.floor(size / edge).astype(int) + 1) > CELLS:
        edge *= 1.02
    i, j = (np.minimum(((axis - begin) * np.float32(1 / edge)).astype(np.int32), count - 1)
            for axis, begin, count in zip((x, y), low, shape))
    return i * shape[1] + j
