"""Describe the plugins and their attributes, from the declarations and docstrings of their modules."""
import re
import sys
from types import ModuleType

from mitsonar.device.spelling import meant
from mitsonar.scene.loading import prepare

from . import PLUGINS
from .attributes import Attribute, File, Group, Number, flat

OF_MITSUBA = (File("filename", text="what a plugin of Mitsuba's own reads: a mesh, a picture, a volume"),)


def plugins() -> list[str]:
    """Return the names of all plugins, ordered by kind."""
    return [name.rpartition(".")[2] for name in PLUGINS]


def kind_of(plugin: str) -> str:
    """Return the XML element of a plugin: "sensor", "bsdf", ..."""
    folder = _name(plugin).partition(".")[0]
    return {"media": "medium"}.get(folder, folder.removesuffix("s"))


def title(plugin: str) -> str:
    """Return a one-line description of a plugin."""
    return re.sub(r" \(`\w+`\)|`", "", manual(_name(plugin)).partition("\n")[0])


def manual(module: str) -> str:
    """Return the docstring of a plugins' module, such as "sensors.platform"."""
    return _module(module).__doc__ or ""


def declared(plugin: str) -> tuple[Attribute | Group, ...]:
    """Return the attributes and groups that a plugin declares."""
    return _module(_name(plugin)).ATTRIBUTES


def attributes(plugin: str) -> list[Attribute]:
    """Return all attributes of a plugin under their full names, in the order of declaration."""
    return list(flat(declared(plugin)))


def input_files(kind: str) -> dict[str, File]:
    """Return the attributes, by name, that name input files of an object type, including Mitsuba's own types."""
    return {one.name: one for one in (attributes(kind) if kind in plugins() else OF_MITSUBA) if isinstance(one, File)}


def expected(attribute: Attribute) -> str:
    """Return the expected value of an attribute in words, with its numbers rounded to four digits."""
    def rounded(number: re.Match) -> str:
        return f"{float(number[0]):.4g}" if float(number[0]) < 1e4 else f"{float(number[0]):.0f}"

    return re.sub(r"\d+\.\d+", rounded, attribute.expected) if isinstance(attribute, Number) else attribute.expected


def plain(text: str) -> str:
    """Return Markdown text without its marks."""
    return re.sub(r"[`*]", "", text)


def _name(plugin: str) -> str:
    """Return the folder and module of a plugin."""
    found = next((name for name in PLUGINS if name.rpartition(".")[2] == plugin), None)
    if found is None:
        raise ValueError(f"there is no plugin {plugin!r}{meant(plugin, plugins())}; there are {', '.join(plugins())}")
    return found


def _module(name: str) -> ModuleType:
    prepare()                                  # registers, and so imports, every plugin
    return sys.modules[f"{__package__}.{name}"]
