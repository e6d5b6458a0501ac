"""Make the reference page `plugins/README.md`: how to write a scene, every plugin and every attribute.

All but the first chapter comes from the plugins' declarations and module docstrings. A test compares the page with the
result of `markdown`.
"""
import inspect
import re
from collections.abc import Iterable, Iterator

from mitsonar.sonar.preset_tables import TABLES, instruments

from . import reference
from .attributes import Attribute, Choice, FromTable, Group, flat
from .attributes.declaration import shown

HEAD = """\
# The reference: plugins and their attributes

<!-- Generated: python3 -m mitsonar describe --markdown > plugins/README.md -->

What a scene may hold, in a Mitsuba XML file: a sonar (`<sensor>`) with its water (`<medium>`) and its record
(`<film>`), an `<integrator>`, and shapes with their materials (`<bsdf>`). [A complete scene](../README.md#one-scene)
is in the README; `python3 -m mitsonar describe NAME` shows the part of this page about one plugin.

## Writing a scene

Write numbers as `<float>`, counts as `<integer>`, true or false as `<boolean>`, points as `<point>`, transforms as
`<transform>`, and text, lists of numbers and names of files as `<string>`. A table of numbers is a `<spectrum>`. An
attribute without a default is optional, unless the table marks it as *needed*. An attribute that is misspelt, of the
wrong type or out of range is an error that names the line.

Every file and number can be a `$parameter` with a `<default>`. Files are searched beside the scene, then in the current
folder.

Any shape of Mitsuba is a target (`sphere`, `cylinder`, `cube`, `rectangle`, `ply`, `obj`, ...), placed by its
`to_world`; its `cylinder` is an open tube, `capped_cylinder` is closed. A shape's `id`, of at most 200 bytes, is its
name in the labels, and shapes with the same id share a label. The seabed is a shape too: make it wider than twice
the range.

Mitsuba's own materials keep their values: `diffuse` of reflectance ρ is a Lambert bottom of µ = ρ/π. Materials that
only mirror (`conductor`) are refused. Materials of this page cannot be nested in another material (`twosided`, `mask`),
except `lambert`. Textures are Mitsuba's: a `bitmap` (PNG, JPEG, OpenEXR, BMP, PPM or PFM, at most 10⁸ pixels) on shapes
with texture coordinates, or a `mesh_attribute`: `face_mud` is the property `mud_1` of the faces of a PLY file,
`vertex_mud` that of its vertices.

`mitsonar.load_file` refuses a mesh whose faces name missing vertices, because Mitsuba's readers would write outside
their memory. It also refuses plugins that belong neither to this page nor to the Mitsuba package, and folders with a
library of such a name, which Mitsuba would run. `mi.load_file` and `mi.load_dict` check nothing: load scenes that you
do not trust by `mitsonar.load_file`. In a folder that you do not trust, call `mitsonar` or `python3 -P -m mitsonar`,
because `python3 -m` alone imports any Python file there in place of a package.
"""
MOST_COLUMNS = 20                  # of a table of presets; one with more attributes has a row for each
KINDS = {"sensor": "Sonars", "medium": "Water", "film": "Record", "integrator": "Rays", "bsdf": "Materials",
         "shape": "Shapes"}


def markdown() -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for kind, heading in KINDS.items():
        parts.append(f"## {heading}\n")
        plugins = [plugin for plugin in reference.plugins() if reference.kind_of(plugin) == kind]
        for plugin in plugins:
            parts.extend(_plugin(kind, plugin))
        for group in _groups(plugins):
            parts.extend(_group(group))
    return "\n".join(parts)


def _plugin(kind: str, plugin: str) -> Iterator[str]:
    declared = reference.declared(plugin)
    yield f'### `<{kind} type="{plugin}">`\n'
    yield f"{reference.title(plugin)}\n"
    yield from _text(reference.manual(f"{_folder(plugin)}.{plugin}"))
    own = [one for one in declared if isinstance(one, Attribute)]
    yield _table(([one.name], one) for one in own) if own else "It has no attributes.\n"
    yield from _presets(own)
    links = [f"[{group.title}](#{group.title.lower().replace(' ', '-')})" for group in declared
             if isinstance(group, Group)]
    if links:
        yield f"And the attributes of {' and '.join(filter(None, (', '.join(links[:-1]), links[-1])))}.\n"


def _groups(plugins: Iterable[str]) -> list[Group]:
    """Return the groups that plugins declare, each once."""
    return list({one.title: one for plugin in plugins for one in reference.declared(plugin)
                 if isinstance(one, Group)}.values())


def _group(group: Group) -> Iterator[str]:
    yield f"### {group.title}\n"
    manual = reference.manual(group.module)
    yield f"{_markdown(manual.partition(chr(10))[0])}\n"
    yield from _text(manual)
    yield _table(([prefix + one.name for prefix in group.prefixes], one) for one in group.attributes)
    yield from _presets(list(group.attributes))


def _folder(plugin: str) -> str:
    return {"medium": "media"}.get(reference.kind_of(plugin), f"{reference.kind_of(plugin)}s")


def _text(manual: str) -> Iterator[str]:
    """Yield the text of a module after its first line."""
    rest = inspect.cleandoc(manual).partition("\n")[2].strip()
    if rest:
        yield f"{_markdown(rest)}\n"


def _markdown(text: str) -> str:
    """Return a docstring with its literals and code blocks in Markdown."""
    def fenced(block: re.Match) -> str:
        return f"```{block[1]}\n{inspect.cleandoc(block[2]).rstrip()}\n```\n"

    text = re.sub(r"(?<!`)``(?!`)", "`", text)
    return re.sub(r"\.\. code-block:: (\w+)\n\n((?:    .*\n?|\n)+)", fenced, f"{text}\n").strip()


def _table(rows: Iterable[tuple[list[str], Attribute]]) -> str:
    lines = ["| attribute | expected | default | meaning |", "|---|---|---|---|"]
    for names, one in rows:
        cells = ", ".join(f"`{name}`" for name in names), _expected(one), one.shown_default or "-", one.text
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _expected(one: Attribute) -> str:
    words = reference.expected(one)
    return words.replace('"', "`") if isinstance(one, Choice) else words


def _presets(own: list[Attribute]) -> Iterator[str]:
    """Yield a table of the presets' values, without instruments, for every attribute that names a preset."""
    named = {name: kind for kind in TABLES for name in instruments(kind)}
    tables = {one.default.by: one.default.table for one in own if isinstance(one.default, FromTable)}
    for by, table in tables.items():
        names = [one.name for one in flat(tuple(own)) if isinstance(one.default, FromTable) and one.default.by == by]
        rows = [[by, *(f"`{name}`" for name in names)],
                *([f"`{preset}`", *(shown(values[name]) for name in names)] for preset, values in table.items()
                  if preset not in named)]
        if len(names) > MOST_COLUMNS:
            rows = list(zip(*rows, strict=True))
        lines = [f"| {' | '.join(row)} |" for row in rows]
        lines.insert(1, "|---" * len(rows[0]) + "|")
        yield "\n".join(lines) + "\n"
        if kind := next((named[preset] for preset in table if preset in named), None):
            yield f"Instruments by name, with sources: [Instruments](../scenes/manual/instruments.md#{kind}).\n"
