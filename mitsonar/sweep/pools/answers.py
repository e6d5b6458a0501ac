"""Answers of a pool's processes to the jobs of one command, in the order of the jobs.

Arrays come as a pickle in base64, from a process that the command has started itself.
"""
import base64
import pickle
import warnings
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

from .local import Local

AHEAD = 3                          # jobs of each process that are made or wait: bounds the memory of answers


class Answers:
    """Answers of a pool, whose warnings are repeated here once."""

    def __init__(self, pool: Local):
        self._pool, self._said = pool, set()

    def of(self, jobs: Iterable[dict[str, Any]]) -> Iterator[dict[str, Any]]:
        """Yield the answers to jobs, in their order; raise `ValueError` for a job that failed."""
        waiting = deque()
        for job in jobs:
            waiting.append(self._pool.submit(job))
            if len(waiting) >= AHEAD * self._pool.capacity:
                yield self._checked(waiting.popleft().result())
        while waiting:
            yield self._checked(waiting.popleft().result())

    def _checked(self, answer):
        for text in answer["warnings"]:
            if text not in self._said:
                self._said.add(text)
                warnings.warn(text, stacklevel=2)
        if answer.get("error"):
            raise ValueError(answer["error"])
        return answer


def packed(data: Any) -> str:
    """Return data as text for an answer."""
    return base64.b64encode(pickle.dumps(data)).decode()


def unpacked(text: str) -> Any:
    """Return the data of an answer of a process that was started here."""
    return pickle.loads(base64.b64decode(text))
