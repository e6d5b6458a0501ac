"""Lists of scenes with their parameters and of plugins with their attributes."""
from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scene_words, scenes as scene_files

WIDTH = 110                        # columns of the printed text


class SceneList(dict[str, str]):
    """Names of scenes, each with a sentence about its content; prints as a table."""

    def __repr__(self) -> str:
        column = max(map(len, self), default=0) + 2
        return "\n".join(f"{name:{column}}{textwrap.shorten(text, WIDTH - column, placeholder=' ...')}"
                         for name, text in self.items())


class Entry(NamedTuple):
    """A parameter of a scene, or an attribute of a plugin."""

    default: str                   # as written in XML
    heading: str                   # name, allowed values and default, on one line
    text: str                      # its meaning


@dataclass(frozen=True, kw_only=True, repr=False)
class Description:
    """Description of a scene with its parameters, or a plugin with its attributes; prints as ``mitsonar describe``."""

    name: str
    plugin: str                    # title of the plugin; empty for a scene
    element: str                   # XML of the plugin, such as ``<sensor type="sidescan">``
    attributes: dict[str, Entry]
    scene: str                     # heading of the scene; empty for a plugin
    parameters: dict[str, Entry]

    def paragraphs(self) -> Iterator[tuple[str, str]]:
        """Yield every heading with the text below it."""
        for heading, text, entries in ((self.element, self.plugin, self.attributes),
                                       (self.name if self.scene or self.parameters else "", self.scene,
                                        self.parameters)):
            if heading:
                yield heading, text
                yield from ((entry.heading, entry.text) for entry in entries.values())

    def __repr__(self) -> str:
        return "\n\n".join("\n".join([heading, *textwrap.wrap(text, WIDTH, initial_indent="    ",
                                                              subsequent_indent="    ")])
                           for heading, text in self.paragraphs())


def scenes() -> SceneList:
    """Return the scenes that come with mitsonar.

    Returns
    -------
    SceneList
        Dict from the name of a scene to the first sentence of its description.
    """
    words = {name: scene_words.described(scene_files.find(name))[0] for name in scene_files.shipped()}
    return SceneList({name: text.partition("\n")[0].partition(". ")[0].rstrip(".") for name, text in words.items()})


def describe(name: FilePath) -> Description:
    """Return the description of a scene with its parameters, or of a plugin with its attributes.

    Parameters
    ----------
    name : str or path
        Name or file of a scene, or name of a plugin, such as ``sidescan``. If a scene and a plugin share the name, both
        are described.

    Returns
    -------
    Description

    Raises
    ------
    ValueError
        If no scene or plugin has this name, or the scene is not XML.
    """
    from mitsonar.plugins import reference

    name = os.fspath(name)
    is_plugin = name in reference.plugins()
    path = None
    if not is_plugin or name in scene_files.shipped():
        try:
            path = scene_files.find(name)
        except FileNotFoundError:
            known = [*scene_files.shipped(), *reference.plugins()]
            raise ValueError(f"there is no scene or plugin {name!r}{meant(name, known)}; give the path of a scene, or "
                             f"one of: {', '.join(known)}") from None
    heading, parameters = ("", []) if path is None else scene_words.described(path)
    return Description(
        name=name, plugin=reference.title(name) if is_plugin else "", scene=heading,
        element=f'<{reference.kind_of(name)} type="{name}">' if is_plugin else "",
        attributes=_attributes(name) if is_plugin else {},
        parameters={parameter.name: Entry(parameter.default, f"-D {parameter.name}={parameter.default}",
                                          parameter.comment or "; ".join(dict.fromkeys(map(_use, parameter.uses))))
                    for parameter in parameters})


def _attributes(plugin: str) -> dict[str, Entry]:
    """Return the attributes of a plugin by name."""
    from mitsonar.plugins import reference

    entries = {}
    for attribute in reference.attributes(plugin):
        shown = attribute.shown_default
        default = {"": "", "needed": ", needed"}.get(shown, f", default {shown}")
        entries[attribute.name] = Entry("" if shown == "needed" else reference.plain(shown),
                                        reference.plain(f"{attribute.name}: {reference.expected(attribute)}{default}"),
                                        reference.plain(attribute.text))
    return entries


def _use(use: tuple[str, str, str]) -> str:
    """Return the purpose of a parameter: the attribute (plugin, label, name) that it becomes, with its meaning."""
    from mitsonar.plugins import reference

    kind, label, name = use
    known = {entry.name: entry for entry in reference.attributes(kind)} if kind in reference.plugins() else {}
    place = f"{name} of {label or kind}" if name else label or kind
    if name not in known:
        return place
    return f"{place}, {reference.expected(known[name])}: {reference.plain(known[name].text)}"
