"""Echoes in stripes of rows, each summed by one thread: bit-identical sums without atomic operations.

Echoes are put in order of their stripe by a stable sort of these small numbers (`sorted_by_stripe`). A stripe belongs
to one work block of Dr.Jit's LLVM backend, which is 16384 lanes whenever a launch has more than two blocks a thread;
idle blocks make sure that it has (`add_by_stripes`). So no two threads add to the same row, and the order of additions,
hence every bit of the result, depends on the echoes alone.

Sums of four numbers an echo in cells of a table (row, column), on the device, the same in every bit on the CPU.

    S[r, c] = Σ (a, b, c, d) of the echoes of the cell                                         one packet an echo

Whole numbers of cells, such as counts, are added in the same pass: the cell is in the cache, and any order will do.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, reinterpreted, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, UInt32

STRIPE = 8                         # rows: 11 of 4000 columns stay in a core's cache
LANES = 1 << 14                    # of a work block: Dr.Jit's largest
ROUNDS = 16                        # echoes of a lane at least: fewer do not pay for its start
FEWEST_BUCKETS = 512               # for 4096 rows
NEIGHBOURS = 64                    # lanes that read neighbouring echoes, a multiple of every vector's width


def sorted_by_stripe(stripe: UInt32, stripes: int, fields: Sequence[Float | UInt32]) -> tuple[Float, np.ndarray]:
    """Return the bits of four or eight fields of echoes side by side, in order of their stripes.

    Side by side, an echo is read in one go; in order, the next ones are in the cache already.
    """
    # stripe (H,); fields (H,) -> echoes (fields H,), starts (S,)
    lib, count, size = arrays_of(stripe), dr.width(stripe), len(fields)
    buckets = max(FEWEST_BUCKETS, 1 << stripes.bit_length())        # few sizes: each is a kernel of its own
    counts, unsorted = dr.zeros(lib.UInt32, buckets), dr.empty(lib.Float, size * count)
    lane = dr.arange(lib.UInt32, count)
    dr.scatter(unsorted, lib.ArrayXf([reinterpreted(lib.Float, field) for field in fields]), lane)
    dr.eval(stripe, unsorted)
    dr.scatter_add(counts, lib.UInt32(1), stripe)
    order = cast(Any, dr.detail.block_mkperm)(stripe, count, buckets)
    echoes = dr.empty(lib.Float, size * count)
    dr.scatter(echoes, dr.gather(lib.ArrayXf, unsorted, order, shape=(size, count)), lane)
    dr.eval(echoes, counts)
    return echoes, np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.uint32)]).astype(np.uint32)


def add_by_stripes(lib: ArrayTypes, starts: np.ndarray, mine: np.ndarray, add: Callable[[UInt32], None]) -> None:
    """Add the echoes of some stripes in one launch."""
    # starts (S,); mine (M,)
    used = len(mine)
    if not used:
        return
    U, least = lib.UInt32, 2 * dr.thread_count() + 1
    first, last = starts[mine], starts[mine + 1]
    most, lanes = int((last - first).max()), LANES
    # stripes of few echoes share a block, as long as every thread has some
    while lanes > max(NEIGHBOURS, 2 * most // ROUNDS) and used * lanes >= 2 * least * LANES:
        lanes //= 2
    width, count = dr.opaque(U, lanes.bit_length() - 1), dr.opaque(U, used)
    lane = dr.arange(U, max(-(-used * lanes // LANES), least) * LANES)
    group = lane >> width
    lane -= group << width
    # one number more: a gather from a single one would be another kernel
    begin, end = (dr.gather(U, upload(U, np.append(stripes, stripes[:1])), group, group < count)
                  for stripes in (first, last))
    # a bundle of lanes takes a stretch of echoes, lane by lane
    stretch = NEIGHBOURS * dr.maximum((end - begin + (LANES - 1)) // LANES, ROUNDS)
    bundle = lane // NEIGHBOURS
    begin += bundle * stretch
    end = dr.minimum(begin + stretch, end)
    step = dr.opaque(U, NEIGHBOURS)

    def turn(place: UInt32) -> tuple[UInt32]:
        add(place)
        return place + step,

    looped((begin + lane - bundle * NEIGHBOURS,), lambda place: place < end, turn, "echoes")


def cell_sums(cell: UInt32, row: UInt32, inside: Bool, values: Sequence[Float], *, rows: int, columns: int,
              word: UInt32, count: Callable[[UInt32, UInt32, Bool], None]) -> Float:
    """Sum four values of echoes in cells; `count(cell, word, inside)` adds the echoes' whole numbers, in any order."""
    # cell, row, inside, word (H,); values 4 x (H,) -> (4 rows columns,)
    lib = arrays_of(cell)
    sums = dr.zeros(lib.Float, 4 * rows * columns)
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        dr.scatter_add(sums, lib.Array4f(*values), cell, inside)
        count(cell, word, inside)
        dr.eval(sums)
        return sums
    stripes = -(-rows // STRIPE)
    stripe = dr.select(inside, row // STRIPE, dr.opaque(lib.UInt32, stripes))
    none = lib.UInt32(0)
    echoes, starts = sorted_by_stripe(stripe, stripes, [*values, cell, word, none, none])

    def add(place: UInt32) -> None:
        *values, there, word, _, _ = dr.gather(lib.ArrayXf, echoes, place, shape=(8, dr.width(place)))
        there = reinterpreted(lib.UInt32, there)
        dr.scatter_add(sums, lib.ArrayXf(values), there, mode=dr.ReduceMode.NoConflicts)
        count(there, reinterpreted(lib.UInt32, word), lib.Bool(True))

    add_by_stripes(lib, starts, np.flatnonzero(np.diff(starts[:stripes + 1])), add)
    dr.eval(sums)
    return sums
