"""Handle of a separate process that renders."""
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from typing import IO, Any, cast

START = ("import json, sys; sys.path[:] = json.loads(sys.argv[1]); from mitsonar.sweep import worker; "
         "worker.main(int(sys.argv[2]))")


class Renderer:
    """Process that renders, started with the first job and again after it has died."""

    def __init__(self, threads: int, place: str):
        self.threads, self.place = threads, place
        self._process: subprocess.Popen[str] | None = None
        self._errors: IO[bytes] | None = None          # error output of the process

    def __call__(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a job (see `mitsonar.sweep.worker`), with ``error`` if it failed."""
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
            # a session of its own keeps the terminal's Ctrl-C away
            self._process = subprocess.Popen([sys.executable, "-c", START, json.dumps(path), str(self.threads)],
                                             stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors,
                                             text=True, cwd=self.place, start_new_session=True)
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
