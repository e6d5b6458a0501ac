"""What a command says beside its results: files it wrote, warnings, and that it was interrupted."""
import os
import signal
import sys
from pathlib import Path


class InterruptSignals:
    """Let Ctrl-C and a request to terminate end the command by the same way, and remember which of them came."""

    active: "InterruptSignals | None" = None            # those of the command that runs

    def __enter__(self):
        self.received, self.before = None, {}
        self.left: Path | None = None          # an unfinished file that the same command goes on with
        InterruptSignals.active = self
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:                 # whoever started us wants it ignored
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
        """Say that the command was interrupted, and end it, or give its exit code where no signal came."""
        for number in self.before:
            signal.signal(number, signal.SIG_IGN)      # a second Ctrl-C shall not break into the last words
        after_echo = "\n" if self.received == signal.SIGINT and sys.stderr.isatty() else ""     # the terminal's ^C
        kept = self.left is not None and self.left.exists()
        left = f"{self.left} is left, and the same command goes on with it" if kept else "no unfinished file is left"
        print(f"{after_echo}mitsonar: interrupted; {left}", file=sys.stderr, flush=True)
        if self.received is None:
            return 128 + signal.SIGINT
        # Python's orderly end crashes on a library whose import was interrupted
        os._exit(128 + self.received)


def end_if_interrupted() -> None:
    """Interrupt the command once more if it goes on after a signal: libraries may swallow what that raised."""
    if InterruptSignals.active is not None and InterruptSignals.active.received:
        raise KeyboardInterrupt


def announce(path: object) -> None:
    """Print the name of a file that was written; a closed output is no error, the file stays."""
    try:
        print(path, flush=True)
    except OSError:
        mute()


def mute() -> None:
    """Send what is left to print to nowhere, else Python complains about it when it ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def warn(message: object, *_: object) -> None:
    """Print a warning as one sentence."""
    print(f"mitsonar: {message}", file=sys.stderr)
