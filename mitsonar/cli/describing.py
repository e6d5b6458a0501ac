"""The commands that say what there is: scenes, describe."""
import shutil
import textwrap

from mitsonar.verbs import guide

from .arguments import Commands
from .completion import SCENES, complete_with
from .words import announce

NARROWEST, WIDEST = 40, 110        # columns; within these as wide as the terminal


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    listed = commands.add_parser("scenes", help="list the scenes that come with mitsonar")
    listed.set_defaults(run=_scenes)
    describe = commands.add_parser("describe", help="say which parameters a scene, or which attributes a plugin takes")
    name = describe.add_argument("name", metavar="SCENE|PLUGIN", nargs="?",
                                 help="a scene's name or file, or one such as sidescan")
    complete_with(name, SCENES)
    describe.add_argument("--markdown", action="store_true", help="print the reference page of all plugins")
    describe.set_defaults(run=_describe)


def _scenes(arguments):
    announce(guide.scenes())


def _describe(arguments):
    if arguments.markdown != (arguments.name is None):
        raise ValueError("describe takes the name of a scene or a plugin, or --markdown; give one of them")
    if arguments.markdown:
        from mitsonar.plugins import page

        return announce(page.markdown().rstrip("\n"))
    for number, (heading, text) in enumerate(guide.describe(arguments.name).paragraphs()):
        if number:
            announce("")
        _tell(heading, text)


def _tell(heading, text):
    """Print a line and, below and further in, what it means."""
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    announce(heading)
    for paragraph in text.split("\n"):
        for line in textwrap.wrap(paragraph, width, initial_indent="    ", subsequent_indent="    "):
            announce(line)
