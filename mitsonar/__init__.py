"""Render sonar data with Mitsuba.

``import mitsonar`` takes a few milliseconds: public names, Mitsuba and NumPy are imported when first used. The import
itself chooses the libLLVM that Dr.Jit loads (`mitsonar.device.llvm`), because Dr.Jit looks for one while it is
imported, and registers the plugins with Mitsuba, at once or as soon as Mitsuba is imported. Mitsuba then reads sonar
scenes:

    import mitsonar
    import mitsuba as mi

    mi.set_variant("llvm_ad_mono")
    scene = mi.load_file("scenes/sidescan_flat.xml", optimize=False)
"""
import functools
import importlib
import os
import sys
from typing import TYPE_CHECKING

from mitsonar.device import llvm
from mitsonar.device.lazy import attach, when_called
from mitsonar.version import __version__ as __version__

if TYPE_CHECKING:                                        # for annotations alone
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

# Public names are listed in __init__.pyi. `scenes` is the package of the scene files, which can be called.
__getattr__, __dir__, __all__ = attach(__name__, __file__, scenes="mitsonar.scenes")

# A checkout and an editable install keep plugins/ and scenes/ beside the package, a wheel inside it.
_beside = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if os.path.isfile(os.path.join(_beside, "pyproject.toml")) and os.path.isdir(os.path.join(_beside, "plugins")):
    __path__.append(_beside)


class _FirstImport:
    """Check libLLVM before the first import of Dr.Jit or Mitsuba, and register the plugins after that of Mitsuba.

    A missing libLLVM would otherwise show as a NameError. This meta-path finder removes itself after use.
    """

    @classmethod
    def find_spec(cls, name: str, path: "Sequence[str] | None" = None, target: "ModuleType | None" = None
                  ) -> "ModuleSpec | None":
        if name not in ("drjit", "mitsuba"):
            return None
        others = (finder for finder in sys.meta_path if finder is not cls)
        spec = next(filter(None, (finder.find_spec(name, path, target) for finder in others)), None)
        if spec is None or spec.loader is None:
            return spec
        execute = spec.loader.exec_module

        def execute_between(module: "ModuleType") -> None:
            llvm.check()
            execute(module)
            if name == "drjit":        # Mitsuba and mitsonar decorate dozens of functions, and a command calls a few
                vars(module)["syntax"] = when_called(vars(module)["syntax"])
            if name == "mitsuba" and cls in sys.meta_path:
                if sys.modules[name] is not module:
                    # Mitsuba put another module in its place; a thread that waited meanwhile has got this one.
                    vars(module)["__getattr__"] = functools.partial(getattr, sys.modules[name])
                sys.meta_path.remove(cls)
                importlib.import_module("mitsonar.plugins").install()

        # On this one loader object: the module's spec and loader stay what the import system made them.
        spec.loader.exec_module = execute_between
        return spec


if "drjit" not in sys.modules:
    llvm.locate()
if "mitsuba" in sys.modules:
    importlib.import_module("mitsonar.plugins").install()
else:
    sys.meta_path.insert(0, _FirstImport)
