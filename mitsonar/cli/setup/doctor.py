"""Report what mitsonar found on this machine, and whether it renders."""
import importlib.metadata
import os
import platform
import sys
import time
from collections.abc import Callable

from mitsonar.device import llvm
from mitsonar.version import __version__

PACKAGES = ("mitsuba", "drjit", "numpy", "OpenEXR")
BACKENDS = {"llvm_": "LLVM", "cuda_": "CUDA"}  # prefix of variants: backend that compiles their kernels


def report() -> None:
    """Print versions, libLLVM, usable variants, threads and caches, one line each."""
    _line("mitsonar", f"{__version__}  {os.path.dirname(os.path.dirname(os.path.dirname(__file__)))}")
    _line("python", f"{platform.python_version()}  {sys.executable}")
    for package in PACKAGES:
        _line(package, _version(package))
    llvm.check()
    import drjit as dr
    import mitsuba as mi

    library = os.environ[llvm.VARIABLE]
    if dr.has_backend(dr.JitBackend.LLVM):
        _line("LLVM", f"{'.'.join(map(str, dr.detail.llvm_version()))}  {library}  (from {llvm.origin(library)})")
        _line("vectors", llvm.instruction_set())
    else:
        _line("LLVM", "none; the NVIDIA driver makes up for it")
    usable = tuple(name for name, backend in BACKENDS.items() if dr.has_backend(getattr(dr.JitBackend, backend)))
    _line("variants", ", ".join(name for name in mi.variants() if name.startswith(usable)))
    _line("threads", dr.thread_count())
    _line("kernels", _size(os.environ.get("DRJIT_CACHE_DIR") or os.path.expanduser("~/.drjit")))
    _line("cache", _size(llvm.cache_folder()))


def run(render_check: Callable[[], object] | None = None) -> int:
    """Print the report, call `render_check`, and print its result."""
    try:
        report()
    except llvm.BackendError as error:
        _line("LLVM", error)
        return 2
    if render_check is None:
        return 0
    start = time.perf_counter()
    try:
        render_check()
    except Exception as error:  # the doctor reports any error
        _line("check", f"FAILED, {type(error).__name__}: {error}")
        return 1
    _line("check", f"ok, rendered in {time.perf_counter() - start:.1f} s")
    return 0


def _version(package):
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _line(name, value):
    print(f"{name:<10} {value}", flush=True)


def _size(folder):
    if not os.path.isdir(folder):
        return f"{folder}  (not there yet)"
    files = (os.path.join(path, name) for path, _, names in os.walk(folder) for name in names)
    return f"{folder}  ({sum(os.lstat(file).st_size for file in files) / 1e6:.0f} MB)"
