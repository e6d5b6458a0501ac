"""Registration of mitsonar's plugins with Mitsuba, for every JIT variant and again after each change of variant.

A plugin's base class exists only once a variant is set. Its module is therefore imported then, and reloaded when the
variant changes. Modules are named, not imported here: plugins stand above scenes.

Threads register one after the other, under `LOCK`. No thread may hold it while it imports Mitsuba for the first time,
because that import calls `install`, which waits for the lock.
"""
import importlib
import sys
import threading

from mitsonar.device import llvm
from mitsonar.device.lazy import imports

LOCK = threading.RLock()            # of registration, and of setting the variant that it is for

BASES = ("bsdfs.material", "bsdfs.smooth", "sensors.sonar_sensor")         # base classes of several plugins
PLUGINS = ("media.seawater", "films.sonar_film", "bsdfs.lambert", "bsdfs.sediment", "bsdfs.elastic", "bsdfs.empirical",
           "bsdfs.rigid", "bsdfs.soft", "bsdfs.impedance", "bsdfs.windy_sea", "sensors.sidescan",
           "sensors.array_sonar", "sensors.forward_looking", "sensors.sector_scan", "sensors.multibeam",
           "sensors.interferometric", "sensors.synthetic_aperture", "sensors.echo_sounder",
           "integrators.sonar_path", "shapes.seabed",
           "shapes.bathymetry", "shapes.capped_cylinder", "shapes.point_target", "shapes.sea_surface",
           "shapes.targets", "shapes.moving")
MODULES = (*BASES, *PLUGINS)

_installed = False
_registered = None                  # the variant


def install() -> None:
    """Register every plugin for the current variant, if there is one, and for every variant set later."""
    global _installed
    import mitsuba as mi  # the first import of Mitsuba calls `install` itself (see mitsonar/__init__)

    with LOCK:
        if _installed:
            return
        _installed = True
        mi.detail.add_variant_callback(_changed)
        if mi.variant():
            register(mi.variant())


def register(variant: str | None) -> None:
    """Register every plugin for a variant, unless they are registered for it."""
    global _registered
    with LOCK:
        if variant == _registered:
            return
        _registered = None
        if variant is None or variant.startswith("scalar"):
            return                  # scalar variants have no arrays to trace with
        if variant.startswith("llvm"):
            llvm.check()            # Dr.Jit may have been imported, with any LLVM, before mitsonar was
        with imports():
            for name in MODULES:
                name = f"mitsonar.plugins.{name}"
                if name in sys.modules:
                    importlib.reload(sys.modules[name])
                else:
                    importlib.import_module(name)
        _registered = variant


def _changed(old, new):
    if new is not None:
        register(new)
