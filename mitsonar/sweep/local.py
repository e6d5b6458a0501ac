"""Pool of rendering processes on this machine."""
import os
import queue
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

from .renderer import Renderer

THREADS = 2                        # default per process: small renders gain most from more processes
MOST_PROCESSES, MOST_THREADS = 1024, 1024


def cores() -> int:
    """Return the number of cores that our processes may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def shares(processes: int | None, threads: int | None) -> tuple[int, int]:
    """Return the numbers of processes and of threads per process; by default they share all cores."""
    if processes is None:
        processes = max(1, cores() // (threads or THREADS))
    if not 1 <= processes <= MOST_PROCESSES:
        raise ValueError(f"{processes} processes were asked for; give 1 to {MOST_PROCESSES}")
    if threads is None:
        threads = max(2, cores() // processes)
    if not 2 <= threads <= MOST_THREADS:
        raise ValueError(f"{threads} threads were asked for; give 2 to {MOST_THREADS} (Mitsuba needs two even on "
                         "one core)")
    return processes, threads


class Local:
    """Pool of processes on this machine; a process that dies loses only its own render."""

    def __init__(self, processes: int, threads: int, place: str):
        self.capacity = processes
        self._renderers = [Renderer(threads, place) for _ in range(processes)]
        self._free = queue.SimpleQueue()
        for renderer in self._renderers:
            self._free.put(renderer)
        self._waiting, self._futures = ThreadPoolExecutor(processes), []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._waiting.shutdown(wait=False, cancel_futures=True)
        while True:                                    # a process that is just starting is killed in the next round
            for renderer in self._renderers:
                renderer.kill()
            if not wait(self._futures, timeout=0.1).not_done:
                return

    def submit(self, job: dict[str, Any]) -> Future:
        """Submit a job and return the future of its answer."""
        self._futures = [future for future in self._futures if not future.done()]
        self._futures.append(self._waiting.submit(self._render, job))
        return self._futures[-1]

    def check(self) -> None:
        """Accept: a local pool needs no check."""

    def _render(self, job):
        renderer = self._free.get()
        try:
            return renderer(job)
        finally:
            self._free.put(renderer)
