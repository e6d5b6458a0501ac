"""The attributes of every plugin in words: what each expects, what it takes without one, and what it means.

What is expected, and the default, come from the plugin's own reading (`mitsonar.plugins.properties.declared`); what it
means comes from the tables of README.md, which a test holds to the plugins. A row there of several attributes has as
many defaults, divided by commas, or one for all, and likewise as many meanings, divided by semicolons, or one.
"""
import importlib.metadata
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi

from ..io import scenes
from ..scene.loading import prepare
from ..spelling import meant
from . import MODULES
from .attributes import REQUIRED, declared

__all__ = ["Attribute", "attributes", "kind_of", "plugins", "title", "tables"]

SONAR = {"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}}
BASES = ("material", "smooth", "sonar_sensor")     # modules of what plugins share
# what plugins need to be read to their end, and other ways of writing them that have attributes of their own
WAYS = {
    "sidescan": [SONAR],
    "array_sonar": [SONAR, *({**SONAR, "transmit": kind, "receive": kind, "transmit_elements": 2, "receive_elements": 2,
                              **more} for kind, more in (
                                  ("line", {}), ("planar", {}), ("cylindrical", {}),
                                  ("spherical", {"transmit_radius": 1.0, "receive_radius": 1.0}))),
                    {**SONAR, "receive": "file"}, {**SONAR, "transmit": "file"}],
    "seabed": [{"depth": 10.0}],
    "point_target": [{"position": [0.0, 0.0, -5.0]}],
    "capped_cylinder": [{"radius": 1.0, "p0": [0.0, 0.0, -5.0], "p1": [0.0, 1.0, -5.0]}],
    "impedance": [{"density": 1100.0, "sound_speed": 1600.0}],
    "targets": [{"meshes": "targets", "count": 1}],
}
SIDES = ("receive", "transmit")
NO_PLUGIN = "surely_unknown"       # an attribute that no plugin has: reading ends there, before any work


@dataclass(frozen=True, kw_only=True)
class Attribute:
    """An attribute of a plugin.

    Attributes
    ----------
    name : str
    expected : str
        Such as "a number [m] above 0".
    default : str
        Of it, in words; "needed" where it must be written, empty where nothing is taken for it.
    meaning : str
    """

    name: str
    expected: str
    default: str
    meaning: str


def plugins() -> list[str]:
    """Names of all plugins, by their kinds."""
    return [name for name in (module.rpartition(".")[2] for module in MODULES) if name not in BASES]


def kind_of(plugin: str) -> str:
    """The element that a plugin is written as: "sensor", "bsdf", ..."""
    folder = next(module.partition(".")[0] for module in MODULES if module.rpartition(".")[2] == plugin)
    return {"media": "medium"}.get(folder, folder.removesuffix("s"))


def title(plugin: str) -> str:
    """What a plugin is, in one line."""
    prepare()
    module = next(module for module in MODULES if module.rpartition(".")[2] == plugin)
    line = sys.modules[f"mitsonar.plugins.{module}"].__doc__.partition("\n")[0]
    return re.sub(r"^Shape ``\w+``: | \(`\w+`\)|`", "", line)


def attributes(plugin: str) -> list[Attribute]:
    """Describe a plugin's attributes, in the order of README's table.

    Parameters
    ----------
    plugin : str
        Such as "sidescan".

    Raises
    ------
    ValueError
        If there is no such plugin; lists those there are.
    """
    if plugin not in plugins():
        raise ValueError(f"there is no plugin {plugin!r}{meant(plugin, plugins())}; there are {', '.join(plugins())}")
    found, words = _declared(plugin), _meanings(plugin)
    order = {name: number for number, name in enumerate(words)}
    return [Attribute(name=name, expected=_rounded(found[name].expected),
                      default=_default(found[name].default, words.get(name)),
                      meaning=words[name][1] if name in words else "")
            for name in sorted(found, key=lambda name: order.get(name, len(order)))]


def tables() -> list:
    """README's tables of attributes: for each the plugins of its heading, and rows (names, default, meaning)."""
    found = []
    for section in re.split(r"\n(?=\*\*`<)", _readme())[1:]:
        heading, table = section.partition("\n")[0], section.partition("| attribute |")[2].partition("\n\n")[0]
        rows = re.findall(r"^\| (`.+?) \| (.*?) ?\| (.+) \|$", table, re.M)
        found.append((re.findall(r'type="(\w+)"', heading),
                      [(re.findall(r"`(\w+)`", names), default, meaning) for names, default, meaning in rows]))
    return found


def _declared(plugin):
    """What a plugin reads, written in all of its ways."""
    prepare()
    for way in WAYS.get(plugin, [{}]):
        files = {name: str(Path(scenes.find("sidescan_flat")).parent / "casts" / "summer.csv")
                 for name in ("filename", "receive_file", "transmit_file")
                 if name.removesuffix("_file") in way and way[name.removesuffix("_file")] == "file"
                 or name == "filename" and plugin in ("empirical", "bathymetry")}
        try:
            mi.load_dict({"type": plugin, **way, **files, NO_PLUGIN: 1})
        except RuntimeError:           # of the unknown attribute: all others are asked for by now
            pass
    return dict(declared.get(plugin, {}))


def _meanings(plugin, seen=()):
    """Default and meaning in README's words, by attribute; what is "as of a sidescan" is looked up there."""
    words = {}
    for heading, rows in tables():
        if plugin not in heading:
            continue
        for names, default, meaning in rows:
            defaults = re.split(r', (?=(?:[^"]*"[^"]*")*[^"]*$)', default)        # at commas outside quotation marks
            alike = len({name.removeprefix(side) for name in names for side in SIDES if side in name}) == 1
            parts = [] if alike else meaning.split("; ")       # a row of both arrays says the same of both
            other = re.fullmatch(r"as of (?:a )?`?(\w+)`?", meaning)
            there = _meanings(other[1], (*seen, plugin)) if other and other[1] not in seen else {}
            for number, name in enumerate(names):
                own = defaults[number] if len(defaults) == len(names) else default
                said = parts[number] if len(parts) == len(names) else meaning
                known = there.get(name, (own, said))
                words[name] = own or known[0], known[1]
    return {name: tuple(re.sub(r"\[([^]]+)\]\(#[^)]*\)|[`*]", r"\1", text) for text in two)
            for name, two in words.items()}


def _rounded(words):
    """The same with numbers of a few digits."""
    return re.sub(r"\d+\.\d+", lambda number: f"{float(number[0]):.4g}" if float(number[0]) < 1e4 else
                  f"{float(number[0]):.0f}", words)


def _default(value, words):
    """The default in README's words, else as the plugin takes it."""
    if words is not None and words[0] == "-":
        return ""
    if value is REQUIRED:
        return "needed"
    if words is not None and words[0]:
        return words[0]
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, (int, float)) else str(value) if isinstance(value, str) else ""


def _readme():
    """README.md: beside the package in a checkout, else within what was installed."""
    beside = Path(__file__).resolve().parent.parent / "README.md"
    if os.path.isfile(beside):
        return beside.read_text(encoding="utf-8")
    return importlib.metadata.metadata("mitsonar").get_payload() or ""
