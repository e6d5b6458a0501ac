"""Command line.

Exit codes: 0 done; 1 if `validate` finds too large an error, `gradient-check` finds a wrong gradient or cannot decide,
`doctor` cannot render, or renders of a `sweep` failed; 2 for errors that the user can mend; 128 + n after signal n (130
for Ctrl-C). A command that is refused or interrupted leaves no file, nor half of one.
"""
import signal
import sys
import warnings
from collections.abc import Sequence

from mitsonar.device.extras import MissingExtra
from mitsonar.device.sentences import sentence
from mitsonar.version import __version__

from . import (
    describing,
    exporting,
    fitting,
    focusing,
    labels,
    machine,
    planning,
    rendering,
    results,
    sounding,
    sweep,
)
from .arguments import Parser
from .completion import SHELLS, Completion
from .words import InterruptSignals, mute, warn

# in the order of the help
GROUPS = (rendering, focusing, sounding, describing, sweep, results, exporting, planning, fitting, labels, machine)


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
            if isinstance(error, MissingExtra):        # which `mitsonar.__main__` may mend
                raise
            if not isinstance(error, (ValueError, OSError, MemoryError)):
                raise
            print(f"mitsonar: {sentence(error)}", file=sys.stderr)
            return 2


def _parser():
    parser = Parser(prog="mitsonar", description="Render sonar images of Mitsuba scenes.",
                    epilog="Begin with `mitsonar demo`; `mitsonar COMMAND --help` lists the options of a command.")
    parser.add_argument("-v", "--version", action="version", version=f"mitsonar {__version__}")
    parser.add_argument("--print-completion", action=Completion, metavar="SHELL", choices=SHELLS,
                        help="print a script that completes commands and options in bash or zsh")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", dest="command", parser_class=Parser)
    for group in GROUPS:
        group.add(commands)
    return parser
