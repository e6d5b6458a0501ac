"""Named settings of sonars, read from tables: classes of instruments, and instruments by name.

A table of a class has a value for every attribute of a kind of sonar that a preset sets. A table of an instrument, in
the folder `instruments`, has a title, the class that it is like, and its own figures by the key of their source in
`sources.toml`; all other values are those of the class. A source is a document or, with a `rule`, how a value follows
from other figures. A figure that is no attribute of a sonar is one of `FIGURES`.
"""
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # installed on Python 3.10 alone

FOLDER = files("mitsonar.sonar")
MOTION, RECORDERS = "motion.toml", "recorders.toml"
TABLES = {entry.name[:-5]: entry.name for entry in sorted(FOLDER.iterdir(), key=lambda entry: entry.name)
          if entry.name.endswith(".toml") and entry.name not in (MOTION, RECORDERS)}            # by kind of sonar
FIGURES = {                        # figures of instruments that no attribute holds: unit, meaning
    "angular_resolution_deg": ("degrees", "width of a beam in the plane of the fan, at -3 dB"),
    "beam_step_deg": ("degrees", "angle between neighbouring beams"),
    "range_resolution": ("m", "least distance of two echoes in range that are told apart"),
    "along_track_resolution": ("m", "resolution along the track"),
    "array_length": ("m", "length of the receiving array along the track"),
    "min_range": ("m", "least range"),
    "max_range": ("m", "greatest range"),
    "max_rate_hz": ("Hz", "greatest rate of pings"),
    "max_power": ("W", "greatest electrical power of a pulse"),
    "max_depth": ("m", "greatest depth"),
    "gain_db": ("dB", "gain of the transducer, efficiency included"),
    "equivalent_beam_angle_db": ("dB re 1 sr", "equivalent two-way beam angle"),
    "two_way_beam_width_deg": ("degrees", "two-way beam width along the track, at -3 dB"),
    "widest_swath_deg": ("degrees", "widest swath"),
    "staves": ("", "number of receiving rows of a side"),
    "lowest_frequency_khz": ("kHz", "lowest frequency"),
    "highest_frequency_khz": ("kHz", "highest frequency"),
}


@dataclass(frozen=True, kw_only=True)
class NamedInstrument:
    """An instrument with a name of its own, as a preset of a kind of sonar."""

    name: str
    kind: str                      # of sonar
    title: str
    like: str                      # the class whose values hold where the instrument has none
    attributes: Mapping[str, Any]  # the instrument's own, as in XML
    published: Mapping[str, Any]   # figures of `FIGURES`
    source: Mapping[str, str]      # key in `sources()`, of every own attribute and figure


@cache
def presets(kind: str = "sidescan") -> dict[str, dict[str, Any]]:
    """Return the settings of every preset of a kind of `TABLES`: {name: {attribute: value}}, attributes as in XML.

    Classes of instruments come first, then instruments by name.
    """
    return {**classes(kind), **{one.name: {**classes(kind)[one.like], **one.attributes}
                                for one in instruments(kind).values()}}


@cache
def classes(kind: str) -> dict[str, dict[str, Any]]:
    """Return the settings of the classes of instruments of a kind of sonar: {name: {attribute: value}}."""
    return _table(TABLES[kind])


@cache
def instruments(kind: str) -> dict[str, NamedInstrument]:
    """Return the instruments of a kind of sonar by name."""
    return {name: _instrument(name, kind, entry) for name, entry in _table("instruments", TABLES[kind]).items()}


@cache
def sources() -> dict[str, dict[str, Any]]:
    """Return the sources of figures: {key: {"title", "date", "address"}}, or {key: {"rule"}} for what follows."""
    return _table("instruments", "sources.toml")


@cache
def left_out() -> dict[str, str]:
    """Return the instruments whose public figures do not suffice: {title: reason}."""
    return _table("instruments", "left_out.toml")


@cache
def motions() -> dict[str, dict[str, Any]]:
    """Return how named platforms rock: {name: {attribute: value}}, attributes as in XML."""
    return _table(MOTION)


@cache
def recorders() -> dict[str, dict[str, Any]]:
    """Return the recorders of classes of instruments: {name: {attribute: value}}, attributes as in XML.

    A class has the values of "none" where its table is silent.
    """
    table = _table(RECORDERS)
    return {name: {**table["none"], **values} for name, values in table.items()}


def _table(*path: str) -> dict[str, Any]:
    return tomllib.loads(FOLDER.joinpath(*path).read_text(encoding="utf-8"))


def _instrument(name: str, kind: str, entry: dict[str, Any]) -> NamedInstrument:
    own = {source: figures for source, figures in entry.items() if isinstance(figures, dict)}
    stated: dict[str, str] = {}
    for source, figures in own.items():
        for field in figures:
            if field in stated:
                raise ValueError(f"{field} of the instrument {name} stands below two sources, {stated[field]} and "
                                 f"{source}; keep one of them.")
            stated[field] = source
    values = {field: value for figures in own.values() for field, value in figures.items()}
    taken = classes(kind)[entry["like"]]
    return NamedInstrument(name=name, kind=kind, title=entry["title"], like=entry["like"],
                      attributes={field: value for field, value in values.items() if field in taken},
                      published={field: value for field, value in values.items() if field not in taken},
                      source=stated)
