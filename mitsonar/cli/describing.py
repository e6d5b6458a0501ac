"""The commands that say what there is: scenes, describe."""
import shutil
import textwrap

from ..io import scene_words, scenes
from ..spelling import meant
from .completion import SCENES
from .words import announce

__all__ = ["add"]

NARROWEST, WIDEST = 40, 110        # columns; within these as wide as the terminal


def add(commands):
    """Add the commands to the parser's."""
    listed = commands.add_parser("scenes", help="list the scenes that come with mitsonar")
    listed.set_defaults(run=_scenes)
    describe = commands.add_parser("describe", help="say which parameters a scene, or which attributes a plugin takes")
    name = describe.add_argument("name", metavar="SCENE|PLUGIN", help="a scene's name or file, or one such as sidescan")
    name.complete = SCENES
    describe.set_defaults(run=_describe)


def _scenes(arguments):
    names = scenes.shipped()
    column = max(map(len, names)) + 2
    for name in names:
        line = scene_words.described(scenes.find(name))[0].partition(". ")[0].rstrip(".")
        announce(f"{name:{column}}{textwrap.shorten(line, WIDEST - column, placeholder=' ...')}")


def _describe(arguments):
    from ..plugins import reference as attributes

    name = arguments.name
    if name in attributes.plugins():
        return _plugin(name)
    try:
        path = scenes.find(name)
    except FileNotFoundError:
        known = [*scenes.shipped(), *attributes.plugins()]
        raise ValueError(f"there is no scene or plugin {name!r}{meant(name, known)}; give the path of a scene, or one "
                         f"of: {', '.join(known)}") from None
    return _scene(name, path)


def _scene(name, path):
    heading, parameters = scene_words.described(path)
    _tell(name, heading)
    for one in parameters:
        announce("")
        _tell(f"-D {one.name}={one.default}", one.comment or "; ".join(dict.fromkeys(map(_use, one.uses))))


def _use(use):
    """What a parameter is for, by the attribute that it becomes."""
    from ..plugins import reference as attributes

    kind, label, name = use
    known = {one.name: one for one in attributes.attributes(kind)} if kind in attributes.plugins() else {}
    place = f"{name} of {label or kind}" if name else label or kind
    if name not in known:
        return place
    return f"{place}, {known[name].expected}: {known[name].meaning}"


def _plugin(name):
    from ..plugins import reference as attributes

    _tell(f'<{attributes.kind_of(name)} type="{name}">', attributes.title(name))
    for one in attributes.attributes(name):
        announce("")
        default = {"": "", "needed": ", needed"}.get(one.default, f", default {one.default}")
        _tell(f"{one.name}: {one.expected}{default}", one.meaning)


def _tell(heading, text):
    """Print a line and, below and further in, what it means."""
    width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
    announce(heading)
    for line in textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="    "):
        announce(line)
