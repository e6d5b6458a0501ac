"""Echoes spread on a grid of (row, column), on the device: the hot loop of the beam domain.

    G[r, n] += a k_u(r - u) k_t(n - t)                                                        [per echo: 4 x 4 taps]

a -> ``real``, ``imaginary``; u -> ``row``, t -> ``column``; k_u, k_t Kaiser-Bessel bells (`signal.bells`).

Echoes are added stripe by stripe of rows (`stripes`). As an echo reaches into the next stripe too, even stripes come
first, then odd ones. Echoes that stay in their row (k_u `impulses.Nearest`) have a stripe for each row. On a GPU the
sums are atomic, and their last bits vary.

Four taps along a row lie in two packets of four complex numbers, each aligned, which are added in one go.
"""
from __future__ import annotations

from collections.abc import Sequence
from types import ModuleType
from typing import Any, cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, held
from mitsonar.device.types import Array4f, Bool, DrJitArray, Float, UInt32

from ..impulses import Bell, Nearest, tap_weights
from .absorption import AbsorptionTerms
from .stripes import STRIPE, add_by_stripes, sorted_by_stripe

PACKET = 4                         # complex numbers that are added at once
MOST_NUMBERS = 1 << 32             # in an array of Dr.Jit


class GridSums:
    """Sums of echoes on a grid."""

    def __init__(self, like: DrJitArray | type, *, rows: int, columns: int, pitch: int, along: Bell,
                 across: Bell | Nearest, absorption: AbsorptionTerms | None = None):
        if 2 * rows * pitch >= MOST_NUMBERS:
            raise ValueError(f"a grid of {rows} rows and {pitch} samples takes {8 * rows * pitch / 2**30:.0f} GiB, "
                             f"and {4 * MOST_NUMBERS >> 30} is the limit; take fewer rows or a shorter record")
        self.lib = lib = arrays_of(like)
        self.along, self.across, self.absorption = along, across, absorption
        self.stripe = STRIPE if across.taps > 1 else 1
        self.stripes = -(-rows // self.stripe)
        self.on_cpu = dr.backend_v(lib.Float) == dr.JitBackend.LLVM
        whole = dict(packets=pitch // PACKET, nowhere=self.stripes, last=rows - 1)
        self.whole = {name: dr.opaque(lib.UInt32, value) for name, value in whole.items()}
        self.ends = {name: dr.opaque(lib.Float, value) for name, value in dict(rows=rows, columns=columns).items()}
        self.sums: Float = dr.zeros(lib.Float, 2 * rows * pitch)

    def add(self, row: Float, column: Float, real: Float, imaginary: Float) -> None:
        """Add echoes; echoes with taps off the grid or values that are not finite are ignored."""
        # row, column, real, imaginary (H,)
        lib = self.lib
        fields = [dr.detach(lib.Float(field)) for field in (row, column, real, imaginary)]
        count = max(dr.width(field) for field in fields)
        wrong = sorted({dr.width(field) for field in fields} - {1, count})
        if wrong:
            raise ValueError(f"fields of {count} echoes have {wrong[0]} values; give each as many as echoes, or one")
        if not count:
            return
        with dr.suspend_grad():
            inside = self._inside(*fields)
            if not self.on_cpu:
                self._spread(fields, inside)
                dr.eval(self.sums)
                return
            stripe = lib.UInt32(held(fields[0], 0, self.ends["rows"] - 1)) // self.stripe
            echoes, starts = sorted_by_stripe(dr.select(inside, stripe, self.whole["nowhere"]), self.stripes, fields)
            apart = min(self.across.taps, 2)
            for first in range(apart):
                # of stripes of which no two share a row
                add_by_stripes(lib, starts, np.arange(first, self.stripes, apart), lambda place: self._spread(
                    cast(Sequence[Any], dr.gather(lib.Array4f, echoes, place)), lib.Bool(True)))
                dr.eval(self.sums)

    def _inside(self, row: Float, column: Float, real: Float, imaginary: Float) -> Bool:
        """Return whether echoes lie on the grid; comparisons with NaN are false."""
        taps = self.across.taps
        inside = (row >= (taps - 1) // 2) & (row < self.ends["rows"] - taps // 2)
        inside &= (column >= 1) & (column < self.ends["columns"] - 2)
        return inside & (abs(real) < dr.inf) & (abs(imaginary) < dr.inf) & ((real != 0) | (imaginary != 0))

    # -- one echo ------------------------------------------------------------------------------------------------

    def _spread(self, fields: Sequence[Float] | Array4f, inside: Bool) -> None:
        """Add echoes that lie on the grid, with all their taps."""
        lib = self.lib
        row, column, real, imaginary = fields
        above, before = dr.floor(row), dr.floor(column)
        tap = lib.UInt32(held(before, 1, self.ends["columns"] - 3)) - 1
        offset = tap & (PACKET - 1)
        values = self._along(column, before, real, imaginary, offset)
        packet = lib.UInt32(held(above, 0, self.ends["rows"] - 1)) * self.whole["packets"] + tap // PACKET
        if self.across.taps > 1:
            packet -= self.whole["packets"]
        mode = dr.ReduceMode.NoConflicts if self.on_cpu else dr.ReduceMode.Auto
        for weight in tap_weights(lib, self.across, row - above):
            parts = [part * weight for part in values]
            for half, active in ((0, inside), (1, inside & (offset != 0))):
                there = parts[2 * PACKET * half:2 * PACKET * (half + 1)]
                dr.scatter_add(self.sums, lib.ArrayXf(there), packet + half, active=active, mode=mode)
            packet = packet + self.whole["packets"]

    def _along(self, column: Float, before: Float, real: Float, imaginary: Float, offset: UInt32) -> list[Float]:
        """Return the echo along its row: real and imaginary part by turns at the eight places of two packets."""
        lib = self.lib
        if self.absorption is None:
            places = _moved(lib, tap_weights(lib, self.along, column - before), offset)
            return [part * weight for weight in places for part in (real, imaginary)]
        taps = self.absorption.tap_weights(lib, self.along, column, column - before)
        cosines, sines = (_moved(lib, list(parts), offset) for parts in zip(*taps))
        return [part for cosine, sine in zip(cosines, sines)
                for part in (dr.fma(real, cosine, -imaginary * sine), dr.fma(real, sine, imaginary * cosine))]


def _moved(lib: ModuleType, taps: list[Float], offset: UInt32) -> list[Float]:
    """Put four taps into eight places, from place `offset` in 0..3 on."""
    nothing = lib.Float(0)
    places = [*taps, nothing, nothing, nothing, nothing]
    for bit in (1, 2):
        moved = (offset & bit) != 0
        places = [dr.select(moved, places[k - bit] if k >= bit else nothing, places[k]) for k in range(8)]
    return places
