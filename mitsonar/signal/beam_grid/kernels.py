"""Steps between transforms, each a kernel on the device: from rows to frequencies, through the line, to beams.

Complex arrays are real and imaginary parts by turns. Sizes are opaque: a new one makes no new kernel. Two
neighbouring rows, or waves, are read or written at once, which takes half as many loads.

    by_frequency        Z[f, r] = P_r(f) G[r, f] + noise of rows
    through_the_line    Z[f, ν] = Ŵ_f(ν) Z[f, ν] + noise of waves
    by_record           Z[r, f] of rows near beams; if beams are fewer, B[b, f] = Σ_k k_u(...) Z[f, r_b + k]
    by_beam             B[b, t] = Σ_k k_u(...) Z[r_b + k, t]                                         4 taps of a beam
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, upload
from mitsonar.device.types import ArrayTypes, Bool, Float, UInt32

from .noise import random_phases
from .pulse_response import RowTransfers
from .transforms import TILE, divided, tiles

FEWER = 0.8                        # rows for a beam, below which records of rows are transformed, not those of beams
TOGETHER = 32                      # rows or pairs of samples that a lane follows


@dataclass(frozen=True, kw_only=True, eq=False)
class Sizes:
    """Sizes of a grid and its spectra."""

    rows: int  # number of rows of the grid
    length: int  # number of columns of the grid
    period: int  # number of rows of a period
    used: UInt32  # (U,): numbers of the waves over the rows of beams

    @property
    def frequencies(self) -> int:
        """Return the number F of frequencies."""
        return dr.width(self.used)


@dataclass(frozen=True, kw_only=True, eq=False)
class Noise:
    """Noise that is drawn on the grid."""

    key: int
    row: Float  # (R,): root of the power of rows
    frequency: Float  # (F,): the replica's size
    taps: tuple[float, float]  # bell at its middle, and a row off


@dataclass(frozen=True, eq=False)
class Waves:
    """The waves that an aperture passes, and its pattern."""

    taken: UInt32  # (U/2,): numbers of the pairs of waves over the rows of echoes
    used: UInt32  # (U/2,): numbers of the pairs of waves over the rows of beams
    line: Float  # (F, U): its pattern, complex


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """Rows and taps from which beams are read, from spectra or from records, whichever takes fewer transforms."""

    first: int  # number of the first row that is read
    count: int  # number of rows from there to the last
    rows: UInt32  # (B, 4), counted from the first
    taps: Float  # (B, 4)
    turns: list[Float | None]  # (B,), complex: what beams of each aperture are multiplied by

    @property
    def beams(self) -> int:
        """Return the number B of beams."""
        return dr.width(self.taps) // 4

    @property
    def of_spectra(self) -> bool:
        """Return True if beams are read from spectra of the rows, not from their records."""
        return self.count > FEWER * self.beams

    @property
    def records(self) -> int:
        """Return the number of records of an aperture: beams, or rows that beams are read from."""
        return self.beams if self.of_spectra else self.count


def by_frequency(spectra: Float, sizes: Sizes, transfers: RowTransfers, noise: Noise | None) -> Float:
    """Multiply spectra (rows, length) by the rows' transfer functions: (F, period); other rows are 0."""
    lib, U = arrays_of(spectra), arrays_of(spectra).UInt32
    rows, period, length, more = (dr.opaque(U, size) for size in (sizes.rows, sizes.period // 2, sizes.length, 1))
    number, part = tiles(lib, sizes.frequencies, -(-sizes.rows // TOGETHER))
    column, first = dr.gather(U, sizes.used, number), part * TOGETHER
    last, into = dr.minimum(first + TOGETHER, rows), dr.zeros(lib.Float, 2 * sizes.frequencies * sizes.period)
    transfer = _transfer(lib, transfers, number)
    drawn = None if noise is None else _RowNoise(lib, noise, sizes, number)

    def turn(row: UInt32, *around: Float) -> tuple:
        pair: list[Float] = []
        for here in (row, row + more):
            there = here < rows
            z = _complex(lib, spectra, here * length + column, there) * transfer(here, there)
            if drawn is not None:
                around += drawn.of(here + more)
                z += drawn.summed(around)
                around = around[3:]
            pair += z.real, z.imag
        dr.scatter(into, lib.Array4f(*pair), number * period + row // 2)
        return row + 2 * more, *around

    # a lane follows its rows one by one: each row's noise is drawn once for itself and both neighbours
    looped((first, *(() if drawn is None else (*drawn.of(U(lib.Int32(first) - 1)), *drawn.of(first)))),
           lambda row, *_: row < last, turn, "rows")
    return into


def through_the_line(spectra: Float, sizes: Sizes, period: int, waves: Waves, noise: Float | None, key: int) -> Float:
    """Multiply spectra (F, sizes.period) over waves by the line's pattern at those used: (F, period), all others 0.

    `noise` (F, U) is the root of the power of what is drawn under `key` and added.
    """
    lib, U = arrays_of(spectra), arrays_of(spectra).UInt32
    lane = dr.arange(U, sizes.frequencies * dr.width(waves.used))
    number, wave = divided(lib, lane, dr.width(waves.used))
    place = number * dr.opaque(U, sizes.period // 2) + dr.gather(U, waves.taken, wave)
    z, line = dr.gather(lib.Array4f, spectra, place), dr.gather(lib.Array4f, waves.line, lane)
    z = [lib.Complex2f(z[k], z[k + 1]) * lib.Complex2f(line[k], line[k + 1]) for k in (0, 2)]
    if noise is not None:
        drawn, size = random_phases(lib, lane, dr.opaque(U, key), 2), dr.gather(lib.Array2f, noise, lane)
        z = [z[k] + lib.Complex2f(drawn[2 * k], drawn[2 * k + 1]) * size[k] for k in (0, 1)]
    into = dr.zeros(lib.Float, 2 * sizes.frequencies * period)
    dr.scatter(into, lib.Array4f(z[0].real, z[0].imag, z[1].real, z[1].imag),
               number * dr.opaque(U, period // 2) + dr.gather(U, waves.used, wave))
    return into


def by_record(spectra: Float, sizes: Sizes, period: int, reading: Reading, into: Float, aperture: int) -> None:
    """Put the beams of an aperture, or the rows that they are read from, of spectra (F, period) `into` (A, R, length).
    """
    lib, U = arrays_of(spectra), arrays_of(spectra).UInt32
    number, record = tiles(lib, sizes.frequencies, reading.records)
    begin = number * dr.opaque(U, period) + dr.opaque(U, reading.first)
    if reading.of_spectra:
        value = lib.Array2f(0)
        for row, tap in zip(dr.gather(lib.Array4u, reading.rows, record), dr.gather(lib.Array4f, reading.taps, record)):
            value = dr.fma(dr.gather(lib.Array2f, spectra, begin + row), tap, value)
        if (turn := reading.turns[aperture]) is not None:
            turned = lib.Complex2f(value[0], value[1]) * _complex(lib, turn, record)
            value = lib.Array2f(turned.real, turned.imag)
    else:
        value = dr.gather(lib.Array2f, spectra, begin + record)
    record = record + dr.opaque(U, aperture * reading.records)
    dr.scatter(into, value, record * dr.opaque(U, sizes.length) + dr.gather(U, sizes.used, number))
    dr.eval(into)


def by_beam(records: Float, sizes: Sizes, reading: Reading, begin: int, samples: int) -> Float:
    """Read beams from the records (A, R, length) of rows, and turn them: (A, B, samples), from sample `begin` on.

    Both numbers are even: a lane reads two samples at once, and follows its beam in steps of a tile.
    """
    lib, U = arrays_of(records), arrays_of(records).UInt32
    beams, step, pairs = dr.empty(lib.Float, 2 * len(reading.turns) * reading.beams * samples), TILE, samples // 2
    parts = -(-pairs // (step * TOGETHER))
    end, more, pitch = (dr.opaque(U, size) for size in (pairs, step, sizes.length // 2))
    beam, part = divided(lib, dr.arange(U, reading.beams * parts * step), parts * step)
    first = part // step * (step * TOGETHER) + (part & (step - 1))
    taps, last = dr.gather(lib.Array4f, reading.taps, beam), dr.minimum(first + step * TOGETHER, end)
    for aperture, turn in enumerate(reading.turns):
        rows = [(row + dr.opaque(U, aperture * reading.count)) * pitch + dr.opaque(U, begin // 2)
                for row in dr.gather(lib.Array4u, reading.rows, beam)]
        real, imaginary = (lib.Float(1), lib.Float(0)) if turn is None else dr.gather(lib.Array2f, turn, beam)
        into = (beam + dr.opaque(U, aperture * reading.beams)) * end

        def read(pair: UInt32, rows=rows, real=real, imaginary=imaginary, into=into) -> tuple[UInt32]:
            total = lib.Array4f(0)
            for row, tap in zip(rows, taps):
                total = dr.fma(dr.gather(lib.Array4f, records, row + pair), tap, total)
            a, b, c, d = total
            dr.scatter(beams, lib.Array4f(dr.fma(a, real, -b * imaginary), dr.fma(a, imaginary, b * real),
                                          dr.fma(c, real, -d * imaginary), dr.fma(c, imaginary, d * real)), into + pair)
            return pair + more,

        looped((first,), lambda pair: pair < last, read, "samples")
        dr.eval(beams)
    return beams


def _transfer(lib: ArrayTypes, transfers: RowTransfers, number: UInt32) -> Callable[[UInt32, Bool], Any]:
    """Return a function that gives P of a row's factor, where there is a row, at the frequencies of these numbers."""
    U, F = lib.UInt32, lib.Float
    mixes, nodes = upload(F, transfers.mix.view(np.float32)), upload(U, transfers.node)
    pairs, pitch = upload(F, transfers.pairs.view(np.float32)), dr.opaque(U, transfers.pairs.shape[1])

    def of(row: UInt32, there: Bool) -> Any:
        mix = dr.gather(lib.Array4f, mixes, row, there)
        pair = dr.gather(lib.Array4f, pairs, dr.gather(U, nodes, row, there) * pitch + number)
        return (lib.Complex2f(mix[0], mix[1]) * lib.Complex2f(pair[0], pair[1])
                + lib.Complex2f(mix[2], mix[3]) * lib.Complex2f(pair[2], pair[3]))

    return of


class _RowNoise:
    """Noise of rows at the frequencies of these numbers, through the bell and the replica."""

    def __init__(self, lib: ArrayTypes, noise: Noise, sizes: Sizes, number: UInt32):
        self._lib, self._row, self._number = lib, noise.row, number
        self._key, self._rows = dr.opaque(lib.UInt32, noise.key), dr.opaque(lib.UInt32, sizes.rows)
        self._taps = [dr.opaque(lib.Float, tap) for tap in noise.taps]
        self._replica = dr.gather(lib.Float, noise.frequency, number)

    def of(self, row: UInt32) -> tuple[Float, Float, Float]:
        """Return a row's random phase, and its size; 0 off the grid, where numbers before the first row are large."""
        size = dr.gather(self._lib.Float, self._row, row, row < self._rows)
        real, imag = random_phases(self._lib, self._number * self._rows + row, self._key)
        return real, imag, size

    def summed(self, around: Sequence[Float]) -> Any:
        """Return the noise of a row from what `of` gives for the row before, itself and the next."""
        total = self._lib.Complex2f(0)
        for place, away in enumerate((1, 0, 1)):
            real, imaginary, size = around[3 * place:3 * place + 3]
            total += self._lib.Complex2f(real, imaginary) * (size * self._taps[away])
        return total * self._replica


def _complex(lib: ArrayTypes, values: Float, place: UInt32, there: Bool | bool = True) -> Any:
    return lib.Complex2f(*dr.gather(lib.Array2f, values, place, there))
