"""The commands that describe scenes and plugins: scenes, describe."""
import shutil
import textwrap

from mitsonar.verbs import guide

from .arguments import Commands
from .completion import add_file
from .words import announce

NARROWEST, WIDEST = 40, 110        # columns; within these as wide as the terminal


def add(commands: Commands) -> None:
    """Add the commands to the parser's."""
    listed = commands.add_parser("scenes", help="list the scenes that come with mitsonar")
    listed.set_defaults(run=lambda _: announce(guide.scenes()))
    describe = commands.add_parser("describe", help="list the parameters of a scene or the attributes of a plugin")
    add_file(describe, "name", metavar="SCENE|PLUGIN", nargs="?", shipped=True,
             help="name or file of a scene, or name of a plugin, such as sidescan")
    describe.add_argument("--markdown", action="store_true", help="print the reference page of all plugins")
    describe.set_defaults(run=_describe)


def _describe(arguments):
    if arguments.markdown != (arguments.name is None):
        raise ValueError("describe takes the name of a scene or a plugin, or --markdown; give one of them")
    if arguments.markdown:
        from mitsonar.plugins import page

        return announce(page.markdown().rstrip("\n"))
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    for number, (heading, text) in enumerate(guide.describe(arguments.name).paragraphs()):
        if number:
            announce("")
        announce(heading)
        for paragraph in text.split("\n"):
            for line in textwrap.wrap(paragraph, width, initial_indent="    ", subsequent_indent="    "):
                announce(line)
