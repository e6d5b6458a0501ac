"""Received powers of a sonar by row and bin: the record that pictures and their truth are made of.

A row is what a beam of the sonar hears of one ping: a side of a sidescan, a beam of an array.
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
    """Echoes that have a phase of their own: point targets, smooth surfaces, a flat sea surface."""

    intensity: np.ndarray  # (..., bins) [µPa²]: mean square of their sum, as the picture shows it
    in_beam: np.ndarray  # (..., bins): 1 where such an echo comes through the main lobe
    pressure: np.ndarray | None = None  # (..., bins, cells) [µPa]: means of their sum over the cells of each bin
    depth: np.ndarray | None = None  # (..., bins) [m]: of the strongest
    path_intensity: np.ndarray | None = None  # (..., paths, bins) [µPa²]: none where paths are not told apart


@dataclass(frozen=True, kw_only=True)
class CoherentSums:
    """The coherent echoes of a block of pings."""

    record: CoherentRecord
    label_power: np.ndarray  # [µPa²]: of every instance by itself, in the bins that the middles of its echoes lie in


@dataclass(frozen=True, kw_only=True)
class EnergyRecord:
    """Powers of the echoes of some pings.

    Arrays of a block of pings have ping and row as one axis, and intensities in double precision; `gathered` gives
    (ping, row, ..., bin), and intensities in single precision.
    """

    intensity: np.ndarray  # (..., bins) [µPa²]: of all echoes but those that have a phase of their own
    depth: np.ndarray  # (..., bins) [m]: mean depth the echoes come from, weighted by their energy
    rays: np.ndarray  # (..., bins): number of rays that arrive
    rays_in_beam: np.ndarray  # (..., bins): number of these within the main lobe
    path_intensity: np.ndarray | None = None  # (..., paths, bins) [µPa²]: none where paths are not told apart
    coherent: CoherentRecord | None = None  # none where nothing in the scene has a phase of its own
    truth: BinTruth

    @property
    def echoes_in_beam(self) -> np.ndarray:
        """Rays and coherent echoes that arrive within the main lobe, (..., bins) uint32."""
        return self.rays_in_beam if self.coherent is None else self.rays_in_beam + self.coherent.in_beam


def gathered(blocks: Iterable[EnergyRecord], *, pings: int, rows: int) -> EnergyRecord:
    """Put the records of consecutive blocks together."""
    whole, start = None, 0
    for block in blocks:
        if whole is None:
            whole = _changed(block, lambda array: np.empty((pings, rows, *array.shape[1:]), _kept(array.dtype)))
        for kept, array in zip(_arrays(whole), _arrays(block)):
            array = array.reshape(-1, rows, *array.shape[1:])
            kept[start:start + len(array)] = array
        start += len(block.intensity) // rows
    if whole is None or start != pings:
        raise ValueError(f"blocks of {start} pings were given for a record of {pings}")
    return whole


def only_row(record: EnergyRecord) -> EnergyRecord:
    """Return the record of a sonar with one row a ping without the axis of rows: arrays (pings, ...)."""
    return _changed(record, lambda array: array[:, 0])


def _kept(kind: np.dtype) -> np.dtype:
    """Single precision of floating-point numbers: 1e-7 lies far below any speckle, and a survey's record is large."""
    return np.dtype(np.float32) if kind == np.float64 else kind


_R = TypeVar("_R", bound="DataclassInstance")


def joined(records: Sequence[_R]) -> _R:
    """Put the arrays of records of one kind one after another."""
    first, values = records[0], {}
    for field in fields(first):
        parts = [getattr(record, field.name) for record in records]
        if parts[0] is not None:
            values[field.name] = joined(parts) if is_dataclass(parts[0]) else np.concatenate(parts)
    return replace(first, **values)


def _changed(record: _R, change: Callable[[np.ndarray], np.ndarray]) -> _R:
    """The same record of other arrays."""
    values = {field.name: getattr(record, field.name) for field in fields(record)}
    return replace(record, **{name: change(value) if isinstance(value, np.ndarray) else _changed(value, change)
                              for name, value in values.items() if value is not None})


def _arrays(record: "DataclassInstance") -> Iterator[np.ndarray]:
    """All arrays of a record, in the order of its fields."""
    for field in fields(record):
        value = getattr(record, field.name)
        if isinstance(value, np.ndarray):
            yield value
        elif value is not None:
            yield from _arrays(value)
