"""Lists of scenes with their parameters, of plugins with their attributes, and of presets with their sources."""
from __future__ import annotations

import os
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field
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
    """Description of a scene with its parameters, or a plugin or a preset; prints as ``mitsonar describe``."""

    name: str
    plugin: str                    # title of the plugin or the preset; empty for a scene
    element: str                   # XML of the plugin, such as ``<sensor type="sidescan">``
    attributes: dict[str, Entry]
    sources: dict[str, Entry] = field(default_factory=dict)    # of a preset's figures, by mark
    scene: str                     # heading of the scene; empty for a plugin
    parameters: dict[str, Entry]

    def paragraphs(self) -> Iterator[tuple[str, str]]:
        """Yield every heading with the text below it."""
        for heading, text, entries in ((self.element, self.plugin, self.attributes | self.sources),
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
    """Return the description of a scene with its parameters, a plugin with its attributes, or a preset.

    A preset of an instrument or a class has its figures with their units, and the source of each.

    Parameters
    ----------
    name : str or path
        Name or file of a scene, or name of a plugin, such as ``sidescan``, or of a preset, such as ``oculus_m750d``;
        the name ``instruments`` lists the presets of instruments. If a scene and a plugin share the name, both are
        described.

    Returns
    -------
    Description

    Raises
    ------
    ValueError
        If no scene, plugin or preset has this name, or the scene is not XML.
    """
    from mitsonar.plugins import instruments, reference

    name = os.fspath(name)
    if name == instruments.LIST or name in instruments.known():
        return _preset(name)
    is_plugin = name in reference.plugins()
    path = None
    if not is_plugin or name in scene_files.shipped():
        try:
            path = scene_files.find(name)
        except FileNotFoundError:
            known = [*scene_files.shipped(), *reference.plugins()]
            raise ValueError(f"there is no scene, plugin or preset {name!r}"
                             f"{meant(name, [*known, *instruments.known()])}; give the path of a scene, or one of: "
                             f"{', '.join([*known, instruments.LIST])}") from None
    heading, parameters = ("", []) if path is None else scene_words.described(path)
    return Description(
        name=name, plugin=reference.title(name) if is_plugin else "", scene=heading,
        element=f'<{reference.kind_of(name)} type="{name}">' if is_plugin else "",
        attributes=_attributes(name) if is_plugin else {},
        parameters={parameter.name: Entry(parameter.default, f"-D {parameter.name}={parameter.default}",
                                          parameter.comment or "; ".join(dict.fromkeys(map(_use, parameter.uses))))
                    for parameter in parameters})


def _preset(name: str) -> Description:
    """Return the description of a preset, or the list of instruments."""
    from mitsonar.plugins import instruments

    if name == instruments.LIST:
        return Description(name=name, scene="", parameters={}, element="Presets of instruments by name",
                           plugin="mitsonar describe NAME has the figures of one, with their sources.",
                           attributes={one.name: Entry("", f"{one.name} ({one.kind})", one.title)
                                       for one in instruments.listed()})
    kind, title, figures, marks = instruments.described(name)
    return Description(
        name=name, scene="", parameters={}, plugin=title,
        element=f'<sensor type="{kind}"> <string name="preset" value="{name}"/>',
        attributes={figure.name: Entry(figure.value, f"{figure.name}: {figure.value}{figure.unit} {figure.mark}",
                                       figure.text) for figure in figures},
        sources={mark: Entry("", mark, text) for mark, text in marks.items()})


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
