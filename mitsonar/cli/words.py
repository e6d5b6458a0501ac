"""Messages of a command beside its results: names of written files, warnings and interruptions."""
import os
import signal
import sys
from pathlib import Path


class InterruptSignals:
    """Context in which Ctrl-C and SIGTERM both end the command; `received` is the signal that arrived."""

    active: "InterruptSignals | None" = None            # signals of the running command

    def __enter__(self):
        self.received, self.before = None, {}
        self.left: Path | None = None          # an unfinished file that the same command continues
        InterruptSignals.active = self
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:                 # the parent process ignores it
                self.before[number] = signal.signal(number, self._stop)
        return self

    def __exit__(self, *_):
        InterruptSignals.active = None
        for number, handler in self.before.items():
            signal.signal(number, handler)

    def _stop(self, number, _frame):
        self.received = number
        raise KeyboardInterrupt

    def end(self) -> int:
        """Report the interruption and end the process; return the exit code if there was no signal."""
        for number in self.before:
            signal.signal(number, signal.SIG_IGN)      # a second Ctrl-C must not break into the message
        after_echo = "\n" if self.received == signal.SIGINT and sys.stderr.isatty() else ""     # the terminal's ^C
        kept = self.left is not None and self.left.exists()
        left = f"{self.left} is left, and the same command goes on with it" if kept else "no unfinished file is left"
        print(f"{after_echo}mitsonar: interrupted; {left}", file=sys.stderr, flush=True)
        if self.received is None:
            return 128 + signal.SIGINT
        # Python's orderly end crashes on a library whose import was interrupted
        os._exit(128 + self.received)


def leave_if_interrupted(path: str | Path) -> None:
    """Name the unfinished file from which the same command continues after an interruption."""
    if InterruptSignals.active is not None:
        InterruptSignals.active.left = Path(path)


def end_if_interrupted() -> None:
    """Raise KeyboardInterrupt again after a signal: libraries may swallow the first one."""
    if InterruptSignals.active is not None and InterruptSignals.active.received:
        raise KeyboardInterrupt


def announce(path: object) -> None:
    """Print the name of a written file; a closed output is not an error, because the file stays."""
    try:
        print(path, flush=True)
    except OSError:
        mute()


def mute() -> None:
    """Discard further output; otherwise Python reports the closed output when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def warn(message: object, *_: object) -> None:
    """Print a warning as one sentence."""
    print(f"mitsonar: {message}", file=sys.stderr)
