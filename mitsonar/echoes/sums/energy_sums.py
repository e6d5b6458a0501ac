"""Exact sums of echo energy per time bin.

Sums are 64-bit integers, so they depend neither on the order of additions nor on the number of threads.
One unit is 2^-50 of 10^(SL/10) 10^(-2 α R / 10) Φ / R², with Φ the sonar's equivalent beam, R the bin's slant range and
α the least absorption of the water. That is 60 dB finer than a typical ray of a typical bin, and leaves room for a bin
30 dB above a perfect reflector that fills the beam.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.types import DrJitArray

UNIT_BITS = 50
LARGEST = 2.0 ** 58                # most units of a single echo


def sum_size(needed: int) -> int:
    """Return the number of entries to allocate for `needed` sums: a power of two, from 65536.

    Dr.Jit compiles the size of a scatter's target into the kernel; with few sizes, few kernels are compiled.
    """
    return max(1 << 16, 1 << (int(needed) - 1).bit_length())


def read_sums(sums: DrJitArray, *shape: int) -> np.ndarray:
    """Return the first entries of sums in a shape; see `sum_size`."""
    return sums.numpy()[:int(np.prod(shape))].reshape(shape)


def add_words(target: DrJitArray, words: Sequence[DrJitArray], index: DrJitArray, active: DrJitArray) -> None:
    """Add 2, 4 or 8 words of UInt64 to rows of as many words; `index` (R,) is the number of the row.

    Where every thread has its own copy of the sums, a packet of words costs little more than a single word.
    """
    if dr.width(target) <= dr.expand_threshold():
        dr.scatter_add(target, arrays_of(target).ArrayXu64(list(words)), index, active)
        return
    for place, word in enumerate(words):
        dr.scatter_add(target, word, len(words) * index + place, active)


@dataclass(frozen=True, kw_only=True)
class SummedEnergy:
    """Energies of a block of pings in physical units."""

    intensity: np.ndarray  # [µPa²]
    label_intensity: np.ndarray  # [µPa²]: of each instance
    path_intensity: np.ndarray | None  # [µPa²]: of each path; None if paths are not separated
    depth: np.ndarray  # [m]: mean, weighted by energy
    rays: np.ndarray
    rays_in_beam: np.ndarray
    meets: np.ndarray  # True where a ray of the main lobe arrives from an instance


class EchoSums:
    """Integer sums of a block of pings."""

    def __init__(self, lib: ModuleType, rows: int, labels: int, bins: int,
                 depth_range: tuple[float, float],                                             # [m]
                 paths: int = 1):
        top, bottom = self.depth_range = depth_range
        self._top, self._per_depth = dr.opaque(lib.Float, top), dr.opaque(lib.Float, 1 / max(bottom - top, 1e-6))
        self.lib, self.rows, self.labels, self.bins, self.paths = lib, rows, labels, bins, paths
        self.energy = dr.zeros(lib.UInt64, sum_size(rows * labels * bins))
        self.depth_and_count = dr.zeros(lib.UInt64, sum_size(2 * rows * bins))
        self.path_energy = dr.zeros(lib.UInt64, sum_size(rows * paths * bins)) if paths > 1 else None
        # one bit per label
        self.words = -(-labels // 64)
        self.met = dr.zeros(lib.UInt64, sum_size(rows * self.words * bins))

    def add(self, *, row: DrJitArray, label: DrJitArray, bin: DrJitArray, units: DrJitArray, depth: DrJitArray,
            in_beam: DrJitArray, active: DrJitArray, path: DrJitArray | None = None, counted: bool = True) -> None:
        """Add echoes to their bins."""
        # all (R,); units of 2^-50, see above; depth [m]
        lib = self.lib
        U = lib.UInt64
        units = dr.minimum(units, LARGEST)
        bins, labels = dr.opaque(lib.UInt32, self.bins), dr.opaque(lib.UInt32, self.labels)
        place = row * bins + bin
        whole = U(units + 0.5)
        dr.scatter_add(self.energy, whole, (row * labels + (label - 1)) * bins + bin, active)
        if self.path_energy is not None and path is not None:
            paths = dr.opaque(lib.UInt32, self.paths)
            dr.scatter_add(self.path_energy, whole, (row * paths + (path - 1)) * bins + bin, active)
        height = dr.clip((depth - self._top) * self._per_depth, 0, 1)
        # a quarter, so that depths do not overflow before the energies that they are divided by
        depth_share = U(units * lib.Float64(height) * 0.25 + 0.5)
        if counted:
            words, number = dr.opaque(lib.UInt32, self.words), label - 1
            word = (row * words + (number >> 6)) * bins + bin
            dr.scatter_reduce(dr.ReduceOp.Or, self.met, U(1) << U(number & 63), word, active & in_beam)
            add_words(self.depth_and_count, (depth_share, dr.select(in_beam, U((1 << 32) + 1), U(1))), place, active)
        else:
            dr.scatter_add(self.depth_and_count, depth_share, 2 * place, active)

    def sums(self) -> list[DrJitArray]:
        """Return the arrays to evaluate."""
        return [array for array in (self.energy, self.depth_and_count, self.met, self.path_energy) if array is not None]

    def read(self, unit: np.ndarray) -> SummedEnergy:
        """Return the sums in physical units, from the size of a unit [µPa²] in each bin."""
        shape = (self.rows, self.bins)

        energy = read_sums(self.energy, self.rows, self.labels, self.bins)
        total = energy.sum(1, dtype=np.uint64)
        depth, count = np.moveaxis(read_sums(self.depth_and_count, *shape, 2), -1, 0)
        height = depth / np.maximum(total * 0.25, 1e-9)
        top, bottom = self.depth_range
        path_intensity = None
        if self.path_energy is not None:
            path_intensity = read_sums(self.path_energy, self.rows, self.paths, self.bins) * unit
        met = read_sums(self.met, self.rows, self.words, self.bins).astype("<u8")
        bits = np.unpackbits(met[..., None].view(np.uint8), axis=-1, bitorder="little")       # (rows, words, bins, 64)
        meets = np.moveaxis(bits, -1, 2).reshape(self.rows, -1, self.bins)[:, :self.labels].astype(bool)
        return SummedEnergy(
            intensity=total * unit[None], label_intensity=energy * unit, path_intensity=path_intensity,
            depth=np.where(total > 0, top + height * (bottom - top), np.nan).astype(np.float32),
            rays=(count & np.uint64(0xFFFFFFFF)).astype(np.uint32),
            rays_in_beam=(count >> np.uint64(32)).astype(np.uint32), meets=meets)
