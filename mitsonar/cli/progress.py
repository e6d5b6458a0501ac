"""How far a command has come."""
import datetime
import sys
import time

__all__ = ["Progress"]

QUIET_SECONDS = 2.0                # progress is shown on anything longer
LINE_SECONDS = 10.0                # where there is no terminal, a line this often


class Progress:
    """Show things done, things per second and time left once a run lasts longer than a moment."""

    def __init__(self, verb="rendering", things="pings"):
        self.verb, self.things = verb, things
        self.start = self.last_line = time.monotonic()
        self.bar = self.task = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, done, total):
        now = time.monotonic()
        if now - self.start < QUIET_SECONDS:
            return
        rate = done / (now - self.start)
        pace = f"{rate:.1f} {self.things}/s, {datetime.timedelta(seconds=round((total - done) / rate))} left"
        if not sys.stderr.isatty():
            if now - self.last_line > LINE_SECONDS:
                self.last_line = now
                print(f"{done} of {total} {self.things}, {pace}", file=sys.stderr)
        elif self.bar is None:
            self._open(done, total, pace)
        else:
            self.bar.update(self.task, completed=done, pace=pace)

    def _open(self, done, total, pace):
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

        self.bar = Progress(TextColumn(self.verb), BarColumn(), MofNCompleteColumn(),
                            TextColumn(f"{self.things}, {{task.fields[pace]}}"), console=Console(stderr=True),
                            transient=True)
        self.task = self.bar.add_task(self.things, completed=done, total=total, pace=pace)
        self.bar.start()
