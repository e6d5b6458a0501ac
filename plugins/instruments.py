"""Describe presets with the sources of their figures, and make the manual's page `scenes/manual/instruments.md`.

A test compares the page with the result of `markdown`.
"""
from collections.abc import Iterator
from typing import NamedTuple

from mitsonar.sonar.preset_tables import FIGURES, TABLES, NamedInstrument, classes, instruments, left_out, sources

from . import reference
from .attributes import Attribute
from .attributes.declaration import shown

LIST = "instruments"               # what `describe` lists them by
CLASS, RULE = "[class]", "[rule {}]"
HEAD = """\
# Instruments by name

<!-- Generated: python3 -m mitsonar describe instruments --markdown > scenes/manual/instruments.md -->

```xml
<sensor type="forward_looking">
    <string name="preset" value="oculus_m750d"/>
    <point name="start" x="0" y="0" z="-6"/>
    <medium type="seawater"/>
    <film type="sonar_film"><float name="range" value="20"/></film>
</sensor>
```

A `preset` names an instrument, or a class of instruments. `python3 -m mitsonar describe oculus_m750d` lists every
figure with its unit and its source; `python3 -m mitsonar describe instruments` lists the instruments. A name without a
frequency is the first mode of the instrument that the table lists, for most the lowest frequency; other modes are
presets of their own, such as `oculus_m750d_1200khz`.

The tables below have the figures that differ from those of the class. The number in brackets is the source, listed at
the end of this page. A figure in *italics* follows from other ones by the rule of that number. All other values,
flaws and recorders among them, are those of the class in the column *class*. They are usual values of such
instruments and no maker's figures. Every value can be overridden in the scene.

**What the presets leave out.** They hold what makers publish. Beam patterns, source levels and processing of single
instruments are seldom public, and an instrument's own gain and detection are not modelled. Ranges and resolutions
under *published* are claims to compare with; they change nothing in a render.
"""


class Figure(NamedTuple):
    """A figure of a preset."""

    name: str
    value: str
    unit: str                      # in front of it a space, or empty
    mark: str                      # of its source
    text: str


def known() -> list[str]:
    """Return the names of all presets, of instruments first."""
    return [*(one.name for one in listed()), *(name for kind in TABLES for name in classes(kind))]


def listed() -> list[NamedInstrument]:
    """Return the instruments of all kinds of sonar."""
    return [one for kind in TABLES for one in instruments(kind).values()]


def described(name: str) -> tuple[str, str, list[Figure], dict[str, str]]:
    """Return the kind of sonar, the title, the figures and the texts of the sources, by mark, of a preset."""
    kind = next(kind for kind in TABLES if name in classes(kind) or name in instruments(kind))
    own = instruments(kind).get(name)
    like = own.like if own else name
    declared = {one.name: one for one in reference.attributes(kind)}
    keys = list(dict.fromkeys(own.source.values())) if own else []
    figures = [Figure(field, shown(value), _unit(declared[field]), _mark(own, field, keys),
                      reference.plain(declared[field].text))
               for field, value in {**classes(kind)[like], **(own.attributes if own else {})}.items()]
    figures += [Figure(field, shown(value), _spaced(FIGURES[field][0]), _mark(own, field, keys),
                       f"published: {FIGURES[field][1]}") for field, value in (own.published if own else {}).items()]
    title = own.title if own else f"a class of instruments of {kind}"
    marks = {_numbered(key, keys): reference.plain(_cited(key)) for key in keys}
    return kind, title, figures, {**marks, CLASS: f"usual value of instruments like {like}; no maker's figure"}


def markdown() -> str:
    """Return the text of the manual's page."""
    keys = list(dict.fromkeys(key for one in listed() for key in one.source.values()))
    parts = [HEAD]
    for kind in TABLES:
        if instruments(kind):
            parts += [f"## {kind}\n", *_tables(kind, keys)]
    parts.append("## Sources\n\nDocuments are as their public copies stood in 2026.\n")
    parts.append("\n".join(f"{number}. {_cited(key)}" for number, key in enumerate(keys, 1)) + "\n")
    parts.append("## Left out\n\nInstruments of which no public text was found that suffices:\n")
    parts.append("\n".join(f"- {title}: {reason}" for title, reason in left_out().items()) + "\n")
    return "\n".join(parts)


def _tables(kind: str, keys: list[str]) -> Iterator[str]:
    """Yield the table of a kind's instruments: a row for each, its figures with the numbers of their sources."""
    declared = {one.name: one for one in reference.attributes(kind)}
    lines = ["| preset | instrument | class | figures | published |", "|---|---|---|---|---|"]
    for one in instruments(kind).values():
        own = [_cell(one, field, value, _unit(declared[field]), keys) for field, value in one.attributes.items()]
        claims = [_cell(one, field, value, _spaced(FIGURES[field][0]), keys) for field, value in one.published.items()]
        lines.append(f"| `{one.name}` | {one.title} | `{one.like}` | {'; '.join(own)} | {'; '.join(claims)} |")
    yield "\n".join(lines) + "\n"


def _cell(one: NamedInstrument, field: str, value: object, unit: str, keys: list[str]) -> str:
    key = one.source[field]
    star = "*" if "rule" in sources()[key] else ""
    return f"`{field}` {star}{shown(value)}{unit}{star} [{1 + keys.index(key)}]"


def _mark(own: NamedInstrument | None, field: str, keys: list[str]) -> str:
    return _numbered(own.source[field], keys) if own and field in own.source else CLASS


def _numbered(key: str, keys: list[str]) -> str:
    number = 1 + keys.index(key)
    return RULE.format(number) if "rule" in sources()[key] else f"[{number}]"


def _cited(key: str) -> str:
    entry = sources()[key]
    return entry["rule"] if "rule" in entry else f"{entry['title']}, {entry['date']}, <{entry['address']}>"


def _unit(one: Attribute) -> str:
    return _spaced(getattr(one, "unit", "") or ("degrees" if one.name.endswith("_deg") else ""))


def _spaced(unit: str) -> str:
    """Return a unit with a space before it."""
    return f" {unit}" if unit else ""
