"""Import the public names of a package when they are first used, by its ``__init__.pyi``.

This module uses only the standard library, since `mitsonar` itself is such a package.
"""
from __future__ import annotations

import ast
import atexit
import contextlib
import functools
import gc
import importlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from importlib import util
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

# NumPy and others may fail if threads import parts of them at once, so first uses take turns. The plugins need a lock
# of their own, taken while Mitsuba is imported. No module may take this lock during its own import (deadlock).
_first_use = threading.RLock()


_of_command = False                # True in a process of mitsonar's own
_starting = False                  # True there until `end_start`


def begin_command(objects: int = 200_000) -> None:
    """Make the start of a command quick, in a process of its own, where nobody else minds.

    The first collection of garbage is put off until there are so many objects, more than the start makes, and what it
    made is not looked through again; then collections are as usual, but for the one at the end of the process. xarray
    is imported when it is used, and Dask only where Dask is in use. SciPy leaves alone what it only passes on or
    documents, and pandas PyArrow. OpenBLAS, whose threads wait for work by spinning, has one thread: a picture has
    small products between kernels, and a tenth more CPU time with two.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    global _of_command, _starting
    _of_command, _starting, usual = True, True, gc.get_threshold()
    looked = False

    def go_on(phase: str, info: dict[str, int]) -> None:
        nonlocal looked
        if phase == "start":
            looked = not _starting
            end_start()                # nothing is left to look through
        elif looked:
            gc.callbacks.remove(go_on)
            gc.freeze()
            gc.set_threshold(*usual)

    gc.callbacks.append(go_on)
    atexit.register(gc.freeze)
    gc.set_threshold(objects, *usual[1:])
    sys.meta_path.insert(0, _UsedAlone)


def end_start() -> None:
    """Keep what a command's start has made out of collections: a look through it takes a tenth of a second."""
    global _starting
    if _starting:                      # later there may be garbage, which would stay for good
        _starting = False
        gc.freeze()
        gc.set_threshold(gc.get_threshold()[0] // 2, *gc.get_threshold()[1:])


class _UsedAlone:
    """Leave out of imports what a command does not use: a fifth of a second, and as much again where xarray is idle.

    SciPy imports all names of NumPy, of which two are packages of build tools and tests: they are imported when used.
    And it parses the text of hundreds of its functions, to add a note to each. pandas, which xarray imports, takes
    PyArrow where it is installed, 35 MB, for tables that no command has. xarray imports Dask to learn who locks a file:
    nobody, where Dask is not in use.
    """

    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        pandas = getattr(sys.modules.get("pandas"), "__spec__", None)
        if name == "pyarrow" and getattr(pandas, "_initializing", False):       # not where a command asks for it
            raise ModuleNotFoundError("pandas does without PyArrow in a command", name=name)
        if name not in ("numpy.f2py", "numpy.testing", "scipy._lib._array_api", "matplotlib.artist", "xarray",
                        "xarray.backends.locks"):
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module
        if name.startswith("numpy"):
            spec.loader = util.LazyLoader(spec.loader)
        elif name == "xarray":
            spec.loader.create_module = lambda spec: _IdleModule(spec.name)
            spec.loader.exec_module = lambda module: vars(module).update(_execute=execute)
        else:

            def without(module: Any) -> None:
                execute(module)
                if hasattr(module, "xp_capabilities"):
                    module.xp_capabilities = lambda **_: lambda function: function
                if hasattr(module, "kwdoc"):
                    module.kwdoc = lambda _: ""
                if hasattr(module, "get_dask_scheduler"):
                    scheduler = module.get_dask_scheduler
                    module.get_dask_scheduler = lambda *a, **k: scheduler(*a, **k) if "dask" in sys.modules else None

            spec.loader.exec_module = without
        return spec


class _IdleModule(ModuleType):
    """Hold a module that is executed when an attribute of it is first used.

    `importlib.util.LazyLoader` executes it when it is imported a second time, as many modules do.
    """

    _lock = threading.RLock()      # not that of first uses, which a thread may hold that imports the module at work

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        with self._lock:
            if (execute := vars(self).pop("_execute", None)) is not None:
                with imports():
                    execute(self)
                object.__setattr__(self, "__class__", ModuleType)
                _dask_when_used()
        return object.__getattribute__(self, name)


def when_called(decorator: Callable[..., Any]) -> Callable[..., Any]:
    """Return a decorator of functions that rewrites a function at its first call, if there is one."""
    if not _of_command:
        return decorator

    def put_off(function: Callable[..., Any] | None = None, **options: bool) -> Callable[..., Any]:
        if function is None:
            return functools.partial(put_off, **options)
        rewritten = functools.cache(lambda: decorator(function, **options))
        return functools.wraps(function)(lambda *arguments, **named: rewritten()(*arguments, **named))

    return put_off


@functools.cache
def module_alone(package: str, path: str) -> ModuleType:
    """Import a module of a package without what the package itself imports, by its path in the package's folder.

    If the package is there already, or has no such file, it is the package itself that is returned.
    """
    spec = None if package in sys.modules else util.find_spec(package)
    for folder in (spec and spec.submodule_search_locations) or ():
        file = Path(folder, path)
        if file.is_file():
            alone = util.spec_from_file_location(f"{package}.{file.stem} alone", file)
            assert alone is not None and alone.loader is not None
            module = util.module_from_spec(alone)
            alone.loader.exec_module(module)
            return module
    return importlib.import_module(package)


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
            if "xarray.core" in sys.modules:           # not one that waits to be used
                _dask_when_used()
        return value

    def __dir__() -> list[str]:
        return sorted({*homes, *(name for name in vars(sys.modules[package]) if name.startswith("__"))})

    return __getattr__, __dir__, sorted(homes)
