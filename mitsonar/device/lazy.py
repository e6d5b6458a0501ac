"""Import the public names of a package when they are first used, by its ``__init__.pyi``.

This module uses only the standard library, since `mitsonar` itself is such a package.
"""
from __future__ import annotations

import ast
import contextlib
import gc
import importlib
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

# NumPy and others may fail if threads import parts of them at once, so first uses take turns. The plugins need a lock
# of their own, taken while Mitsuba is imported. No module may take this lock during its own import (deadlock).
_first_use = threading.RLock()


_of_command = False                # True in a process of mitsonar's own


def begin_command(objects: int = 200_000) -> None:
    """Make the start of a command quick, in a process of its own, where nobody else minds.

    The first collection of garbage is put off until there are so many objects, more than the start makes, and what it
    made is not looked through again; then collections are as usual. xarray imports Dask only where Dask is in use.
    """
    global _of_command
    _of_command, usual = True, gc.get_threshold()

    def go_on(phase: str, info: dict[str, int]) -> None:
        if phase == "stop":
            gc.callbacks.remove(go_on)
            gc.freeze()
            gc.set_threshold(*usual)

    gc.callbacks.append(go_on)
    gc.set_threshold(objects, *usual[1:])


@contextlib.contextmanager
def imports() -> Iterator[None]:
    """Import without collecting garbage, which is a seventh of the time: what imports make stays."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _DaskArrays:
    """Stand for Dask in xarray's table of kinds of arrays, without importing Dask.

    Only a program that has imported Dask has arrays of Dask. xarray would import Dask, a third of a second, to see that
    an array of NumPy is none.
    """

    available = property(lambda self: bool(self.type))
    module = property(lambda self: sys.modules.get("dask"))

    @property
    def type(self) -> tuple[Any, ...]:
        kind = getattr(sys.modules.get("dask.array"), "Array", None)
        return () if kind is None else (kind,)


def _dask_when_used() -> None:
    """Let xarray import Dask when a command has use for Dask, not with the first array.

    This reaches into xarray, and is therefore done in commands alone; if xarray looks different, it is not done.
    """
    table = getattr(sys.modules.get("xarray.namedarray.pycompat"), "_cached_duck_array_modules", None)
    utils: Any = sys.modules.get("xarray.namedarray.utils")
    is_collection = getattr(utils, "is_dask_collection", None)
    if _of_command and isinstance(table, dict) and is_collection is not None:
        if "dask" not in table:
            table["dask"] = _DaskArrays()
            utils.is_dask_collection = lambda x: "dask.base" in sys.modules and is_collection(x)
    else:
        # The first array imports Dask, which fails if several threads do so at once.
        sys.modules["xarray"].DataArray(0.0)


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
            with imports():
                value = importlib.import_module(module)
            value = getattr(value, attribute) if attribute else value
            setattr(sys.modules[package], name, value)
            if "xarray" in sys.modules:
                _dask_when_used()
        return value

    def __dir__() -> list[str]:
        return sorted({*homes, *(name for name in vars(sys.modules[package]) if name.startswith("__"))})

    return __getattr__, __dir__, sorted(homes)
