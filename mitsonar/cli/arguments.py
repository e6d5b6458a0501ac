"""What the commands' arguments have in common: the parser, scenes, ``-D KEY=VALUE``, seeds and threads."""
import argparse
import re
import sys
from collections.abc import Sequence
from typing import NoReturn, TypeAlias

from mitsonar.device.spelling import meant

from .completion import SCENES, complete_with

MOST_THREADS = 1024
Commands: TypeAlias = "argparse._SubParsersAction[Parser]"      # what commands are added to


class Parser(argparse.ArgumentParser):
    """Argument parser whose complaints are errors like all others."""

    _words: Sequence[str] = ()         # that were parsed last

    def error(self, message: str) -> NoReturn:
        choice = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)$", message)
        hint = meant(choice[1], re.findall(r"[\w.-]+", choice[2])) if choice else ""
        stray = self._stray_values()
        hint += f"; a parameter has -D before it: {' '.join(f'-D {word}' for word in stray)}" if stray else ""
        raise ValueError(f"{message}{hint}; see {self.prog} --help")

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]  one form of several
            self, args: Sequence[str] | None = None,
            namespace: argparse.Namespace | None = None) -> tuple[argparse.Namespace, list[str]]:
        """Parse, and remember the words for what `error` says of them."""
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
        """Parse, and say of an unknown option which one may be meant."""
        found = argparse.Namespace() if namespace is None else namespace
        found, rest = self.parse_known_args(args, found)
        behind = getattr(found, "behind_options", None)                    # argparse takes none there into a list
        if behind is not None and not any(word.startswith("-") for word in rest):
            setattr(found, behind, [*getattr(found, behind), *rest])
            rest = []
        if rest:
            commands = next(action for action in self._actions if isinstance(action, argparse._SubParsersAction))
            command = commands.choices[found.command]
            hint = meant(rest[0].partition("=")[0], command._option_string_actions)
            command.error(f"unrecognized arguments: {' '.join(rest)}{hint}")
        return found


def add_scene(command: argparse.ArgumentParser, also: str = "") -> None:
    """Add what a command that loads a scene takes: the scene (or what ``also`` says), parameters, seed and threads."""
    scene = command.add_argument("scene", help="Mitsuba XML file, or the name of a scene that comes with mitsonar"
                                               f"{also}")
    complete_with(scene, SCENES)
    command.add_argument("-D", dest="parameters", action="append", default=[], metavar="KEY=VALUE",
                         help="value for a $parameter of the scene; repeatable")
    command.add_argument("--seed", type=whole, default=0, metavar="N", help="of all that is random; default: 0")
    command.add_argument("--threads", type=whole, metavar="N", help="worker threads, at least 2; default: one per core")


def parameters(arguments: argparse.Namespace) -> dict[str, str]:
    """Return the values of ``-D`` by name, as text."""
    values = {}
    for key, value in map(_key_value, arguments.parameters):
        if key in values:
            raise ValueError(f"-D {key} is given twice, as {values[key]} and {value}; leave one out")
        values[key] = value
    return values


def set_up(threads: int | None) -> None:
    """Silence what Mitsuba says beside its errors, and set the number of threads."""
    import drjit as dr
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    if threads is None:
        return
    if not 2 <= threads <= MOST_THREADS:
        raise ValueError(f"--threads is {threads}; give 2 to {MOST_THREADS} (Mitsuba needs two even on one core)")
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


def _key_value(text):
    key, equals, value = text.partition("=")
    if not (equals and key):
        raise ValueError(f"-D takes KEY=VALUE, got {text!r}; for example -D pings=200")
    return key, value
