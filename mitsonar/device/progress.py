"""Progress of work in parts: the `Share` of a part from 0 to 1, or what is `Done` of pings or the like."""
from __future__ import annotations

from collections.abc import Callable

Share = Callable[[float], object]
Done = Callable[[float, float], object]        # what is done, of how much


def nobody(share: float) -> None:
    """Tell nobody."""


def shares(progress: Done | None, total: float) -> Share:
    """Return the shares of work whose amount is `total`."""
    return nobody if progress is None else lambda share: progress(share * total, total)


def part_of(progress: Share, begin: float, end: float) -> Share:
    """Return the shares of a part of the work, which lies between two shares of all of it."""
    return lambda share: progress(begin + (end - begin) * share)


def each_of(progress: Share, number: int, count: int) -> Share:
    """Return the shares of one of several equal parts, counted from 0."""
    return part_of(progress, number / count, (number + 1) / count)


def counted(progress: Share) -> Callable[[float, float], None]:
    """Return the progress of work that counts, as shares of it."""
    def told(done: float, total: float) -> None:
        progress(done / total)

    return told
