"""Named settings of typical sonars, read from `presets.toml`."""
import sys
from functools import cache
from importlib.resources import files
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # installed on Python 3.10 alone

__all__ = ["presets"]


@cache
def presets() -> dict[str, dict[str, Any]]:
    """Give the settings of every preset: {name: {attribute: value}}, attributes as in XML."""
    return tomllib.loads((files("mitsonar.sonar") / "presets.toml").read_text(encoding="utf-8"))
