"""What files of Kongsberg's datagrams share, old and new: soundings, and a water column in a file beside them."""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from typing import Any, BinaryIO

from ..assembly import Ping


class KongsbergFile(ABC):
    """Read pings by their keys, which a subclass finds when it is made."""

    _keys: Sequence[Any]

    def __init__(self, path: str, column_path: str | None, *, water_column: bool) -> None:
        self._paths = [path] + ([column_path] if column_path else [])
        self._water_column = water_column

    def __len__(self) -> int:
        return len(self._keys)

    def pings(self, start: int, stop: int) -> Iterator[Ping]:
        """Read pings, in the order of time."""
        with ExitStack() as stack:
            streams = [stack.enter_context(open(path, "rb")) for path in self._paths]
            for key in self._keys[start:stop]:
                yield self._ping(streams, key)

    def _left_out(self, passed: set[str], known: tuple[str, ...], extra: int = 0) -> str:
        """Return a clause on datagrams that are not read, but for some known ones, and on extra detections."""
        kinds = sorted(kind for kind in passed - {*known} if kind.isprintable())
        return ", and ".join((
            *([f"{extra} extra detections in the water column are left out"] if extra else []),
            *([f"datagrams of the kinds {', '.join(kinds)} are not read"] if kinds else [])))

    @abstractmethod
    def _ping(self, streams: Sequence[BinaryIO], key: Any) -> Ping:
        """Read one."""
