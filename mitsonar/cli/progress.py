"""Progress of a command, and the expected time of a long one."""
import datetime
import sys
import time

from .words import end_if_interrupted

QUIET_SECONDS = 2.0                # no progress is shown before
LINE_SECONDS = 10.0                # between lines, without a terminal
SLOW = 0.1                         # [1/s]; below, the rate is shown per hour
WORTH_SAYING = 10.0                # [s]; a shorter run needs no warning


class Progress:
    """Progress of a longer run: number done, rate and time left.

    Rate and time left count from the first call, because the command loads and compiles before it.
    """

    def __init__(self, unit: str = "pings", verb: str = "rendering", *, warm_up: int = 1, at_most: bool = False):
        self.unit, self.verb, self.left = unit, verb, "at most {} left" if at_most else "{} left"
        self.start = self.last_line = time.monotonic()
        self.begun, self.warm_up = (0.0, self.start), warm_up
        self.bar = self.task = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, done: float, total: float, failed: int = 0) -> None:
        end_if_interrupted()
        now = time.monotonic()
        if not done:
            return
        if self.warm_up > 0:
            self.begun, self.warm_up = (done, now), self.warm_up - 1
        if now - self.start < QUIET_SECONDS:
            return
        pace, (before, since) = "timing the next", self.begun
        if done > before and now > since:
            rate = (done - before) / (now - since)
            often = f"{rate:.1f} {self.unit}/s" if rate > SLOW else f"{rate * 3600:.0f} {self.unit}/h"
            pace = f"{often}, {self.left.format(datetime.timedelta(seconds=round((total - done) / rate)))}"
        pace += f", {failed} failed" if failed else ""
        count = f"{done:.2f}".rstrip("0").rstrip(".")          # hundredths of the ping that is under way
        if not sys.stderr.isatty():
            if now - self.last_line > LINE_SECONDS:
                self.last_line = now
                print(f"{count} of {total} {self.unit}, {pace}", file=sys.stderr)
        elif self.bar is None or self.task is None:
            self._open(done, total, count, pace)
        else:
            self.bar.update(self.task, completed=done, count=count, pace=pace)

    def _open(self, done, total, count, pace):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn

        self.bar = Progress(TextColumn(self.verb), BarColumn(), TextColumn("{task.fields[count]}/{task.total}"),
                            TextColumn(f"{self.unit}, {{task.fields[pace]}}"), console=Console(stderr=True),
                            transient=True)
        self.task = self.bar.add_task(self.unit, completed=done, total=total, count=count, pace=pace)
        self.bar.start()


def long_run(began: float, count: int) -> str:
    """Return the expected time of `count` pings, of which the first began at `began` [s]; empty if it is short."""
    seconds = (time.monotonic() - began) * count
    if seconds <= WORTH_SAYING:
        return ""
    for length, unit in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * length:
            return f"at most about {seconds / length:.2g} {unit}"
    return f"at most about {seconds:.0f} s"
