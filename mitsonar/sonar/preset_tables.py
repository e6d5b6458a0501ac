"""Named settings of typical sonars, read from a table for each kind of sonar."""
import sys
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


@cache
def presets(kind: str = "sidescan") -> dict[str, dict[str, Any]]:
    """Return the settings of every preset of a kind of `TABLES`: {name: {attribute: value}}, attributes as in XML."""
    return _table(TABLES[kind])


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


def _table(name):
    return tomllib.loads((FOLDER / name).read_text(encoding="utf-8"))
