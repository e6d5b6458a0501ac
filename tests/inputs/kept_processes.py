"""Processes that render, kept from one pool to the next: a sweep starts in two seconds what it then needs for one."""
import contextlib
from collections import defaultdict
from collections.abc import Iterator
from unittest import mock

from mitsonar.sweep.pools.local import Renderer


@contextlib.contextmanager
def kept_processes() -> Iterator[None]:
    """Keep idle processes when their pool ends; the next pool of as many threads in the same folder takes them."""
    idle, call, running, kill = defaultdict(list), Renderer.__call__, Renderer._running, Renderer.kill

    def working(self, job):
        self.busy = True
        try:
            return call(self, job)
        finally:
            self.busy = False

    def take(self):
        if self._process is None and idle[self.threads, self.place]:
            self._process, self._errors = idle[self.threads, self.place].pop()
        return running(self)

    def leave(self):
        if self._process is None or self._process.poll() is not None or self.busy:
            return kill(self)
        idle[self.threads, self.place].append((self._process, self._errors))
        self._process = self._errors = None

    try:
        with mock.patch.multiple(Renderer, __call__=working, _running=take, kill=leave):
            yield
    finally:
        for (threads, place), processes in idle.items():
            for process, errors in processes:
                renderer = Renderer(threads, place)
                renderer._process, renderer._errors = process, errors
                renderer.kill()
