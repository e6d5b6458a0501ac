"""Element signals on the device, read at the instant an echo from a point reaches each element.

    τ_n = (|P - T| + |P - R_n|) / c,     y = Σ_n w_n z_n(τ_n) exp(2πi f0 (τ_n - τ)) / Σ_n w_n

P -> point, T -> transmitter, R_n -> element n, τ -> the delay whose phase the result keeps. Only differences are made
in float32, by `propagation.returns.moved_ends`, against a whole sample and a phase that are exact.
"""
import importlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, upload
from mitsonar.device.types import Array4f, ArrayTypes, DrJitArray, Float, Int32, UInt32
from mitsonar.propagation.returns.moved_ends import further

from .interpolation import MARGIN, RATE, corrected, interpolation_named
from .recording import Recording

TOGETHER = 4                       # foci a thread works on at once: 2.0 instead of 2.6 ns each on the CPU


def device_arrays(like: DrJitArray | type | None = None) -> ArrayTypes:
    """Return the Dr.Jit namespace of `like` (array or type), or of the best backend that works here: CUDA, then LLVM.
    """
    return arrays_of(importlib.import_module("drjit.auto.ad").Float if like is None else like)


class Focus(NamedTuple):
    """Points on the device, and where their echoes lie in the record of an element at the centre."""

    point: list[Float]             # three Floats, from the centre [m]
    distance: Float                # Float, their length [m]
    sample: Int32                  # Int32, whole stored samples
    fraction: Float                # Float, further stored samples
    phase: Float                   # Float [cycles], to be undone


