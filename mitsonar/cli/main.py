"""The command line: render, signals, demo, focus, soundings, like, scenes, describe, sweep, plot, video, raster,
convert, mosaic, plan, published, validate, gradient-check, fit, labels, doctor.

Exit codes: 0 done, 1 where `validate` finds too large an error, `gradient-check` a wrong gradient, or renders of a
`sweep` failed, 2 for what the user can mend, 128 + n where signal n ended it (130 for Ctrl-C). What is refused or
interrupted leaves no file, nor half of one.
"""
import signal
import sys
import warnings
from collections.abc import Sequence

from mitsonar.device.sentences import sentence
from mitsonar.version import __version__

from . import (
    describing,
    exporting,
    fitting,
    focusing,
    gradient_checking,
    gridding,
    labels,
    machine,
    planning,
    raster,
    recorded,
    rendering,
    results,
    sounding,
    sweep,
)
from .arguments import Parser
from .completion import SHELLS, Completion
from .words import InterruptSignals, mute, warn

# in the order of the help
GROUPS = (rendering, focusing, sounding, recorded, describing, sweep, results, raster, exporting, gridding, planning,
          gradient_checking, fitting, labels, machine)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    with InterruptSignals() as signals:
        try:
            arguments = _parser().parse_args(argv)
            with warnings.catch_warnings():
                warnings.showwarning = warn
                return arguments.run(arguments) or 0
        except BrokenPipeError:
            mute()
            return 128 + signal.SIGPIPE
        except (Exception, KeyboardInterrupt) as error:
            # between Mitsuba and Python an interrupt may turn into any other exception
            if signals.received or isinstance(error, KeyboardInterrupt):
                return signals.end()
            if not isinstance(error, (ValueError, OSError, MemoryError)):
                raise
            print(f"mitsonar: {sentence(error)}", file=sys.stderr)
            return 2


def _parser():
    parser = Parser(prog="mitsonar", description="Render sonar images of Mitsuba scenes.")
    parser.add_argument("-v", "--version", action="version", version=f"mitsonar {__version__}")
    parser.add_argument("--print-completion", action=Completion, metavar="SHELL", choices=SHELLS,
                        help="a script that completes commands and options: bash or zsh")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command", parser_class=Parser)
    for group in GROUPS:
        group.add(commands)
    return parser
