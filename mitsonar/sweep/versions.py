"""The versions that decide what a render's bytes are."""
import importlib.metadata

from mitsonar.version import __version__


def versions() -> dict[str, str]:
    """Return the versions of mitsonar and of what computes for it, by name."""
    others = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}
    return {"mitsonar": __version__, **others}