class ElementSignals:
    """Element signals of one ping, positions relative to `centre`."""

    def __init__(self, lib: ArrayTypes, recording: Recording, interpolation: str, weights: np.ndarray):
        self.lib, self.recording = lib, recording
        self.kernel = interpolation_named(interpolation)
        self.weights = weights.astype(np.float32)
        samples, elements = recording.values.shape[-1], recording.values.shape[2]
        self.elements = dr.opaque(lib.UInt32, elements)
        self.one = dr.opaque(lib.UInt32, 1)        # a literal step makes loop iterations wait for one another on x86
        self.row = dr.opaque(lib.UInt32, RATE * samples + 2 * MARGIN)
        self.earliest = dr.opaque(lib.Int32, -self.kernel.first)       # so that a row's own zeros are read
        self.latest = dr.opaque(lib.Int32, RATE * samples + 2 * MARGIN - 3)
        self.samples_per_metre = dr.opaque(lib.Float, RATE * recording.sampling_rate / recording.sound_speed)
        self.cycles_per_metre = dr.opaque(lib.Float, recording.frequency / recording.sound_speed)

    def load(self, ping: int, centre: np.ndarray) -> None:
        """Upload a ping to the device; positions are relative to centre (3,) [m]."""
        lib, recording = self.lib, self.recording
        shaded = recording.values[ping] * self.weights[:, None]
        self.values = upload(lib.Float, corrected(self.kernel, shaded).view(np.float32))
        place = recording.receivers[ping] - centre
        table = np.column_stack([place, (place ** 2).sum(axis=1)])
        self.place = upload(lib.Float, table.astype(np.float32))
        dr.eval(self.values, self.place)

    def detour(self, point: Sequence[Float], distance: Float, place: Sequence[Float] | Array4f) -> Float:
        """Return |P - R| - |P| [m] of points (three Floats) at a distance |P| and elements (x, y, z, |R|²)."""
        q = dr.fma(-2 * point[0], place[0], dr.fma(-2 * point[1], place[1], dr.fma(-2 * point[2], place[2], place[3])))
        return further(q, distance)

    def read(self, row: UInt32, place: Array4f, focus: Focus) -> tuple[Float, Float]:
        """Read the weighted signal (re, im) of an element at the instants that the echoes of foci reach it."""
        # place [m, m²]
        lib = self.lib
        first, taps, (sin, cos) = self._reading(row, place, focus)
        re, im = lib.Float(0), lib.Float(0)
        for k, tap in enumerate(taps):
            value = dr.gather(lib.Array2f, self.values, first + k)
            re, im = dr.fma(tap, value.x, re), dr.fma(tap, value.y, im)
        return dr.fma(re, cos, -im * sin), dr.fma(re, sin, im * cos)

    def _reading(self, row: UInt32, place: Array4f, focus: Focus) -> tuple[UInt32, list[Float], tuple[Float, Float]]:
        """Return the first stored sample that is read, the taps, and sine and cosine of the turn; see `read`."""
        lib = self.lib
        further = self.detour(focus.point, focus.distance, place)
        turn = dr.fma(self.cycles_per_metre, further, focus.phase)
        turned = dr.sincos(2 * np.pi * (turn - dr.round(turn)))
        later = dr.fma(self.samples_per_metre, further, focus.fraction)
        whole = dr.floor(later)
        index = dr.clip(focus.sample + lib.Int32(whole) + MARGIN, self.earliest, self.latest) + self.kernel.first
        return row * self.row + lib.UInt32(index), self.kernel.taps(later - whole), turned

    def element(self, number: UInt32) -> Array4f:
        """Return the place (x, y, z, |R|²) of elements."""
        return dr.gather(self.lib.Array4f, self.place, number)

    def summed(self, foci: Iterable[Sequence[Focus]]) -> np.ndarray:
        """Sum the signals of all elements."""
        lib = self.lib
        total: list[Float] = []
        for tx, group in enumerate(foci):
            if not total:
                total = [dr.zeros(lib.Float, dr.width(focus.distance)) for focus in group for _ in range(2)]
            offset = dr.opaque(lib.UInt32, tx * self.recording.values.shape[2])

            def body(n, *total, group=group, offset=offset):
                place = self.element(n)
                parts = [part for focus in group for part in self.read(offset + n, place, focus)]
                return n + self.one, *(old + new for old, new in zip(total, parts, strict=True))

            _, *total = looped((lib.UInt32(0), *total), lambda n, *_: n < self.elements, body)
            dr.eval(total)
        return np.concatenate([to_complex(*total[k:k + 2]) for k in range(0, len(total), 2)])


    def spread(self, foci: Focus, weights: np.ndarray, transmitter: int, into: Float) -> None:
        """Add the transpose of what `summed` does, conjugate, of weights of foci, to stored samples.

        An element is a thread's alone and takes focus after focus: sums come out the same however many threads there
        are.
        """
        lib, elements = self.lib, self.recording.values.shape[2]
        place = self.element(dr.arange(lib.UInt32, elements))
        row = dr.arange(lib.UInt32, elements) + dr.opaque(lib.UInt32, transmitter * elements)
        weight = upload(lib.Float, np.ascontiguousarray(weights, np.complex64).view(np.float32))
        count = dr.opaque(lib.UInt32, len(weights))

        def taken(number: UInt32) -> Focus:
            point = [dr.gather(lib.Float, axis, number) for axis in foci.point]
            return Focus(point, dr.gather(lib.Float, foci.distance, number), dr.gather(lib.Int32, foci.sample, number),
                         dr.gather(lib.Float, foci.fraction, number), dr.gather(lib.Float, foci.phase, number))

        def body(number: UInt32) -> tuple[UInt32]:
            first, taps, (sin, cos) = self._reading(row, place, taken(number))
            value = dr.gather(lib.Array2f, weight, number)
            re, im = dr.fma(value.x, cos, value.y * sin), dr.fma(value.y, cos, -value.x * sin)
            for k, tap in enumerate(taps):
                dr.scatter_add(into, tap * re, 2 * (first + k), mode=dr.ReduceMode.Direct)
                dr.scatter_add(into, tap * im, 2 * (first + k) + 1, mode=dr.ReduceMode.Direct)
            return (number + self.one,)

        looped((dr.opaque(lib.UInt32, 0, elements),), lambda number: number < count, body)
        dr.eval(into)


def to_complex(re: Float, im: Float) -> np.ndarray:
    """Make NumPy complex64 of two Floats."""
    return re.numpy() + 1j * im.numpy()


def dealt(count: int) -> np.ndarray:
    """Return `count` numbers in groups of equal size that are processed together: int (groups, size).

    The last group may repeat the last number; the first occurrence counts.
    """
    groups = TOGETHER if count >= TOGETHER else 1
    return np.minimum(np.arange(-(-count // groups) * groups), count - 1).reshape(groups, -1)
