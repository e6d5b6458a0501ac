"""Apply the transpose of `accumulation` on the device: gather, for each echo, the weighted records of all elements.

    u[h, e] = conj(a exp(-2πi (φ + f₀ δ_e)) g_e) Σ_n k(n - m - μ - f_s δ_e) w[e, n]              [per hit and element]
    Re Σ conj(w) dz = Re Σ u dα,     dα[h, e] = F(hit, element, x),     Σ Re u ∂F/∂x

Symbols are those of `accumulation`; w -> weights of the records, dα -> relative change of an echo's amplitude, a linear
function F of some numbers x. Dr.Jit differentiates F pair by pair. A delay dτ of an echo uses records with another
kernel, whose `finish` differentiates: see `impulses.Later`.

A lane adds hits over a few rows into sums of its own. The number of lanes depends on hits and elements alone, hence so
does every bit of the result.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, picked, upload
from mitsonar.device.types import Bool, DrJitArray, Float, Int32, UInt32

from .accumulation import LANES, OfPair
from .impulses import BandLimited, tap_weights, turned
from .reception import transposed

NEIGHBOURS = 16                    # lanes that read neighbouring hits
ROUNDS = 16                        # hits of a lane
ROWS = 4                           # rows of a lane, where elements suffice

OfNumbers: TypeAlias = Callable[[Sequence[Float], Sequence[Float], Sequence[Float], Sequence[Float]], Float]


@dataclass(frozen=True)
class DelayChange:
    """Hold a linear function F of `own` numbers of each element and of `shared` numbers of all elements.

    ``factor(hit_fields, element_fields, own, shared)`` returns dα.
    """

    factor: OfNumbers
    own: int
    shared: int


@dataclass(frozen=True, kw_only=True, eq=False)
class EchoPairs:
    """Hold pairs of hits and elements: attributes as the arguments of `ImpulseResponses.add`."""

    amplitude: tuple[Float, Float]
    phase: Float
    sample: Int32
    fraction: Float
    hit_fields: Sequence[Float]
    element_fields: Sequence[Float | np.ndarray]
    difference: OfPair
    rows: np.ndarray
    gain: OfPair | None = None
    sheet: UInt32 | None = None

    @property
    def count(self) -> int:
        """Return the number of hits."""
        return max(dr.width(field) for field in (*self.amplitude, self.phase, self.sample, *self.hit_fields))


class GatheredWeights:
    """Hold weights of records at elements, complex (sheets, E, samples), on the device of a Dr.Jit array or type.

    Records are those that `ImpulseResponses.read` returns with a kernel; sampling rate and frequency are in Hz.
    """

    def __init__(self, like: DrJitArray | type, weights: np.ndarray, *, kernel: BandLimited, sampling_rate: float,
                 frequency: float):
        self.lib = lib = arrays_of(like)
        self.kernel, margin = kernel, kernel.margin
        self.sheets, self.elements, samples = weights.shape
        self.span = samples + 2 * margin
        wide = np.zeros((self.sheets, self.elements, self.span), np.complex64)
        wide[..., margin:margin + samples] = weights
        for sheet in range(self.sheets):
            wide[sheet] = transposed(kernel.finish, wide[sheet])
        self._values = upload(lib.Float, wide.view(np.float32))
        self._frequency, self._rate = (dr.opaque(lib.Float, value) for value in (frequency, sampling_rate))
        self._row, self._last = dr.opaque(lib.UInt32, self.span), dr.opaque(lib.UInt32, self.span - kernel.taps)
        self._sheet = dr.opaque(lib.UInt32, self.span * self.elements)

    def gather(self, pairs: EchoPairs, change: DelayChange) -> tuple[np.ndarray, np.ndarray]:
        """Return Σ Re u ∂F/∂x over hits: float64 (rows, own), and over all pairs (shared,)."""
        lib = self.lib
        U, together = lib.UInt32, ROWS if len(pairs.rows) >= ROWS else 1
        hits, fields, rows = self._opaque(pairs)
        teams, bundle = -(-len(pairs.rows) // together), NEIGHBOURS * ROUNDS
        lanes = -(-pairs.count // bundle) * NEIGHBOURS
        number = {name: dr.opaque(U, value) for name, value in dict(
            lanes=lanes, bundle=bundle, count=pairs.count, last=len(pairs.rows) - 1).items()}
        with dr.suspend_grad():
            index = dr.arange(U, lanes * teams)
            team = index // number["lanes"]
            lane = index - team * number["lanes"]
            group = lane // NEIGHBOURS
            begin = group * number["bundle"] + (lane - group * NEIGHBOURS)
            end = dr.minimum((group + 1) * number["bundle"], number["count"])
            owned = []
            for k in range(together):
                element = team * together + k
                exists = element <= number["last"]
                element = dr.minimum(element, number["last"])
                owned.append((exists, dr.gather(U, rows, element) * self._row,
                              [dr.gather(lib.Float, field, element) for field in fields]))

            def turn(hit: UInt32, each: list, common: list) -> tuple:
                read, place, on = self._read(hits, pairs, hit)
                for number, (exists, row, here) in enumerate(owned):
                    u = self._of_pair(read, place, pairs, here, row + on, exists)
                    slopes = [dr.select(exists, slope, 0) for slope in self._slopes(change, read[4:], here, u)]
                    each[number] = [total + slope for total, slope in zip(each[number], slopes)]
                    common = [total + slope for total, slope in zip(common, slopes[change.own:])]
                return hit + NEIGHBOURS, each, common

            def zeros(count: int) -> list[Float]:
                return [dr.zeros(lib.Float, dr.width(index)) for _ in range(count)]

            _, each, common = looped((begin, [zeros(change.own) for _ in owned], zeros(change.shared)),
                                     lambda hit, each, common: hit < end, turn, "gather")
            dr.eval(each, common)
        totals = np.zeros((teams, together, change.own))
        for k, numbers in enumerate(each):
            for which, part in enumerate(numbers):
                totals[:, k, which] = part.numpy().reshape(teams, lanes).sum(1, dtype=float)
        return (totals.reshape(teams * together, change.own)[:len(pairs.rows)],
                np.array([part.numpy().sum(dtype=float) for part in common]))

    def of_pairs(self, pairs: EchoPairs, change: DelayChange) -> np.ndarray:
        """Return Re u ∂F/∂x of every pair, float64 (own + shared, count, rows); meant for few pairs."""
        lib = self.lib
        hits, fields, rows = self._opaque(pairs)
        with dr.suspend_grad():
            index, count = dr.arange(lib.UInt32, pairs.count * len(pairs.rows)), dr.opaque(lib.UInt32, len(pairs.rows))
            hit = index // count
            element = index - hit * count
            read, place, on = self._read(hits, pairs, hit)
            here = [dr.gather(lib.Float, field, element) for field in fields]
            row = dr.gather(lib.UInt32, rows, element) * self._row + on
            u = self._of_pair(read, place, pairs, here, row, lib.Bool(True))
            slopes = self._slopes(change, read[4:], here, u)
            dr.eval(slopes)
        return np.stack([slope.numpy().astype(float).reshape(pairs.count, -1) for slope in slopes])

    def _slopes(self, change: DelayChange, hit: list[Float], here: list[Float], u: Float) -> list[Float]:
        """Return the derivatives of u F by its numbers, those of elements first."""
        with dr.resume_grad():
            numbers = [dr.zeros(self.lib.Float, dr.width(u)) for _ in range(change.own + change.shared)]
            dr.enable_grad(numbers)
            dr.backward_from(u * change.factor(hit, here, numbers[:change.own], numbers[change.own:]))
            return [dr.grad(number) for number in numbers]

    def _opaque(self, pairs: EchoPairs) -> tuple[list[Float], list[Float], UInt32]:
        """Return fields of hits and elements, and rows, as opaque arrays that compile no new kernel."""
        lib = self.lib
        fields = [cast(Float, field) if dr.is_jit_v(field) else upload(lib.Float, np.asarray(field, np.float32))
                  for field in pairs.element_fields]
        hits = [dr.detach(lib.Float(field)) for field in (*pairs.amplitude, pairs.phase, pairs.fraction,
                                                          *pairs.hit_fields)]
        rows = upload(lib.UInt32, pairs.rows.astype(np.uint32))
        dr.make_opaque(hits, pairs.sample, pairs.sheet, fields, rows)
        return hits, fields, rows

    def _read(self, hits: list[Float], pairs: EchoPairs, hit: UInt32) -> tuple[list[Float], Int32, UInt32]:
        """Return the fields of a hit, its sample, and the offset of its sheet."""
        on = self.lib.UInt32(0)
        if self.sheets > 1 and pairs.sheet is not None:
            on = picked(pairs.sheet, hit) * self._sheet
        return ([field if dr.width(field) == 1 else dr.gather(self.lib.Float, field, hit) for field in hits],
                picked(pairs.sample, hit), on)

    def _of_pair(self, read: list[Float], sample: Int32, pairs: EchoPairs, here: list[Float], row: UInt32,
                 active: Bool) -> Float:
        """Return the real part of u of one hit at one element."""
        lib = self.lib
        real, imaginary, phase, fraction = read[:4]
        delta = pairs.difference(read[4:], here)
        factor = None if pairs.gain is None else pairs.gain(read[4:], here)
        cosine, sine = turned(lib, dr.fma(self._frequency, delta, phase))
        if factor is not None:
            cosine, sine = cosine * factor, sine * factor
        real, imaginary = dr.fma(real, cosine, imaginary * sine), dr.fma(imaginary, cosine, -(real * sine))
        place = dr.fma(self._rate, delta, fraction)
        whole = dr.floor(place)
        tap = lib.UInt32(sample + lib.Int32(whole) + (self.kernel.margin + 1 - self.kernel.taps // 2))
        active &= (tap <= self._last) & (abs(place) < LANES)
        tap = dr.select(active, tap, 0)
        x = y = lib.Float(0)
        for k, weight in enumerate(tap_weights(lib, self.kernel, place - whole)):
            there = dr.gather(lib.Array2f, self._values, row + tap + k, active)
            x, y = dr.fma(weight, there.x, x), dr.fma(weight, there.y, y)
        return dr.fma(real, x, imaginary * y)
