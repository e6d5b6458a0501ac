"""Work on the device by one Python thread at a time.

Dr.Jit numbers its workers, and every Python thread that waits for the device is number 0. Small sums exist once for
each worker, so two threads that wait at the same time add to the same copy, and some additions are lost. If several
threads call mitsonar, their work is therefore done one after the other. Kernels use all cores anyway.

A forked process has none of its parent's threads, so that Dr.Jit would wait for workers that are gone. The workers
therefore end before a fork and start again in both processes. If the parent has other Python threads, workers may be at
work for one of them and cannot end; a GPU cannot be used after a fork at all. The child is refused then, instead of
waiting forever.

A worker without work looks for some for 20 ms before it sleeps, on a core that NumPy and SciPy need for what comes
after a kernel: an FFT on all cores takes 1.6 times as long. The workers therefore end before such work, which takes a
tenth of a millisecond (`workers_ended`).
"""
from __future__ import annotations

import contextlib
import functools
import os
import sys
import threading
from collections.abc import Callable, Generator
from types import GeneratorType
from typing import ParamSpec, TypeVar, cast

from .llvm import BackendError

P = ParamSpec("P")
R = TypeVar("R")
Y = TypeVar("Y")


class _Turn:
    """Lock that the thread which works on the device holds, and the state of the device around a fork."""

    def __init__(self):
        self._lock = threading.RLock()
        self._threads = 0                              # of Dr.Jit, while its workers are stopped
        self._lost = ""                                # the reason why this process cannot use the device

    def __enter__(self):
        self.check()
        self._lock.acquire()

    def __exit__(self, *_):
        self._lock.release()

    def check(self) -> None:
        """Raise `BackendError` in a forked process that cannot use the device."""
        if self._lost:
            raise BackendError(f"This process was forked from one that had {self._lost}, and cannot render. Start it "
                               'by spawn instead: DataLoader(..., multiprocessing_context="spawn"), or '
                               'multiprocessing.get_context("spawn").')

    def before_fork(self) -> None:
        """Stop Dr.Jit's workers if no other thread can be using them."""
        if len(sys._current_frames()) == 1:
            self._threads = _end_workers()

    def after_fork(self) -> None:
        """Start the workers again."""
        _start_workers(self._threads)
        self._threads = 0

    def in_child(self) -> None:
        """Start workers in the child, or note why it cannot use the device."""
        if (variant := _variant()) and not self._threads:
            self._lost = "used the GPU" if variant.startswith("cuda") else "rendered, and had other Python threads"
        self.after_fork()


def _variant() -> str:
    """Return Mitsuba's variant; empty if none is set."""
    variant = getattr(sys.modules.get("mitsuba"), "variant", None)
    return (variant and variant()) or ""


def _end_workers() -> int:
    """End Dr.Jit's workers, and return how many threads it had; 0 if it works on a GPU, or not yet."""
    if not _variant().startswith("llvm"):
        return 0
    import drjit as dr

    dr.sync_thread()
    threads = dr.thread_count()
    dr.set_thread_count(1)
    return threads


def _start_workers(threads: int) -> None:
    """Start Dr.Jit's workers again, if it had any."""
    if threads:
        import drjit as dr

        dr.set_thread_count(threads)


@contextlib.contextmanager
def workers_ended() -> Generator[int, None, None]:
    """End Dr.Jit's workers during work of more than some milliseconds on the host; small kernels may run in it.

    Yields
    ------
    int
        Threads that the host may use.
    """
    import drjit as dr

    threads = _end_workers()
    try:
        yield threads or dr.thread_count()
    finally:
        _start_workers(threads)


@contextlib.contextmanager
def at_least_two_threads() -> Generator[None, None, None]:
    """Start a second thread of Dr.Jit where there is one alone, while Mitsuba reads or writes EXR.

    With one thread it waits forever for another.
    """
    import drjit as dr

    alone = dr.thread_count() < 2
    if alone:
        dr.set_thread_count(2)
    try:
        yield
    finally:
        if alone:
            dr.set_thread_count(1)


TURN = _Turn()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=TURN.before_fork, after_in_parent=TURN.after_fork, after_in_child=TURN.in_child)


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
