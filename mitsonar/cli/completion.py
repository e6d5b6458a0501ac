"""Completion of commands, options, scenes and files in bash and zsh, by shtab."""
import argparse
from typing import Any, cast

from mitsonar.io.scene_files import scenes

SHELLS = ("bash", "zsh")
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files"}              # as shtab names them
SCENES = {"bash": "_mitsonar_scenes", "zsh": "_mitsonar_scenes"}       # files, and scenes that come with mitsonar
PREAMBLE = {
    "bash": """_mitsonar_scenes() {{
  compgen -W "{names}" -- "$1"
  _shtab_compgen_files "$1"
}}""",
    "zsh": """_mitsonar_scenes() {{
  _alternative "scenes:scene:({names})" "files:file:_files"
}}"""}


def add_file(command: argparse._ActionsContainer, *names: str, shipped: bool = False, **options: Any) -> None:
    """Add an argument that shells complete by names of files, and of shipped scenes where `shipped` is True."""
    setattr(command.add_argument(*names, **options), "complete", SCENES if shipped else FILES)


class Completion(argparse.Action):
    """Print the completion script of a shell, and end."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any,
                 option_string: str | None = None) -> None:
        import shtab

        names = " ".join(scenes.shipped())
        preamble = {shell: text.format(names=names) for shell, text in PREAMBLE.items()}
        print(shtab.complete(parser, values, preamble=cast(Any, preamble)))      # declared as text alone
        parser.exit()
