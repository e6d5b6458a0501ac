"""Processes that render, and a pool of them on this machine."""
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import IO, Any, cast

from mitsonar.device.machine import cores, memory

THREADS = 1                        # default per process: as many processes as cores render 1.3 to 1.45 times as fast
MEMORY = 1e9                       # [bytes], of a process that renders a bed of some million triangles
MOST_PROCESSES, MOST_THREADS = 1024, 1024
START = ("import json, sys; sys.path[:] = json.loads(sys.argv[1]); from mitsonar.sweep.pools import worker; "
         "worker.main(int(sys.argv[2]))")


def shares(processes: int | None, threads: int | None) -> tuple[int, int]:
    """Return the numbers of processes and of threads per process; by default they share all cores."""
    if processes is None:
        processes = max(1, int(min(cores() // (threads or THREADS), memory() / MEMORY)))
    if not 1 <= processes <= MOST_PROCESSES:
        raise ValueError(f"{processes} processes were asked for; give 1 to {MOST_PROCESSES}")
    if threads is None:
        threads = max(1, cores() // processes)
    if not 1 <= threads <= MOST_THREADS:
        raise ValueError(f"{threads} threads were asked for; give 1 to {MOST_THREADS}")
    return processes, threads


class Renderer:
    """Process that renders, started with the first job and again after it has died."""

    def __init__(self, threads: int, place: str):
        self.threads, self.place = threads, place
        self._process: subprocess.Popen[str] | None = None
        self._errors: IO[bytes] | None = None          # error output of the process

    def __call__(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a job (see `mitsonar.sweep.pools.worker`), with ``error`` if it failed."""
        try:
            questions, answers = self._running()
            questions.write(json.dumps(job) + "\n")
            questions.flush()
            answer = answers.readline()
        except BrokenPipeError:
            answer = ""
        if answer.endswith("\n"):
            return json.loads(answer)
        return {"error": self._last_words(), "full": False, "seconds": 0.0, "warnings": []}

    def kill(self) -> None:
        """End the process immediately."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in filter(None, (self._process.stdout, self._process.stdin, self._errors)):
                with contextlib.suppress(OSError):     # an unread line
                    stream.close()

    def _running(self) -> tuple[IO[str], IO[str]]:
        """Return the pipes to and from the process, started if necessary."""
        if self._process is None or self._process.poll() is not None:
            self.kill()
            path = [os.path.abspath(entry) for entry in sys.path]
            self._errors = tempfile.TemporaryFile()
            # a session of its own keeps the terminal's Ctrl-C away; threads of OpenBLAS wait for work by spinning
            self._process = subprocess.Popen([sys.executable, "-c", START, json.dumps(path), str(self.threads)],
                                             stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
                                             text=True, cwd=self.place, start_new_session=True,
                                             env={"OPENBLAS_NUM_THREADS": "1", **os.environ})
        return cast(IO[str], self._process.stdin), cast(IO[str], self._process.stdout)

    def _last_words(self):
        """Return an error on the end of the process, with its last line of output."""
        if self._process is None or self._errors is None:
            return "no process was started to render it"
        code = self._process.wait()
        self._errors.seek(max(0, self._errors.seek(0, os.SEEK_END) - 10_000))
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        how = f"by signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"with exit code {code}"
        return f"the process that rendered it ended {how}" + (f": {lines[-1][:300]}" if lines else "")


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
            # `wait` never ends for futures that were cancelled before they began
            if not wait([future for future in self._futures if not future.done()], timeout=0.1).not_done:
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
