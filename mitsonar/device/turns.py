"""Work on the device by one Python thread at a time.

Dr.Jit numbers its workers, and every Python thread that waits for the device is number 0. Small sums exist once for
each worker, so two threads that wait at the same time add to the same copy, and some additions are lost. If several
threads call mitsonar, their work is therefore done one after the other. Kernels use all cores anyway.
"""
from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Callable, Generator
from types import GeneratorType
from typing import ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")
Y = TypeVar("Y")
TURN = threading.RLock()           # held by the thread that works on the device


def one_at_a_time(work: Callable[P, R]) -> Callable[P, R]:
    """Return a function that waits for its turn; if it returns a generator, each step of that waits again."""
    @functools.wraps(work)
    def in_turn(*args: P.args, **kwargs: P.kwargs) -> R:
        with TURN:
            result = work(*args, **kwargs)
        return cast(R, _steps(result)) if isinstance(result, GeneratorType) else result

    return in_turn


def _steps(generator: Generator[Y, None, None]) -> Generator[Y, None, None]:
    """Yield what a generator yields, and wait before every step."""
    with contextlib.closing(generator):
        while True:
            with TURN:
                try:
                    value = next(generator)
                except StopIteration:
                    return
            yield value
