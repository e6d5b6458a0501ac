"""mitsonar: a sonar renderer on Mitsuba.

``import mitsonar`` costs a few milliseconds and imports neither Mitsuba nor NumPy: public names are imported when first
used. It does two things that cannot wait. It tells Dr.Jit which libLLVM to load (`mitsonar.device.llvm`), because
Dr.Jit looks for one the moment it is imported; and it sees to it that the plugins are registered with Mitsuba, at once
where Mitsuba is already imported, else right after somebody imports it. So this is all it takes for Mitsuba to read our
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
import threading
from typing import TYPE_CHECKING

from mitsonar.device import llvm

if TYPE_CHECKING:
    # What `_PUBLIC` gives on first use, for those who only read: type checkers, editors and their completion.
    from mitsonar import (
        dataset,
        doctor,
        hydrography,
        imaging,
        inversion,
        io,
        labelling,
        plots,
        plugins,
        propagation,
        scattering,
        seabed,
        signal,
        sonar,
        sweep,
        synthetic_aperture,
        units,
        water,
    )
    from mitsonar.device.llvm import BackendError
    from mitsonar.io.reading import read, write
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.gradients import (
        coherent_model,
        differentiable_signals,
        directional_derivative,
        gradient,
        gradient_check,
        scene_model,
    )
    from mitsonar.verbs.guide import describe, scenes
    from mitsonar.verbs.images import element_signals, frames, impulse_response, render, soundings
    from mitsonar.verbs.strips import focus, raw_echoes

if TYPE_CHECKING:                                        # for annotations alone
    from collections.abc import Sequence
    from importlib.machinery import ModuleSpec
    from types import ModuleType

__all__ = ["BackendError", "coherent_model", "dataset", "describe", "differentiable_signals", "directional_derivative",
           "doctor", "element_signals", "focus", "frames", "gradient", "gradient_check", "hydrography", "imaging",
           "impulse_response", "inversion", "io", "labelling", "load_file", "plots", "plugins", "propagation",
           "raw_echoes", "read", "render", "scattering", "scene_model", "scenes", "seabed", "signal", "sonar",
           "soundings", "sweep", "synthetic_aperture", "units", "water", "write"]

__version__ = "0.1.0"

# Every public name of the package: the module that it is, or the module that it comes from and its name there.
_PUBLIC = {
    "load_file": "mitsonar.scene.loading:load_file",
    "render": "mitsonar.verbs.images:render",
    "frames": "mitsonar.verbs.images:frames",
    "impulse_response": "mitsonar.verbs.images:impulse_response",
    "element_signals": "mitsonar.verbs.images:element_signals",
    "soundings": "mitsonar.verbs.images:soundings",
    "raw_echoes": "mitsonar.verbs.strips:raw_echoes",
    "focus": "mitsonar.verbs.strips:focus",
    "gradient": "mitsonar.verbs.gradients:gradient",
    "coherent_model": "mitsonar.verbs.gradients:coherent_model",
    "differentiable_signals": "mitsonar.verbs.gradients:differentiable_signals",
    "directional_derivative": "mitsonar.verbs.gradients:directional_derivative",
    "gradient_check": "mitsonar.verbs.gradients:gradient_check",
    "scene_model": "mitsonar.verbs.gradients:scene_model",
    "describe": "mitsonar.verbs.guide:describe",
    "scenes": "mitsonar.scenes",                   # the package of their files, which can be called
    "hydrography": "mitsonar.hydrography",
    "read": "mitsonar.io.reading:read",
    "write": "mitsonar.io.reading:write",
    "BackendError": "mitsonar.device.llvm:BackendError",
    "dataset": "mitsonar.dataset",
    "doctor": "mitsonar.doctor",
    "imaging": "mitsonar.imaging",
    "inversion": "mitsonar.inversion",
    "io": "mitsonar.io",
    "labelling": "mitsonar.labelling",
    "plots": "mitsonar.plots",
    "plugins": "mitsonar.plugins",
    "propagation": "mitsonar.propagation",
    "scattering": "mitsonar.scattering",
    "seabed": "mitsonar.seabed",
    "signal": "mitsonar.signal",
    "sonar": "mitsonar.sonar",
    "sweep": "mitsonar.sweep",
    "synthetic_aperture": "mitsonar.synthetic_aperture",
    "units": "mitsonar.units",
    "water": "mitsonar.water",
}

# NumPy and others may fail where threads import several parts of them at once, so first uses take turns. It is not the
# lock of the plugins, which is asked for while Mitsuba is imported. None of our modules asks for this one while it is
# imported: a module has a lock too.
_first_use = threading.RLock()

# A checkout and an editable install keep plugins/ and scenes/ beside the package, a wheel inside it.
_beside = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
if os.path.isfile(os.path.join(_beside, "pyproject.toml")) and os.path.isdir(os.path.join(_beside, "plugins")):
    __path__.append(_beside)


def __getattr__(name):
    if name not in _PUBLIC:
        raise AttributeError(f"module 'mitsonar' has no attribute {name!r}; it has {', '.join(sorted(_PUBLIC))}")
    with _first_use:
        module, _, attribute = _PUBLIC[name].partition(":")
        value = importlib.import_module(module)
        value = globals()[name] = getattr(value, attribute) if attribute else value
        if "xarray" in sys.modules:
            # It imports Dask when the first array is made, and that import fails where several threads begin it.
            sys.modules["xarray"].DataArray(0.0)
    return value


def __dir__():
    return sorted({*_PUBLIC, *(name for name in globals() if name.startswith("__"))})


class _FirstImport:
    """Meta-path finder around the first import of Dr.Jit and of Mitsuba.

    Before either, libLLVM is checked: its lack would show as a NameError. After Mitsuba, the plugins are registered,
    and the finder takes itself away.
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
