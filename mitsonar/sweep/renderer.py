"""A process of its own that renders, as whoever started it sees it."""
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile

__all__ = ["Renderer"]

START = ("import json, sys; sys.path[:] = json.loads(sys.argv[1]); from mitsonar.sweep import worker; "
         "worker.main(int(sys.argv[2]))")


class Renderer:
    """Starts a process when there is something to do, and again when it has died.

    Parameters
    ----------
    threads : int
        Of the process, at least 2.
    place : str
        The folder it runs in, where files are found that are not beside the scene.
    """

    def __init__(self, threads, place):
        self.threads, self.place = threads, place
        self._process = self._words = None

    def __call__(self, job):
        """Do a job (a dict, see `mitsonar.sweep.worker`) and give the answer, which has an ``error`` if it failed."""
        try:
            process = self._running()
            process.stdin.write(json.dumps(job) + "\n")
            process.stdin.flush()
            answer = process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if answer.endswith("\n"):
            return json.loads(answer)
        return {"error": self._last_words(), "full": False, "seconds": 0.0, "warnings": []}

    def kill(self):
        """End the process, whatever it does."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdout, self._process.stdin, self._words):
                with contextlib.suppress(OSError):     # a line that it did not take any more
                    stream.close()

    def _running(self):
        if self._process is None or self._process.poll() is not None:
            self.kill()
            path = [os.path.abspath(entry) for entry in sys.path]
            self._words = tempfile.TemporaryFile()
            # in a session of its own, else the terminal's Ctrl-C reaches it
            self._process = subprocess.Popen([sys.executable, "-c", START, json.dumps(path), str(self.threads)],
                                             stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._words,
                                             text=True, cwd=self.place, start_new_session=True)
        return self._process

    def _last_words(self):
        """Say how the process ended, with the last line it printed."""
        code = self._process.wait()
        self._words.seek(max(0, self._words.seek(0, os.SEEK_END) - 10_000))
        lines = self._words.read().decode(errors="replace").strip().splitlines()
        how = f"by signal {-code} ({signal.strsignal(-code)})" if code < 0 else f"with exit code {code}"
        return f"the process that rendered it ended {how}" + (f": {lines[-1][:300]}" if lines else "")
