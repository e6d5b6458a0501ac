"""Echoes in stripes of rows, each summed by one thread: bit-identical sums without atomic operations.

Echoes are put in order of their stripe by a stable sort of these small numbers (`ordered`). A stripe belongs to one
work block of Dr.Jit's LLVM backend, which is 16384 lanes whenever a launch has more than two blocks a thread; idle
blocks make sure that it has (`add_by_stripes`). So no two threads add to the same row, and the order of additions,
hence every bit of the result, depends on the echoes alone.

Sums of four numbers an echo in cells of a table (row, column), on the device, the same in every bit on the CPU.

    S[r, c] = Σ (a, b, c, d) of the echoes of the cell                                         one packet an echo
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, UInt32

STRIPE = 8                         # rows: 11 of 4000 columns stay in a core's cache
LANES = 1 << 14                    # of a work block: Dr.Jit's largest
ROUNDS = 16                        # echoes of a lane at least: fewer do not pay for its start
FEWEST_BUCKETS = 512               # for 4096 rows
NEIGHBOURS = 64                    # lanes that read neighbouring echoes, a multiple of every vector's width


def ordered(stripe: UInt32, stripes: int) -> tuple[UInt32, np.ndarray]:
    """Sort echoes by their stripes."""
    # stripe (H,) -> order (H,), starts (S,)
    lib, count = arrays_of(stripe), dr.width(stripe)
    buckets = max(FEWEST_BUCKETS, 1 << stripes.bit_length())        # few sizes: each is a kernel of its own
    counts = dr.zeros(lib.UInt32, buckets)
    dr.scatter_add(counts, lib.UInt32(1), stripe)
    dr.eval(stripe, counts)
    order = cast(Any, dr.detail.block_mkperm)(stripe, count, buckets)
    return order, np.concatenate([[0], np.cumsum(counts.numpy(), dtype=np.uint32)]).astype(np.uint32)


def add_by_stripes(lib: ArrayTypes, starts: np.ndarray, mine: np.ndarray, add: Callable[[UInt32], None]) -> None:
    """Add the echoes of some stripes in one launch."""
    # starts (S,); mine (M,)
    used = len(mine)
    if not used:
        return
    U = lib.UInt32
    first, last = upload(U, starts[mine]), upload(U, starts[mine + 1])
    groups, count = max(used, 2 * dr.thread_count() + 1), dr.opaque(U, used)
    lane = dr.arange(U, groups * LANES)
    group = lane // LANES
    lane -= group * LANES
    begin = dr.gather(U, first, group, group < count)
    end = dr.gather(U, last, group, group < count)
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


def cell_sums(cell: UInt32, inside: Bool, values: Sequence[Float], *, rows: int, columns: int) -> Float:
    """Sum values in cells."""
    # cell (H,); inside (H,); values (H,)
    lib = arrays_of(cell)
    sums = dr.zeros(lib.Float, 4 * rows * columns)
    if dr.backend_v(lib.Float) != dr.JitBackend.LLVM:
        dr.scatter_add(sums, lib.Array4f(*values), cell, inside)
        dr.eval(sums)
        return sums
    stripes = -(-rows // STRIPE)
    stripe = dr.select(inside, cell // dr.opaque(lib.UInt32, STRIPE * columns), dr.opaque(lib.UInt32, stripes))
    dr.eval(cell, list(values))
    order, starts = ordered(stripe, stripes)

    def add(place: UInt32) -> None:
        echo = dr.gather(lib.UInt32, order, place)
        dr.scatter_add(sums, lib.ArrayXf([dr.gather(lib.Float, value, echo) for value in values]),
                       dr.gather(lib.UInt32, cell, echo), mode=dr.ReduceMode.NoConflicts)

    add_by_stripes(lib, starts, np.arange(stripes), add)
    dr.eval(sums)
    return sums
