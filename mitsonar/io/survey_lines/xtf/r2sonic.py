"""Bathymetry datagrams BTH0 of R2Sonic, all with the highest byte first.

Layout: R2Sonic, Sonic Operation Manual, uplink data formats (2014). A datagram is its name, its length [bytes] and a
number; then sections, each with a name of two letters and its length. H0 describes the ping; R0 holds travel times
both ways in steps; A0 the first and the last angle of even ones, A2 the first and steps; I1 intensities; Q0 four bits
a beam: 8 detected by phase, 4 by magnitude. Points are those of H0, padded to an even number. Angles are from the
array's normal, positive to starboard.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mitsonar.hydrography.record import BY_AMPLITUDE, BY_PHASE, NOT_DETECTED

from ..assembly import check_counts
from ..detections import DetectedPing

NAME = b"BTH0"
START = 12                         # bytes of name, length and number
HEAD = np.dtype([("name", "S2"), ("size", ">u2"), ("model", "S12"), ("serial", "S12"), ("second", ">u4"),
                 ("nanosecond", ">u4"), ("number", ">u4"), *((name, ">f4") for name in (
                     "period", "sound_speed", "frequency", "power", "pulse_length", "width", "width_across", "steering",
                     "steering_across")), ("temperature", ">u2"), ("voltage", ">i2"),
                 *((name, ">f4") for name in ("bandwidth", "rate", "range", "gain", "spreading", "absorption", "tilt")),
                 ("more", ">u4"), ("spare", ">u2"), ("points", ">u2")])


@dataclass(frozen=True, kw_only=True, eq=False)
class R2SonicPing:
    """One datagram: the fields of H0 and the sections by name."""

    head: Any
    sections: dict[bytes, bytes]  # without their names and lengths

    @property
    def time(self) -> float:
        """Seconds since 1970, UTC."""
        return float(self.head["second"]) + 1e-9 * float(self.head["nanosecond"])

    def detections(self) -> DetectedPing:
        """Return the detections of the ping."""
        count = int(self.head["points"])
        step = self._numbers(b"R0", ">f4", 1)[0]
        time = self._numbers(b"R0", ">u2", count, 4) * float(step)
        quality = np.unpackbits(np.frombuffer(self.sections.get(b"Q0", b""), np.uint8)).reshape(-1, 4)
        if quality.shape[0] < count:
            raise ValueError(f"its ping {int(self.head['number'])} lacks flags of quality; it is damaged.")
        phase, magnitude = quality[:count, 0].astype(bool), quality[:count, 1].astype(bool)
        return DetectedPing(
            travel_time=time, angle=self._angles(count), steering=float(self.head["steering"]),
            valid=phase | magnitude, method=np.where(phase, BY_PHASE, np.where(magnitude, BY_AMPLITUDE, NOT_DETECTED)),
            intensity=self._intensity(count))

    def _angles(self, count):
        if b"A0" in self.sections:
            first, last = self._numbers(b"A0", ">f4", 2)
            return np.linspace(float(first), float(last), count)
        first, step = self._numbers(b"A2", ">f4", 2)
        return float(first) + np.cumsum(self._numbers(b"A2", ">u2", count, 32).astype(float)) * float(step)

    def _intensity(self, count):
        if b"I1" not in self.sections:
            return np.full(count, np.nan)
        return self._numbers(b"I1", ">u2", count, 4) * float(self._numbers(b"I1", ">f4", 1)[0])

    def _numbers(self, name, kind, count, start=0):
        """Return numbers from byte ``start`` of a section."""
        raw = self.sections.get(name, b"")
        if start + count * np.dtype(kind).itemsize > len(raw):
            raise ValueError(f"its ping {int(self.head['number'])} has a section {name.decode()} of {len(raw)} bytes, "
                             f"too few for {count} points; it is damaged.")
        return np.frombuffer(raw, kind, count, start)


def head_of(raw: bytes) -> Any | None:
    """Return the fields of H0 of a datagram from its first bytes, or None if it is no bathymetry."""
    if not raw.startswith(NAME) or len(raw) < START + HEAD.itemsize or raw[START:START + 2] != b"H0":
        return None
    head = np.frombuffer(raw, HEAD, 1, START)[0]
    check_counts(f"its ping {int(head['number'])}", int(head["points"]))
    return head


def ping_of(raw: bytes) -> R2SonicPing:
    """Return a datagram whose first bytes have passed `head_of`."""
    end, place, sections = min(int.from_bytes(raw[4:8], "big"), len(raw)), START, {}
    while place + 4 <= end:
        size = int.from_bytes(raw[place + 2:place + 4], "big")
        if size < 4 or place + size > end:
            raise ValueError(f"its datagram BTH0 has a section of {size} bytes at byte {place}; it is damaged.")
        sections.setdefault(raw[place:place + 2], raw[place + 4:place + size])
        place += size
    return R2SonicPing(head=head_of(raw), sections=sections)
