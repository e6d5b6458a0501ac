"""Choose the libLLVM that Dr.Jit loads, before Dr.Jit is imported.

Dr.Jit looks for libLLVM once, while it is imported: the file of ``DRJIT_LIBLLVM_PATH``, else the system's. It accepts
LLVM 15 and 16, which cannot compile its code and end the process. `locate` therefore always sets the variable, to the
usable library closest to the tested version, or to a missing file, so that Dr.Jit reports a clean "not found". On
Debian and its relatives `provide` (``python3 -m mitsonar llvm``) unpacks a libLLVM under the user's cache, without
root. This module uses only the standard library.
"""
import ctypes
import os
import stat
import sys
import warnings
from collections.abc import Callable, Iterator

OLDEST, TESTED = 17, 19
VARIABLE = "DRJIT_LIBLLVM_PATH"
NOTHING = "/no/libLLVM/that/mitsonar/can/use"  # a file Dr.Jit cannot load
VECTORS = (("+avx512vl", "AVX-512"), ("+avx2", "AVX2"), ("+avx", "AVX"), ("+sve", "SVE"), ("+neon", "NEON"),
           ("+sse4.2", "SSE4.2"))              # LLVM's names of instruction sets, the widest first, and ours
_made: list[str] = []              # the temporary folder that this process made


class BackendError(RuntimeError):
    """Report that Dr.Jit cannot compile kernels on this machine, and how to mend it."""


def cache_folder() -> str:
    """Return the folder for downloads of this user: ``$XDG_CACHE_HOME/mitsonar``, by default in ``~/.cache``.

    If that folder can neither be written nor has a library, it is a folder of the user among the temporary files.
    """
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = os.path.join(os.path.realpath(caches), "mitsonar")
    if _writable(folder) or any(name.startswith("llvm-") for name in _names(folder)):
        return folder
    return _temporary_folder() or folder


def new_folder() -> str | None:
    """Return the temporary folder that this process made in place of the user's cache, or None."""
    return _made[0] if _made else None


def _temporary_folder() -> str | None:
    """Return a temporary folder that only this user can write, made if missing, or None."""
    import tempfile

    try:
        folder = os.path.join(tempfile.gettempdir(), f"mitsonar-{os.getuid()}")
        if _made:
            return _made[0]
        try:
            os.mkdir(folder, 0o700)
            _made.append(folder)
        except FileExistsError:
            status = os.lstat(folder)
            # libraries are loaded from here: no other user may be able to write it
            if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & 0o022:
                folder = tempfile.mkdtemp(prefix="mitsonar-")
                _made.append(folder)
        return folder
    except (OSError, AttributeError):                  # no temporary folder, or a system without users
        return None


def _writable(folder: str) -> bool:
    """Return True if a folder can be written, or made if missing."""
    while not os.path.lexists(folder) and os.path.dirname(folder) != folder:
        folder = os.path.dirname(folder)
    return os.path.isdir(folder) and os.access(folder, os.W_OK | os.X_OK)


def _names(folder: str) -> list[str]:
    """Return the names in a folder, none if it cannot be read."""
    try:
        return os.listdir(folder)
    except OSError:
        return []


def _shelter_caches() -> None:
    """Let Dr.Jit and Matplotlib keep their files in our cache if the home folder cannot be written."""
    if not _writable(os.path.expanduser("~")):
        for variable, name in (("DRJIT_CACHE_DIR", "drjit"), ("MPLCONFIGDIR", "matplotlib")):
            os.environ.setdefault(variable, os.path.join(cache_folder(), name))


def private_folder() -> str:
    """Return the folder for an unpacked libLLVM, one per release and processor, as machines may share a home folder."""
    release = {}
    try:
        with open("/etc/os-release", encoding="utf-8") as file:
            release = dict(line.rstrip().replace('"', "").split("=", 1) for line in file if "=" in line)
    except OSError:
        pass
    version = release.get("VERSION_ID") or release.get("VERSION_CODENAME", "rolling")
    return os.path.join(cache_folder(), f"llvm-{release.get('ID', sys.platform)}-{version}-{_processor()}")


