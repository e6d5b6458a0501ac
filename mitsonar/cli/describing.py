"""The commands that describe scenes, plugins and presets: scenes, describe."""
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
    describe = commands.add_parser("describe", help="list the parameters of a scene, the attributes of a plugin, or "
                                                    "the figures of a preset with their sources")
    add_file(describe, "name", metavar="SCENE|PLUGIN|PRESET", nargs="?", shipped=True,
             help="name or file of a scene, or name of a plugin, such as sidescan, or of a preset, such as "
                  "oculus_m750d; instruments lists the presets of instruments")
    describe.add_argument("--markdown", action="store_true",
                          help="print the reference page of all plugins, or with the name instruments their page")
    describe.set_defaults(run=_describe)


def _describe(arguments):
    if arguments.markdown:
        from mitsonar.plugins import instruments, page

        if arguments.name not in (None, instruments.LIST):
            raise ValueError(f"describe --markdown takes no name but {instruments.LIST}; leave {arguments.name} or "
                             "--markdown out")
        return announce((instruments if arguments.name else page).markdown().rstrip("\n"))
    if arguments.name is None:
        raise ValueError("describe takes the name of a scene, a plugin or a preset, or --markdown; give one of them")
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    for number, (heading, text) in enumerate(guide.describe(arguments.name).paragraphs()):
        if number:
            announce("")
        announce(heading)
        for paragraph in text.split("\n"):
            for line in textwrap.wrap(paragraph, width, initial_indent="    ", subsequent_indent="    "):
                announce(line)
