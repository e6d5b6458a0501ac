"""Import the public names of a package when they are first used, by its ``__init__.pyi``.

This module uses only the standard library, since `mitsonar` itself is such a package.
"""
from __future__ import annotations

import ast
import importlib
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

# NumPy and others may fail if threads import parts of them at once, so first uses take turns. The plugins need a lock
# of their own, taken while Mitsuba is imported. No module may take this lock during its own import (deadlock).
_first_use = threading.RLock()


def homes_of(package: str, stub: Path) -> dict[str, str]:
    """Return the source of each public name of a package, "module" or "module:name", as its stub lists it."""
    homes = {}
    for node in ast.parse(stub.read_text(encoding="utf-8")).body:
        if not isinstance(node, ast.ImportFrom):
            continue
        parents = package.split(".")[:len(package.split(".")) - node.level + 1] if node.level else []
        module = ".".join([*parents, *([node.module] if node.module else [])])
        folder = stub.parent.joinpath(*(node.module or "").split("."))
        for alias in node.names:
            file = folder / alias.name
            is_module = not node.module or file.with_suffix(".py").is_file() or (file / "__init__.py").is_file()
            homes[alias.asname or alias.name] = f"{module}{'.' if is_module else ':'}{alias.name}"
    return homes


def attach(package: str, file: str, **modules: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package, by the stub beside its ``__init__.py``.

    ``modules`` are names whose module differs from the one in the stub.
    """
    homes = {**homes_of(package, Path(file).with_name("__init__.pyi")), **modules}

    def __getattr__(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}; it has {', '.join(sorted(homes))}")
        with _first_use:
            module, _, attribute = homes[name].partition(":")
            value = importlib.import_module(module)
            value = getattr(value, attribute) if attribute else value
            setattr(sys.modules[package], name, value)
            if "xarray" in sys.modules:
                # The first array imports Dask, which fails if several threads do so at once.
                sys.modules["xarray"].DataArray(0.0)
        return value

    def __dir__() -> list[str]:
        return sorted({*homes, *(name for name in vars(sys.modules[package]) if name.startswith("__"))})

    return __getattr__, __dir__, sorted(homes)