def remedy() -> str:
    """Return the part of an error message that tells the user how to install libLLVM."""
    return f"""mitsonar needs the LLVM shared library to compile its kernels, version {OLDEST} or newer.
  Debian/Ubuntu:   sudo apt-get install libllvm{TESTED} libatomic1
  without root:    python3 -m mitsonar llvm   (unpacks Debian's libllvm{TESTED} under {cache_folder()})
                   (XDG_CACHE_HOME names another folder than ~/.cache for it)
  elsewhere:       install LLVM {TESTED}, or set {VARIABLE} to its libLLVM.so / libLLVM.dylib"""


def locate() -> str | None:
    """Choose a libLLVM, set ``DRJIT_LIBLLVM_PATH`` to it and load its dependencies.

    A library named by ``DRJIT_LIBLLVM_PATH`` is taken if it is new enough. Otherwise the one closest to the tested
    version wins among the installed ones and the one in our cache; installed ones come first.
    """
    _shelter_caches()
    path = os.environ.get(VARIABLE) or NOTHING
    if not _usable(path):
        if path != NOTHING:
            warnings.warn(f"{VARIABLE} is {path}, not LLVM {OLDEST} or newer; looking for another", stacklevel=2)
        path = _closest(_installed())
    os.environ[VARIABLE] = path or NOTHING
    if path and path.startswith(private_folder() + os.sep):
        _load_neighbours(path)
    return path if _has_atomic() else None


def is_ready() -> bool:
    """Return True if Dr.Jit, not yet imported, will be able to compile kernels; calls `locate`."""
    return bool(locate() or _has_atomic() and has_cuda())


def check() -> None:
    """Raise `BackendError` unless kernels can be compiled; call this before a variant is set."""
    drjit = sys.modules.get("drjit")
    ask = getattr(getattr(drjit, "detail", None), "llvm_version", None)
    if drjit is None or ask is None:  # not imported, or just about to be, perhaps by another thread
        if not is_ready():
            raise BackendError(remedy())
        return
    version = ask()[0]
    if 0 <= version < OLDEST:
        raise BackendError(f"Dr.Jit was imported before mitsonar and has loaded LLVM {version}, which cannot compile "
                           f"its code. Import mitsonar first, or set {VARIABLE} to LLVM {OLDEST} or newer.")
    if version < 0 and not drjit.has_backend(drjit.JitBackend.CUDA):
        raise BackendError(remedy())


def provide(say: Callable[[str], None] = print) -> str:
    """Fetch libLLVM, libatomic and their dependencies from Debian into the user's cache, without root."""
    from . import debian

    try:
        packages = debian.Packages(say)
        majors = [int(name[len("libllvm"):]) for name in packages.names("libllvm") if name[len("libllvm"):].isdigit()]
        usable = [major for major in majors if major >= OLDEST]
        if not usable:
            raise debian.Unavailable(f"this release has no libllvm{OLDEST} or newer")
        chosen = min(usable, key=_distance)
        packages.unpack(packages.closure([f"libllvm{chosen}", "libatomic1"]), private_folder())
    except debian.Unavailable as error:
        raise BackendError(f"Could not fetch libLLVM: {error}.\n{remedy()}") from None
    path = locate()
    if not path or not _loads(path):
        raise BackendError(f"The libLLVM unpacked in {private_folder()} cannot be loaded.\n{remedy()}")
    return path


def origin(path: str) -> str:
    """Return the origin of the library at `path`: ``system``, ``mitsonar's cache`` or the variable that names it."""
    if path.startswith(private_folder() + os.sep):
        return "mitsonar's cache"
    return "system" if path in _installed() else VARIABLE


def instruction_set() -> str:
    """Return the instruction set of kernels, such as ``x86_64 AVX-512 znver4``; call `locate` first.

    On one instruction set the bytes of a result are the same for any number of threads, processes and blocks. Vector
    width, approximate reciprocals and the order of fused operations differ between sets and processor generations, and
    so do the last bits.
    """
    try:
        library = ctypes.CDLL(os.environ.get(VARIABLE, NOTHING))
        features, generation = (_text(ask) for ask in (library.LLVMGetHostCPUFeatures, library.LLVMGetHostCPUName))
    except (OSError, AttributeError):
        return f"{_processor()}, no LLVM"
    there = set(features.split(","))
    return f"{_processor()} {next((name for flag, name in VECTORS if flag in there), 'scalar')} {generation}"


