"""Named settings of typical sonars, read from a table for each kind of sonar."""
import sys
from functools import cache
from importlib.resources import files
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # installed on Python 3.10 alone

TABLES = {"sidescan": "presets.toml", "forward_looking": "forward_looking.toml",
          "sector_scan": "sector_scan.toml", "multibeam": "multibeam.toml", "interferometric": "interferometric.toml",
          "synthetic_aperture": "synthetic_aperture.toml"}            # by kind of sonar


@cache
def presets(kind: str = "sidescan") -> dict[str, dict[str, Any]]:
    """Return the settings of every preset of a kind of `TABLES`: {name: {attribute: value}}, attributes as in XML."""
    return _table(TABLES[kind])


@cache
def motions() -> dict[str, dict[str, Any]]:
    """Return how named platforms rock: {name: {attribute: value}}, attributes as in XML."""
    return _table("motion.toml")


def _table(name):
    return tomllib.loads((files("mitsonar.sonar") / name).read_text(encoding="utf-8"))
