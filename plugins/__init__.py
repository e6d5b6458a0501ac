"""Mitsuba plugins of mitsonar: thin adapters from XML to the physics, one folder a kind.

`install` has Mitsuba register them for every JIT variant, and again after each change of variant: a plugin's base class
exists only once a variant is set, so its module is imported then, and reloaded when the variant changes.
"""
import importlib
import sys

from mitsonar import llvm

if __name__ != "mitsonar.plugins":
    raise ImportError("import mitsonar.plugins, not plugins: the folder is part of the package mitsonar")

__all__ = ["install"]

MODULES = ("media.seawater", "films.sonar_film", "bsdfs.material", "bsdfs.lambert", "bsdfs.sediment",
           "bsdfs.elastic", "bsdfs.empirical", "bsdfs.smooth", "bsdfs.rigid", "bsdfs.soft", "bsdfs.impedance",
           "bsdfs.windy_sea", "sensors.sidescan", "sensors.array_sonar", "integrators.sonar_path", "shapes.seabed",
           "shapes.bathymetry", "shapes.capped_cylinder", "shapes.point_target", "shapes.sea_surface",
           "shapes.targets")

_installed = False


def install():
    """Register every plugin for the present variant, if there is one, and for those set from now on."""
    global _installed
    import mitsuba as mi        # where this is the first import, it installs by itself (see mitsonar/__init__)

    if _installed:
        return
    _installed = True
    mi.detail.add_variant_callback(_register)
    if mi.variant():
        _register(None, mi.variant())


def _register(old, new):
    if new is None or new.startswith("scalar"):
        return                      # a scalar variant has no arrays to trace with
    if new.startswith("llvm"):
        llvm.check()                # Dr.Jit may have been imported, with any LLVM, before mitsonar was
    for name in MODULES:
        name = f"{__name__}.{name}"
        if name in sys.modules:
            importlib.reload(sys.modules[name])
        else:
            importlib.import_module(name)