def _text(ask: Callable) -> str:
    """Return the text answer of a function of the C library."""
    setattr(ask, "restype", ctypes.c_char_p)
    return (ask() or b"").decode(errors="replace")


def has_cuda() -> bool:
    """Return True if the NVIDIA driver can be loaded; Dr.Jit then does not need LLVM."""
    return _loads("libcuda.so.1") or _loads("nvcuda.dll")


def major_version(path: str) -> int:
    """Return the major version of the libLLVM at `path`, by its file name or by a call; -1 if unknown."""
    name = os.path.basename(os.path.realpath(path))
    for prefix in ("libLLVM-", "libLLVM.so."):  # libLLVM-15.so.1, libLLVM-14.0.6.so.1, libLLVM.so.19.1
        digits = name[len(prefix):].split(".")[0]
        if name.startswith(prefix) and digits.isdigit():
            return int(digits)
    import subprocess

    # in a child process, since a library that is too old must not stay loaded here
    ask = ("import ctypes, sys; numbers = [ctypes.c_uint() for _ in range(3)];"
           "ctypes.CDLL(sys.argv[1]).LLVMGetVersion(*map(ctypes.byref, numbers)); print(numbers[0].value)")
    child = subprocess.run([sys.executable, "-c", ask, path], capture_output=True, text=True, check=False)
    return int(child.stdout) if child.returncode == 0 else -1


def _folders() -> Iterator[str]:
    triple = f"{_processor()}-linux-gnu"
    yield from (f"/usr/lib/{triple}", "/usr/lib64", "/usr/lib", f"{sys.prefix}/lib")
    yield from ("/opt/homebrew/opt/llvm/lib", "/usr/local/opt/llvm/lib")
    if os.path.isdir("/usr/lib"):
        yield from (f"/usr/lib/{name}/lib" for name in os.listdir("/usr/lib") if name.startswith("llvm"))
    yield f"{private_folder()}/usr/lib/{triple}"


def _installed() -> list[str]:
    """Return the real paths of all libraries that could be libLLVM, each once."""
    libraries, wanted = {}, _machine(os.path.realpath(sys.executable))
    for folder in filter(os.path.isdir, _folders()):
        for name in os.listdir(folder):
            if name.startswith(("libLLVM-", "libLLVM.")) and (".so" in name or name.endswith(".dylib")):
                path = os.path.realpath(os.path.join(folder, name))
                if os.path.isfile(path) and wanted in (b"", _machine(path)):
                    libraries[path] = None
    return list(libraries)


def _closest(paths: list[str]) -> str | None:
    private = private_folder() + os.sep
    ranked = [(_distance(major), path.startswith(private), path)
              for path, major in ((path, major_version(path)) for path in paths) if major >= OLDEST]
    return min(ranked)[2] if ranked else None


def _distance(major: int) -> tuple[int, int]:
    return abs(major - TESTED), -major


def _usable(path: str) -> bool:
    return os.path.isfile(path) and major_version(path) >= OLDEST


def _machine(path: str) -> bytes:
    """Return the word size and processor of an ELF file; b"" for other formats."""
    try:
        with open(path, "rb") as file:
            head = file.read(20)
    except OSError:
        return b""
    return head[4:5] + head[18:20] if head.startswith(b"\x7fELF") else b""


def _processor() -> str:
    return os.uname().machine if hasattr(os, "uname") else ""


def _loads(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True


def _has_atomic() -> bool:
    if not sys.platform.startswith("linux") or _loads("libatomic.so.1"):
        return True
    return _loads(f"{private_folder()}/usr/lib/{_processor()}-linux-gnu/libatomic.so.1")


def _load_neighbours(path: str) -> None:
    """Load the unpacked libraries that the system lacks, on which the libLLVM at `path` depends."""
    folder = os.path.dirname(path)
    names = (name for name in os.listdir(folder) if name.rpartition(".so.")[2].isdigit())
    waiting = [name for name in names if not name.startswith("libLLVM") and not _loads(name)]
    while waiting:
        left = [name for name in waiting if not _loads(os.path.join(folder, name))]
        if len(left) == len(waiting):
            return
        waiting = left
