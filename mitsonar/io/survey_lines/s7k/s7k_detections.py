"""Detections in records 7027 and 7006 of s7k."""
from __future__ import annotations

import numpy as np

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED

from ..detections import DetectedPing
from .s7k_records import DETECTION, NEEDED, S7kRecord


def raw_detections(record: S7kRecord) -> DetectedPing:
    """Return the raw detections 7027 of a ping, with the fields that the file's version has."""
    head = record.head
    count, size = int(head["beams"]), int(head["field"])
    known = min((size + 2) // 4, len(DETECTION))
    if known < NEEDED or size > 1 << 16:
        raise ValueError(f"its record 7027 at byte {record.offset} has detections of {size} bytes; it is damaged.")
    rest = size - np.dtype(DETECTION[:known]).itemsize
    rows = record.table(np.dtype(DETECTION[:known] + ([("more", f"V{rest}")] if rest else [])), count)
    flags = rows["flags"]
    method = np.where(flags & 1, BY_AMPLITUDE, np.where(flags & 2, BY_PHASE, NOT_DETECTED))
    passed = (flags >> 2 & 127 == 0) | (rows["quality"] & 3 == 3)          # a kind of quality 0 is none
    values = {name: rows[name] if name in [name for name, _ in DETECTION[:known]] else np.full(count, np.nan)
              for name in ("intensity", "uncertainty")}
    return DetectedPing(travel_time=rows["sample"] / float(head["rate"]), angle=rows["angle"], method=method,
                        steering=float(head["steering"]),
                        valid=passed & (flags >> 9 & 15 == 0) & (method != NOT_DETECTED), **values)


def bathymetry(record: S7kRecord, angle: np.ndarray, steering: float) -> DetectedPing:
    """Return the detections 7006 of a ping, whose angles are stated elsewhere."""
    count = int(record.head["beams"])
    if angle.size != count:
        raise ValueError(f"its ping {int(record.head['number'])} has {count} ranges and {angle.size} beams; it is "
                         "damaged.")
    time, flags, intensity = columns(record, count, "<f4", "u1", "<f4")
    method = np.where(flags & 4, BY_AMPLITUDE, np.where(flags & 8, BY_PHASE, NOT_DETECTED))
    return DetectedPing(travel_time=time, angle=angle, steering=steering, valid=flags & 3 == 3, method=method,
                        intensity=intensity)


def columns(record: S7kRecord, count: int, *kinds: str) -> list[np.ndarray]:
    """Return columns of ``count`` values that follow the head of a record."""
    row = record.table(np.dtype([(str(number), kind, (count,)) for number, kind in enumerate(kinds)]), 1)[0]
    return [np.atleast_1d(row[str(number)]) for number in range(len(kinds))]
