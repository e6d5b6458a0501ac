"""Origin of the echoes of a time bin: integer sums beside those of `energy_sums`, from the same rays.

For every bin the sums hold the mean place of the seabed in the main lobe, weighted by echo energy; the energy that each
object hides, which the seabed behind it would send; and the sectors from which rays of the main lobe arrive, as a bit
mask. Sectors order the directions of a ping by the place where they would meet a level bed (`sector`). Where a slope
faces the sonar or an object stands up, sound from separate sectors falls into one bin (layover).
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import drjit as dr
import numpy as np

from mitsonar.device.arrays import held
from mitsonar.device.types import DrJitArray

from .energy_sums import LARGEST, add_words, read_sums, sum_size

SECTORS = 256
# words of a bin: the seabed's energy, its part in the main lobe, this part times x, y and depth, 3 unused; sectors
PLACE, MASK = 8, SECTORS // 64
WORDS = PLACE + MASK
FINER = 16                         # parts of a unit, for far places; a bin 30 dB above a perfect reflector still fits
ROUNDING = 0.02                    # [m] tolerated shift of a place by rounding an echo's share to 1


def sector(sine: DrJitArray, depth_below: DrJitArray, farthest: DrJitArray) -> DrJitArray:
    """Return the sectors of directions by how far along the record they would meet a level bed."""
    # sine (R,); depth_below (R,) [m]; farthest [m]
    slant_range = depth_below / dr.maximum(sine, 1e-6)
    share = (slant_range - depth_below) / dr.maximum(farthest - depth_below, 1e-3)
    return dr.uint32_array_t(type(sine))(held(share, 0, 1) * (SECTORS - 1e-3))


@dataclass(frozen=True, kw_only=True)
class SummedOrigins:
    """Origins of the energies of a block of pings."""

    seabed_place: np.ndarray  # [m]: x, y and depth of the seabed in the main lobe; NaN where its energy is too low
    seabed_intensity: np.ndarray  # [µPa²]
    hidden_intensity: np.ndarray | None  # [µPa²]: of the seabed that each object hides
    layover: np.ndarray  # number of separate runs of sectors


class OriginSums:
    """Integer sums of a block of pings."""

    def __init__(self, lib: ModuleType, rows: int, labels: int, bins: int, hidden: bool):
        self.lib, self.rows, self.labels, self.bins = lib, rows, labels, bins
        self.place = dr.zeros(lib.UInt64, sum_size(PLACE * rows * bins))
        self.sectors = dr.zeros(lib.UInt64, sum_size(MASK * rows * bins))
        self.hidden = dr.zeros(lib.UInt64, sum_size(rows * labels * bins)) if hidden else None

    def add(self, *, row: DrJitArray, bin: DrJitArray, units: DrJitArray, place: Sequence[DrJitArray],
            sector: DrJitArray, seabed: DrJitArray, in_beam: DrJitArray, active: DrJitArray) -> None:
        """Add rays to the bins in which they arrive; all arguments (R,)."""
        U = self.lib.UInt64
        index = row * dr.opaque(self.lib.UInt32, self.bins) + bin
        units = dr.minimum(units, LARGEST)
        whole = U(FINER * units + 0.5)
        exact = self.lib.Float64(whole)
        parts = (dr.select(in_beam, U(exact * self.lib.Float64(share) + 0.5), 0) for share in (1.0, *place))
        add_words(self.place, (whole, *parts, U(0), U(0), U(0)), index, active & seabed)
        dr.scatter_reduce(dr.ReduceOp.Or, self.sectors, U(1) << U(sector & 63), MASK * index + (sector >> 6),
                          active & in_beam)

    def add_hidden(self, *, row: DrJitArray, label: DrJitArray, bin: DrJitArray, units: DrJitArray,
                   active: DrJitArray) -> None:
        """Add the energy of the seabed behind objects; `label` is the number of the object."""
        lib = self.lib
        bins, labels = dr.opaque(lib.UInt32, self.bins), dr.opaque(lib.UInt32, self.labels)
        dr.scatter_add(self.hidden, lib.UInt64(0.25 * dr.minimum(units, LARGEST) + 0.5),
                       (row * labels + (label - 1)) * bins + bin, active)

    def sums(self) -> list[DrJitArray]:
        """Return the arrays to evaluate."""
        return [array for array in (self.place, self.sectors, self.hidden) if array is not None]

    def read(self, unit: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> SummedOrigins:
        """Return the sums in physical units, from the size of a unit [µPa²] and the limits (3,) [m] of places."""
        place = read_sums(self.place, self.rows, self.bins, PLACE).astype(float)
        seabed, weight = place[..., 0], place[..., 1:2]
        lower, upper = np.asarray(lower, float), np.asarray(upper, float)
        there = weight > (upper - lower).max() / ROUNDING
        place = np.where(there, lower + place[..., 2:5] / np.maximum(weight, 1) * (upper - lower), np.nan)
        hidden = None
        if self.hidden is not None:
            hidden = 4 * read_sums(self.hidden, self.rows, self.labels, self.bins) * unit
        return SummedOrigins(seabed_place=place.astype(np.float32), seabed_intensity=seabed / FINER * unit,
                             hidden_intensity=hidden, layover=runs(read_sums(self.sectors, self.rows, self.bins, MASK)))


def runs(masks: np.ndarray) -> np.ndarray:
    """Return the number of runs of ones in masks (..., words) of 64 bits, the lowest first: uint8 (...).

    A single zero between ones counts as a sector from which no ray happened to come.
    """
    masks = masks | _raised(masks) & _lowered(masks)
    first = np.ascontiguousarray(masks & ~_raised(masks))
    return np.unpackbits(first.view(np.uint8), axis=-1).sum(-1, dtype=np.uint8)


def _raised(masks: np.ndarray) -> np.ndarray:
    """Return masks with every bit one place up."""
    out = masks << np.uint64(1)
    out[..., 1:] |= masks[..., :-1] >> np.uint64(63)
    return out


def _lowered(masks: np.ndarray) -> np.ndarray:
    """Return masks with every bit one place down."""
    out = masks >> np.uint64(1)
    out[..., :-1] |= masks[..., 1:] << np.uint64(63)
    return out
