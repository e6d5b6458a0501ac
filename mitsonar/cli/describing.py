"""The commands that say what there is: scenes, describe."""
import shutil
import textwrap

from ..io import scene_words, scenes
from ..spelling import meant
from .arguments import Commands
from .completion import SCENES, complete_with
from .words import announce

__all__ = ["add"]

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
    names = scenes.shipped()
    column = max(map(len, names)) + 2
    for name in names:
        line = scene_words.described(scenes.find(name))[0].partition(". ")[0].rstrip(".")
        announce(f"{name:{column}}{textwrap.shorten(line, WIDEST - column, placeholder=' ...')}")


def _describe(arguments):
    from ..plugins import page, reference

    name = arguments.name
    if arguments.markdown != (name is None):
        raise ValueError("describe takes the name of a scene or a plugin, or --markdown; give one of them")
    if arguments.markdown:
        return announce(page.markdown().rstrip("\n"))
    if name in reference.plugins():
        _plugin(name)
        if name not in scenes.shipped():
            return
        announce("")                                   # a scene of that name is described as well
    try:
        path = scenes.find(name)
    except FileNotFoundError:
        known = [*scenes.shipped(), *reference.plugins()]
        raise ValueError(f"there is no scene or plugin {name!r}{meant(name, known)}; give the path of a scene, or one "
                         f"of: {', '.join(known)}") from None
    _scene(name, path)


def _scene(name, path):
    heading, parameters = scene_words.described(path)
    _tell(name, heading)
    for one in parameters:
        announce("")
        _tell(f"-D {one.name}={one.default}", one.comment or "; ".join(dict.fromkeys(map(_use, one.uses))))


def _use(use):
    """What a parameter is for, by the attribute that it becomes."""
    from ..plugins import reference

    kind, label, name = use
    declared = reference.attributes(kind) if kind in reference.plugins() else []
    known = {known: one for one in declared for known in (one.name, one.formerly)}
    place = f"{name} of {label or kind}" if name else label or kind
    if name not in known:
        return place
    return f"{place}, {reference.expected(known[name])}: {reference.plain(known[name].text)}"


def _plugin(name):
    from ..plugins import reference

    _tell(f'<{reference.kind_of(name)} type="{name}">', reference.title(name))
    for one in reference.attributes(name):
        announce("")
        default = {"": "", "needed": ", needed"}.get(one.shown_default, f", default {one.shown_default}")
        former = f"; formerly {one.formerly}" if one.formerly else ""
        _tell(reference.plain(f"{one.name}: {reference.expected(one)}{default}"), reference.plain(one.text) + former)


def _tell(heading, text):
    """Print a line and, below and further in, what it means."""
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    announce(heading)
    for line in textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="    "):
        announce(line)
