"""Arguments that commands share: the parser, scenes, ``-D KEY=VALUE``, seeds, threads, and names of output files."""
import argparse
import re
import sys
from collections.abc import Sequence
from typing import Any, NoReturn, TypeAlias

from mitsonar.device.files import check_writable, checked_suffix
from mitsonar.device.spelling import meant

from .completion import add_file

MOST_THREADS = 1024
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"      # to which each command is added
GAINS = ("seabed", "target", "recorder", "counts", "none")


class Parser(argparse.ArgumentParser):
    """Argument parser that raises ValueError, as every other check does."""

    _words: Sequence[str] = ()         # of the last command line

    def error(self, message: str) -> NoReturn:
        choice = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)$", message)
        hint = meant(choice[1], re.findall(r"[\w.-]+", choice[2])) if choice else ""
        stray = self._stray_values()
        hint += f"; a parameter has -D before it: {' '.join(f'-D {word}' for word in stray)}" if stray else ""
        raise ValueError(f"{message}{hint}; see {self.prog} --help")

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]  one form of several
            self, args: Sequence[str] | None = None,
            namespace: argparse.Namespace | None = None) -> tuple[argparse.Namespace, list[str]]:
        """Parse the words, and keep them for the hint in `error`."""
        self._words = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(self._words, argparse.Namespace() if namespace is None else namespace)

    def _stray_values(self) -> list[str]:
        """Return the words KEY=VALUE that lack the -D before them."""
        lists = any(action.nargs in ("*", "+") for action in self._get_positional_actions())
        if "-D" not in self._option_string_actions or lists:
            return []
        return [word for before, word in zip(["", *self._words], self._words)
                if re.match(r"[A-Za-z_]\w*=", word) and not before.startswith("-")]

    def parse_args(  # pyright: ignore[reportIncompatibleMethodOverride]  one form of two
            self, args: Sequence[str] | None = None,
            namespace: argparse.Namespace | None = None) -> argparse.Namespace:
        """Parse all words, and suggest a known option for an unknown one."""
        parsed, rest = self.parse_known_args(args, namespace)
        behind = getattr(parsed, "behind_options", None)       # name of a list that may continue after the options
        if behind is not None and not any(word.startswith("-") for word in rest):
            setattr(parsed, behind, [*getattr(parsed, behind), *rest])
            rest = []
        if rest:
            commands = next(action for action in self._actions if isinstance(action, argparse._SubParsersAction))
            command = commands.choices[parsed.command]
            hint = meant(rest[0].partition("=")[0], command._option_string_actions)
            command.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return parsed


def add_scene(command: argparse.ArgumentParser, also: str = "", sensors: str = "") -> None:
    """Add a scene, its parameters, seed, threads and sonar; ``also`` and ``sensors`` extend the help."""
    add_file(command, "scene", shipped=True,
             help=f"Mitsuba XML file, or the name of a scene that comes with mitsonar{also}")
    add_parameters(command)
    command.add_argument("--seed", type=whole, default=0, metavar="N", help="random seed; default: 0")
    add_threads(command)
    command.add_argument("--sensor", default=0, metavar="ID",
                         help=f"id of one of the scene's sonars{sensors}; default: the first")


def add_parameters(command: argparse._ActionsContainer) -> None:
    """Add ``-D KEY=VALUE``."""
    command.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                         help="value for a $parameter of the scene; repeatable")


def add_threads(command: argparse._ActionsContainer) -> None:
    """Add ``--threads``."""
    command.add_argument("--threads", type=whole, metavar="N", help="threads that render; default: one per core")


def add_gain(command: argparse.ArgumentParser, default: str, text: str = "display gain over range",
             choices: Sequence[str] = GAINS) -> None:
    """Add ``--tvg``."""
    command.add_argument("--tvg", default=default, choices=choices, help=f"{text}; default: {default}")


def parameters(arguments: argparse.Namespace) -> dict[str, str]:
    """Return the values of ``-D`` by name, as text."""
    values = {}
    for text in arguments.parameters:
        key, equals, value = text.partition("=")
        if not (equals and key):
            raise ValueError(f"-D takes KEY=VALUE, got {text!r}; for example -D pings=200")
        if key in values:
            raise ValueError(f"-D {key} is given twice, as {values[key]} and {value}; leave one out")
        values[key] = value
    return values


def gain(arguments: argparse.Namespace) -> Any:
    """Return the display gain of ``--tvg``."""
    return None if arguments.tvg == "none" else arguments.tvg


def check_output(path: str, suffixes: Sequence[str], advice: str = "") -> str:
    """Check folder and suffix of an output file before the work begins; return the suffix."""
    check_writable(path)
    return checked_suffix(path, suffixes, advice)


def check_picture(path: str | None) -> None:
    """Check the name of a picture, if there is one."""
    if path is not None:
        from mitsonar.plots.canvas import file_format

        file_format(path)
        check_writable(path)


def set_up(threads: int | None) -> None:
    """Silence Mitsuba's log below errors, and set the number of threads."""
    import drjit as dr
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    if threads is None:
        return
    if not 1 <= threads <= MOST_THREADS:
        raise ValueError(f"--threads is {threads}; give 1 to {MOST_THREADS}")
    from mitsonar.scene.loading import prepare

    prepare()
    try:
        dr.set_thread_count(threads)
    except RuntimeError as error:
        raise ValueError(f"--threads is {threads}, more than this machine starts: {error}; give fewer") from None


def whole(text: str) -> int:
    """Read a whole number."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


def number(text: str) -> float:
    """Read a number."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
