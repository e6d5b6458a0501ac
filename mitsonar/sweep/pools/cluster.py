"""Pool of renders on a Dask cluster: an existing cluster, or workers started here for the sweep.

Dask transports jobs and answers. Each worker renders in separate processes, so that a crashed render costs no worker
and long kernels do not block its replies. Workers must see the same files as the runner.

Whoever can connect to a scheduler or a worker can run any code on it. Those started here use TLS and accept only a key
that is made for the sweep and kept in memory. Dask cannot omit their HTTP servers, which serve no pages.
"""
import errno
import logging
import os
import queue
import secrets
import signal
import time
from typing import TYPE_CHECKING, Any

from mitsonar.device.extras import MissingExtra

from .local import THREADS, Renderer, shares

if TYPE_CHECKING:
    import distributed

PATIENCE = 60                      # [s] to wait for a scheduler and its first worker
COUNT_SECONDS = 5.0                # [s] between counts of workers
SEMAPHORES = " (if the disk is not full, /dev/shm may be, which holds their semaphores)"
AHEAD = 2                          # queued jobs per thread
_FREE = queue.SimpleQueue()        # idle renderers of a Dask worker


class Cluster:
    """Pool of Dask workers."""

    def __init__(self, threads: int | None, place: str, folder: str, *, scheduler: str | None = None,
                 workers: int | None = None):
        try:
            import distributed
        except ImportError:
            raise MissingExtra("Dask is not installed", "cluster", "sweep without --workers and --scheduler") from None

        self.place, self.folder, self._log_levels = place, folder, _silence()
        self._own: Any = None                          # Dask lacks usable type annotations
        self._client: Any = None
        self._threads, self._counted, self._seen = 0, -COUNT_SECONDS, time.monotonic()
        try:
            if scheduler is None:
                workers, self.threads = shares(workers, threads)
                self._own = self._local_cluster(distributed, workers)
                self._client = distributed.Client(self._own, set_as_default=False)
            else:
                self.threads = shares(1, threads or THREADS)[1]
                self._client = self._connect(distributed, scheduler)
            self._check_folder()
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            if self._client is not None:
                if self._own is None and self._client.status == "running":
                    self._client.run(_release, on_error="ignore")
                self._client.close()
            if self._own is not None:
                self._own.close()
        finally:
            for logger, level in self._log_levels:
                logger.setLevel(level)

    @property
    def capacity(self) -> int:
        """Return the number of jobs to keep submitted; workers may come and go."""
        if time.monotonic() - self._counted > COUNT_SECONDS:
            self._threads, self._counted = sum(self._client.nthreads().values()), time.monotonic()
            self._seen = self._counted if self._threads else self._seen
        return AHEAD * max(1, self._threads)

    def submit(self, job: dict[str, Any]) -> "distributed.Future":
        """Submit a job and return the future of its answer."""
        return self._client.submit(_render, job, self.threads, self.place, pure=False, retries=1)

    def check(self) -> None:
        """Raise `ValueError` if the scheduler or all workers are gone."""
        if self._client.status != "running":
            raise ValueError("the Dask scheduler is gone; finished renders are kept: run the sweep again later")
        if time.monotonic() - self._seen > PATIENCE and not self._threads:
            raise ValueError(f"the Dask cluster has had no workers for {PATIENCE} seconds; finished renders are kept: "
                             "run the sweep again when it has workers")

    def _local_cluster(self, distributed, workers):
        try:
            return _start(distributed, workers)
        except (OSError, RuntimeError) as error:
            chain: list[BaseException] = [error]                   # Dask wraps the cause more than once
            while (inner := chain[-1].__cause__ or chain[-1].__context__) is not None:
                chain.append(inner)
            error = next((cause for cause in chain if isinstance(cause, OSError)), error)
            raise ValueError(f"the Dask workers could not be started: {' '.join(str(error).split())[:300]}"
                             f"{SEMAPHORES if getattr(error, 'errno', None) == errno.ENOSPC else ''}; sweep without "
                             "--workers, or with --processes") from None

    def _connect(self, distributed, scheduler):
        try:
            client = distributed.Client(scheduler, timeout=PATIENCE / 6, set_as_default=False)
            try:
                client.wait_for_workers(1, timeout=PATIENCE)
            except BaseException:
                client.close()
                raise
        except (OSError, ValueError, TypeError) as error:          # no such host or address, or no reply
            reason = " ".join(str(error).split())[:300]
            raise ValueError(f"no Dask workers to be had at {scheduler}: {reason}; give the address of a scheduler "
                             "with workers, such as tcp://HOST:8786") from None
        return client

    def _check_folder(self):
        """Check that every worker sees a file that was just written."""
        name = os.path.join(self.folder, f".workers.{secrets.token_hex(4)}.exr")      # removed like other leftovers
        with open(name, "w", encoding="utf-8"):
            pass
        try:
            seen = self._client.run(os.path.exists, name)
        finally:
            os.unlink(name)
        blind = sorted(address for address, exists in seen.items() if exists is not True)
        if blind:
            raise ValueError(f"the folder {self.folder} is not the same on the Dask workers ({blind[0]} does not see "
                             "a file written there); give a folder by -o that all workers share")


def _start(distributed, workers):
    """Start a scheduler and workers that no other user of this machine can use or read."""
    import dask.config

    with dask.config.set({"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []}):
        return distributed.LocalCluster(n_workers=workers, threads_per_worker=1, processes=True,
                                        security=distributed.Security.temporary(), dashboard_address=None,
                                        scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                                        silence_logs=logging.CRITICAL, preload=[__name__])


def dask_setup(worker: "distributed.Worker") -> None:
    """Ignore Ctrl-C in a worker, since the runner handles it; Dask calls this in workers started here."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _silence():
    """Silence Dask's loggers and return their levels."""
    names = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]
    levels = [(logging.getLogger(name), logging.getLogger(name).level) for name in names]
    for logger, _ in levels:
        logger.setLevel(logging.CRITICAL)
    return levels


def _render(job, threads, place):
    """Render a job on a Dask worker, in an idle process or a new one."""
    try:
        renderer = _FREE.get_nowait()
        if (renderer.threads, renderer.place) != (threads, place):
            renderer.kill()
            renderer = Renderer(threads, place)
    except queue.Empty:
        renderer = Renderer(threads, place)
    try:
        return renderer(job)
    finally:
        _FREE.put(renderer)


def _release():
    """End the idle processes of a Dask worker."""
    while True:
        try:
            _FREE.get_nowait().kill()
        except queue.Empty:
            return
