"""Files in and out: records and datasets, no science.

Modules are imported when first used: `mitsonar.io.records.exr` and the others need no import of their own.
"""
import importlib
import pkgutil

_ROOMS = tuple(entry.name for entry in pkgutil.iter_modules(__path__))


def __getattr__(name):
    if name not in _ROOMS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it has {', '.join(_ROOMS)}")
    return importlib.import_module(f"{__name__}.{name}")


def __dir__():
    return sorted({*globals(), *_ROOMS})
