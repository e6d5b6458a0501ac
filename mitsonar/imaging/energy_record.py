"""Received powers of a sonar by row and bin: the input of images and their truth.

A row is the echo of one ping in one beam: a side of a sidescan, or a beam of an array.
"""
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .truth import BinTruth

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclass(frozen=True, kw_only=True)
class CoherentRecord:
    """Echoes with a known phase: of point targets, smooth surfaces and a flat sea surface."""

    intensity: np.ndarray  # (..., bins) [µPa²]: mean square of their sum, as imaged
    in_beam: np.ndarray  # (..., bins): 1 where such an echo arrives in the main lobe
    pressure: np.ndarray | None = None  # (..., bins, cells) [µPa]: means of their sum over the cells of each bin
    depth: np.ndarray | None = None  # (..., bins) [m]: of the strongest echo
    path_intensity: np.ndarray | None = None  # (..., paths, bins) [µPa²]: None without separate paths


@dataclass(frozen=True, kw_only=True)
class CoherentSums:
    """Coherent echoes of a block of pings."""

    record: CoherentRecord
    label_power: np.ndarray  # [µPa²]: of every instance alone, in the bins of the middles of its echoes


@dataclass(frozen=True, kw_only=True)
class EnergyRecord:
    """Powers of the echoes of pings.

    In the record of a block, ping and row are one axis and intensities are float64. `gathered` returns arrays
    (ping, row, ..., bin) with float32 intensities.
    """

    intensity: np.ndarray  # (..., bins) [µPa²]: of all but the coherent echoes
    depth: np.ndarray  # (..., bins) [m]: mean depth of the echoes, weighted by their energy
    rays: np.ndarray  # (..., bins): number of rays that arrive
    rays_in_beam: np.ndarray  # (..., bins): number of these within the main lobe
    path_intensity: np.ndarray | None = None  # (..., paths, bins) [µPa²]: None without separate paths
    coherent: CoherentRecord | None = None  # None without coherent echoes in the scene
    truth: BinTruth

    @property
    def echoes_in_beam(self) -> np.ndarray:
        """Return the number of rays and coherent echoes within the main lobe, (..., bins) uint32."""
        return self.rays_in_beam if self.coherent is None else self.rays_in_beam + self.coherent.in_beam


def powers(key: np.ndarray, real: np.ndarray, imaginary: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different keys of echoes (R,), and the power of the sum of all pressures with the same key."""
    found, which = np.unique(key, return_inverse=True)
    return found, np.bincount(which, real, len(found)) ** 2 + np.bincount(which, imaginary, len(found)) ** 2


def gathered(blocks: Iterable[EnergyRecord], *, pings: int, rows: int) -> EnergyRecord:
    """Return the records of consecutive blocks as one record."""
    def by_ping(array: np.ndarray) -> np.ndarray:
        return array.reshape(-1, rows, *array.shape[1:])

    def kind(array: np.ndarray) -> np.dtype:
        # float32 is ample: 1e-7 lies far below any speckle, and the record of a survey is large
        return np.dtype(np.float32) if array.dtype == np.float64 else array.dtype

    record, start = None, 0
    for block in blocks:
        if record is None and len(block.intensity) == pings * rows:        # the block is the record
            record = _changed(block, lambda array: by_ping(array).astype(kind(array), copy=False))
        else:
            if record is None:
                record = _changed(block, lambda array: np.empty((pings, rows, *array.shape[1:]), kind(array)))
            for target, array in zip(_arrays(record), map(by_ping, _arrays(block))):
                target[start:start + len(array)] = array
        start += len(block.intensity) // rows
    if record is None or start != pings:
        raise ValueError(f"blocks of {start} pings were given for a record of {pings}")
    return record


def only_row(record: EnergyRecord) -> EnergyRecord:
    """Return a record with one row per ping without its axis of rows: arrays (pings, ...)."""
    return _changed(record, lambda array: array[:, 0])


_R = TypeVar("_R", bound="DataclassInstance")


def joined(records: Sequence[_R]) -> _R:
    """Return records of one class as one, with their arrays concatenated."""
    first, values = records[0], {}
    for field in fields(first):
        parts = [getattr(record, field.name) for record in records]
        if parts[0] is not None:
            values[field.name] = joined(parts) if is_dataclass(parts[0]) else np.concatenate(parts)
    return replace(first, **values)


def _changed(record: _R, change: Callable[[np.ndarray], np.ndarray]) -> _R:
    """Return a record with every array replaced by ``change(array)``."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return replace(record, **{name: change(value) if isinstance(value, np.ndarray) else _changed(value, change)
                              for name, value in values.items() if value is not None})


def _arrays(record: "DataclassInstance") -> Iterator[np.ndarray]:
    """Yield all arrays of a record, in the order of its fields."""
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray):
            yield value
        elif value is not None:
            yield from _arrays(value)
