"""Datagrams of raw files of echo sounders (Simrad EK80, file format 1.2x).

A datagram is its length, a type of four letters, the time in tenths of microseconds since 1601 (UTC), its content, and
its length again. Numbers are little endian.

    XML0    configuration, environment, parameters of the next ping     FIL1    filters of the receiver
    RAW3    samples of a ping of a channel                              NME0    a sentence of NMEA 0183
    MRU0    heave [m], roll, pitch, heading [degrees]
"""
from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO
from xml.etree import ElementTree

import numpy as np

TICKS = 10_000_000                 # a second
EPOCH = 11_644_473_600 * TICKS     # from 1601 to 1970
HEAD = 12                          # bytes of type and time
MOST_XML, MOST_PING = 50_000_000, 500_000_000            # bytes
RAW = np.dtype([("channel", "S128"), ("kind", "<u2"), ("spare", "<u2"), ("first", "<i4"), ("count", "<i4")])
MOTION = np.dtype([("heave", "<f4"), ("roll", "<f4"), ("pitch", "<f4"), ("heading", "<f4")])
POWER, ANGLE, HALF, SINGLE = 1, 2, 4, 8                  # bits of a kind of samples; the number of sectors stands above


@dataclass(frozen=True, kw_only=True)
class Datagram:
    """Type, time [s since 1970], and place and length of the content of a datagram."""

    kind: str
    time: float
    at: int
    size: int


def walk(file: BinaryIO) -> Iterator[Datagram]:
    """Yield the datagrams of a file."""
    size, at = os.fstat(file.fileno()).st_size, 0
    while at < size:
        file.seek(at)
        start = file.read(4 + HEAD)
        length = int.from_bytes(start[:4], "little")
        if len(start) < 4 + HEAD or at + length + 8 > size:
            raise ValueError(f"it ends within the datagram at byte {at}: the file is cut off; copy it again.")
        file.seek(at + 4 + length)
        if length < HEAD or file.read(4) != start[:4]:
            raise ValueError(f"the datagram at byte {at} has not the same length before and after it: the file is "
                             "damaged there; record or copy it again.")
        ticks = int.from_bytes(start[8:16], "little")
        yield Datagram(kind=start[4:8].decode("latin-1"), time=(ticks - EPOCH) / TICKS, at=at + 4 + HEAD,
                       size=length - HEAD)
        at += length + 8


def content(file: BinaryIO, datagram: Datagram, most: int | None = None) -> bytes:
    """Return the content of a datagram, or its first bytes."""
    file.seek(datagram.at)
    return file.read(datagram.size if most is None else min(datagram.size, most))


def tree(file: BinaryIO, datagram: Datagram) -> ElementTree.Element:
    """Return the element of an XML datagram."""
    if datagram.size > MOST_XML:
        raise ValueError(f"the XML at byte {datagram.at} has {datagram.size / 1e6:.0f} MB; the file is damaged there.")
    raw = content(file, datagram).rstrip(b"\0 \r\n")
    if b"<!" in raw.replace(b"<!--", b""):
        raise ValueError(f"the XML at byte {datagram.at} declares a document type or entities, which no sounder does.")
    try:
        return ElementTree.fromstring(raw)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ValueError(f"the XML at byte {datagram.at} is broken ({error}); the file is damaged there.") from None


def number(element: ElementTree.Element | None, name: str) -> float:
    """Return a number of an element, NaN if it is not there."""
    try:
        return float("nan" if element is None else element.get(name, "nan"))
    except ValueError:
        return float("nan")


def samples(raw: bytes, at: int) -> tuple[np.ndarray | None, np.ndarray | None, np.ndarray | None]:
    """Return steps of power (N,), of angle (N, 2) athwart and along, and signals (N, sectors), None where not there."""
    if len(raw) < RAW.itemsize:
        raise ValueError(f"the ping at byte {at} has no header; the file is damaged there.")
    header = np.frombuffer(raw, RAW, 1)[0]
    kind, count, place = int(header["kind"]), int(header["count"]), RAW.itemsize
    sectors = kind >> 8
    parts = [(POWER, np.dtype("<i2"), ()), (ANGLE, np.dtype("i1"), (2,)), (HALF, np.dtype("<f2"), (2 * sectors,)),
             (SINGLE, np.dtype("<f4"), (2 * sectors,))]
    found: list[np.ndarray | None] = []
    for bit, layout, shape in parts:
        if not kind & bit or not all(shape):
            found.append(None)
            continue
        numbers = count * int(np.prod(shape))
        if count < 0 or place + numbers * layout.itemsize > len(raw):
            raise ValueError(f"the ping at byte {at} has {count} samples, more than its {len(raw)} bytes; the file is "
                             "damaged there.")
        found.append(np.frombuffer(raw, layout, numbers, place).reshape(count, *shape))
        place += numbers * layout.itemsize
    power, angle, half, single = found
    parts_of = single if single is not None else half
    signal = None if parts_of is None else np.ascontiguousarray(parts_of, np.float32).view(np.complex64)
    return power, angle, signal
