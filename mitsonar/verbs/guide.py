"""Lists of what can be rendered: scenes with their parameters, plugins with their attributes."""
from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scene_words, scenes as scene_files

WIDTH = 110                        # columns of what is printed


class SceneList(dict[str, str]):
    """The names of scenes, each with a sentence of what it shows; prints as a table."""

    def __repr__(self) -> str:
        column = max(map(len, self), default=0) + 2
        return "\n".join(f"{name:{column}}{textwrap.shorten(text, WIDTH - column, placeholder=' ...')}"
                         for name, text in self.items())


class Entry(NamedTuple):
    """A parameter of a scene, or an attribute of a plugin."""

    default: str  # as it is written in XML
    heading: str  # name, values that are allowed, and default, on a line
    text: str  # what it means


@dataclass(frozen=True, kw_only=True, repr=False)
class Description:
    """Description of a scene or a plugin and of what it takes; prints as ``mitsonar describe`` does."""

    name: str
    plugin: str  # what the plugin and the scene of that name are
    element: str  # of the plugin in XML, such as ``<sensor type="sidescan">``
    attributes: dict[str, Entry]
    scene: str  # what the plugin and the scene of that name are
    parameters: dict[str, Entry]

    def paragraphs(self) -> Iterator[tuple[str, str]]:
        """Yield headings, each with what stands below."""
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
        A dict of name to the first sentence about it.
    """
    words = {name: scene_words.described(scene_files.find(name))[0] for name in scene_files.shipped()}
    return SceneList({name: text.partition("\n")[0].partition(". ")[0].rstrip(".") for name, text in words.items()})


def describe(name: FilePath) -> Description:
    """Return what a scene or a plugin is, with its parameters or attributes.

    Parameters
    ----------
    name : str or path
        A scene's name or file, or the name of a plugin, such as ``sidescan``; of a name that both have, both.

    Returns
    -------
    Description

    Raises
    ------
    ValueError
        If there is neither, or the scene is no XML.
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
        parameters={one.name: Entry(one.default, f"-D {one.name}={one.default}",
                                    one.comment or "; ".join(dict.fromkeys(map(_use, one.uses))))
                    for one in parameters})


def _attributes(plugin: str) -> dict[str, Entry]:
    """Return the attributes of a plugin by name."""
    from mitsonar.plugins import reference

    entries = {}
    for one in reference.attributes(plugin):
        default = {"": "", "needed": ", needed"}.get(one.shown_default, f", default {one.shown_default}")
        entries[one.name] = Entry("" if one.shown_default == "needed" else reference.plain(one.shown_default),
                                  reference.plain(f"{one.name}: {reference.expected(one)}{default}"),
                                  reference.plain(one.text))
    return entries


def _use(use: tuple[str, str, str]) -> str:
    """Return what a parameter is for, by the attribute that it becomes."""
    from mitsonar.plugins import reference

    kind, label, name = use
    declared = reference.attributes(kind) if kind in reference.plugins() else []
    known = {one.name: one for one in declared}
    place = f"{name} of {label or kind}" if name else label or kind
    if name not in known:
        return place
    return f"{place}, {reference.expected(known[name])}: {reference.plain(known[name].text)}"
