"""Reader shared by the old and the new datagrams of Kongsberg: soundings, and a water column in a file beside them."""
from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np

from ..assembly import AssembledLine, LineCast, LineColumn, Ping, cast_of, check_counts
from ..motion import MotionSamples
from .kongsberg_install import KongsbergInstallation


@dataclass(kw_only=True, eq=False)
class KongsbergRecords:
    """Contents of a file, and the places of its pings, after the first pass through it."""

    text: str = ""                                      # installation parameters
    casts: list[LineCast] = field(default_factory=list)
    model: int = 0
    soundings: dict = field(default_factory=dict)       # key -> place; of .all: key -> letter -> place
    column: dict = field(default_factory=dict)          # key -> place; of .all: key -> places
    positions: list = field(default_factory=list)       # (time, longitude, latitude)
    attitude: dict = field(default_factory=dict)        # source -> arrays (M, 5): time, roll, pitch, heading, heave
    depths: dict = field(default_factory=dict)          # key -> depth of the transmit array [m]
    passed: set[str] = field(default_factory=set)       # kinds of datagrams that are not read
    tides: list = field(default_factory=list)           # (time, level of the water above the datum)
    datum: str = ""
    heights: bool = False                               # some ping has a height above the ellipsoid
    extra: int = 0                                      # detections in the water column
    old: bool = False                                   # has depths of sounders before 2007
    beams: int = 0
    sectors: int = 0
    column_beams: int = 0
    column_samples: int = 0
    snippet_samples: int = 0

    def note_ping(self, number: int, beams: int, sectors: int) -> None:
        """Keep the largest numbers of beams and sectors."""
        check_counts(f"its ping {number}", beams, sectors)
        self.beams, self.sectors = max(self.beams, beams), max(self.sectors, sectors)

    def note_column(self, number: int, beams: int, samples: int) -> None:
        """Keep the largest numbers of beams and samples of a water column."""
        check_counts(f"its water column of ping {number}", beams)
        self.column_beams, self.column_samples = max(self.column_beams, beams), max(self.column_samples, samples)

    def samples(self, *sources: Hashable) -> np.ndarray:
        """Return the attitude (M, 5) from the first source that has any, in the order of time."""
        samples = np.concatenate(next(filter(None, map(self.attitude.get, sources)), [np.zeros((0, 5))]))
        return samples[np.argsort(samples[:, 0], kind="stable")]


class KongsbergFile(ABC):
    """Read pings by their keys; a subclass sets the attributes below when it is constructed."""

    _keys: Sequence[Any]
    _start: float
    _installation: KongsbergInstallation
    _motion: MotionSamples
    _heads: int
    BACKSCATTER: str
    COLUMN_KIND: str

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        self._paths = [path] + ([column_path] if column_path else [])
        self._water_column = water_column
        self._found = KongsbergRecords()
        for number, path in enumerate(self._paths):
            with open(path, "rb") as stream:
                self._walk(stream, number)

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def casts(self) -> Sequence[LineCast]:
        """Return the casts of the file, in its order."""
        return self._found.casts

    @property
    def line(self) -> AssembledLine:
        """Content that the pings share."""
        found, installed, motion = self._found, self._installation, self._motion
        depth, speed = cast_of(found.casts[0].nodes if found.casts else None)
        kinds = sorted(kind for kind in found.passed - {self.COLUMN_KIND} if kind.isprintable())
        return AssembledLine(
            sonar=f"EM {found.model}", title=os.path.basename(self._paths[0]), start=self._start, crs=motion.frame.crs,
            origin=motion.frame.origin, cast_depth=depth, cast_sound_speed=speed,
            transmit_offset=installed.transmit_offset, transmit_mounting=installed.transmit_mounting,
            receive_offset=installed.receive_offset[:self._heads],
            receive_mounting=installed.receive_mounting[:self._heads], motion=motion.streams,
            backscatter=self.BACKSCATTER, profile="the cast of the file", beams=found.beams, sectors=found.sectors,
            levels=tuple(name for name, held in (("tide", found.tides), ("ping_height", found.heights)) if held),
            datum=found.datum, column_beams=found.column_beams, column_samples=found.column_samples,
            snippet_samples=found.snippet_samples if self._water_column else 0, left_out=", and ".join((
                *([f"{found.extra} extra detections in the water column are left out"] if found.extra else []),
                *([f"datagrams of the kinds {', '.join(kinds)} are not read"] if kinds else []))))

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of time."""
        with ExitStack() as stack:
            streams = [stack.enter_context(open(path, "rb")) for path in self._paths]
            for key in self._keys[start:stop]:
                yield self._ping(streams, key)

    def _column_of(self, number: int, place: dict[str, float], head: int, absorption: np.ndarray, *,    # (S,) [dB/m]
                   rate: float, speed: float, angle: np.ndarray, start: np.ndarray, count: np.ndarray,  # (C,) [degrees]
                   sector: np.ndarray, samples: np.ndarray, offset: float, spreading: float) -> LineColumn:
        """Return the water column of a ping: the level without the sounder's gain (spreading log R) and absorption."""
        if not (0 < rate < np.inf and 0 < speed < np.inf):
            raise ValueError(f"its water column of ping {number} has {rate:g} samples a second and a sound speed of "
                             f"{speed:g} m/s; it is damaged.")
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        distance = (np.repeat(start, count) + within + 0.5) * speed / (2 * rate)
        lost = np.repeat(absorption[np.minimum(sector, absorption.size - 1)], count) if absorption.size else 0.0
        level = 0.5 * samples - offset - spreading * np.log10(distance) - 2 * lost * distance
        return LineColumn(angle=-np.deg2rad(angle) + place["roll"] + self._installation.receive_mounting[head][0],
                          start=start / rate, rate=np.full(count.size, rate), sector=sector, count=count,
                          level_db=level)

    @abstractmethod
    def _walk(self, stream: BinaryIO, number: int) -> None:
        """Note the datagrams of a file: 0 that of the soundings, 1 that of the water column."""

    @abstractmethod
    def _ping(self, streams: Sequence[BinaryIO], key: Any) -> Ping:
        """Read one ping."""
