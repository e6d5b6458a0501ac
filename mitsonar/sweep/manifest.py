"""Manifest of a sweep: ``manifest.jsonl`` in its folder, a line of JSON for every finished or failed render.

Each line holds ``index``, ``output``, ``parameters``, ``seed``, ``inputs`` (SHA-256 of the scene and the files it
reads), ``versions``, ``instruction_set`` (of the machine that rendered it), ``status`` ("ok" or "failed"),
``attempts``, ``seconds``, ``bytes`` and ``sha256`` of the output, ``error``, and if present ``redrawn`` (number of
repeated draws of its parameters), ``classes``, ``preview`` and ``warnings``. The last line about an output counts.

Only the holder of the folder's lock writes, a line at a time. Readers ignore an incomplete line (after a power failure
or on a full disk), and the next writer removes it.
"""
import contextlib
import datetime
import hashlib
import importlib.metadata
import json
import os
import platform
import re
import time
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from mitsonar.device.files import FULL, FilePath
from mitsonar.version import __version__

MANIFEST, LOCK = "manifest.jsonl", ".sweep.lock"
LONGEST_LINE = 1 << 20             # bytes; lines of mitsonar are far shorter
FLUSH_SECONDS = 5.0
# as made by `device.files.replacing`
LEFTOVER = re.compile(r"\..+\.([0-9a-f]+-)?[0-9a-f]{8}\.(exr|png|nc|gsf|kmall|csv|las)", re.I)


class ManifestEntry(NamedTuple):
    """Entry of an output in the manifest: its inputs and its result."""

    key: bytes
    status: str
    bytes: int
    preview: str | None
    seconds: float
    sha256: str | None = None
    redrawn: int = 0
    classes: tuple[str, ...] | None = None


def key(parameters: Mapping[str, object], seed: int, inputs: str, versions: Mapping[str, str]) -> bytes:
    """Return 16 bytes that identify the inputs of a render."""
    content = json.dumps([parameters, seed, inputs, versions], sort_keys=True)
    return hashlib.sha256(content.encode()).digest()[:16]


def versions() -> dict[str, str]:
    """Return the versions of mitsonar and its numerical libraries, which determine the bytes of a render."""
    libraries = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}
    return {"mitsonar": __version__, **libraries}


def sha256(path: FilePath) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


class Manifest:
    """Manifest of a folder, locked by one runner at a time."""

    def __init__(self, folder: str):
        self.path = os.path.join(folder, MANIFEST)
        self._lock = _hold(folder)
        try:
            self.fresh = not os.path.exists(self.path)
            self.entries, self.damaged, complete = read(self.path)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                if complete < os.fstat(self._file).st_size:
                    os.ftruncate(self._file, complete)
                self._end, self._flushed = complete, time.monotonic()
            except BaseException:
                os.close(self._file)
                raise
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):             # the lines are written already
            os.fsync(self._file)
        os.close(self._file)
        if self.fresh and not self._end:               # no render was made: remove both files
            os.unlink(self.path)
            os.unlink(os.path.join(os.path.dirname(self.path), LOCK))
        os.close(self._lock)

    def append(self, record: Mapping[str, object]) -> None:
        """Write a complete line, or raise `OSError` and write none."""
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        try:
            written = os.pwrite(self._file, line, self._end)
            while written < len(line):                 # a full disk writes a part first and fails next time
                written += os.pwrite(self._file, line[written:], self._end + written)
            if time.monotonic() - self._flushed > FLUSH_SECONDS:
                os.fsync(self._file)
                self._flushed = time.monotonic()
        except OSError as error:
            os.ftruncate(self._file, self._end)
            reason = FULL.get(error.errno or 0, error.strerror or str(error))
            raise OSError(error.errno, f"cannot write {self.path}: {reason}; the sweep stopped and keeps finished "
                          "renders: free some space and run it again") from error
        self._end += len(line)


def read(path: FilePath) -> tuple[dict[str, ManifestEntry], int, int]:
    """Return the entries of a manifest by output, the number of damaged lines, and the length of complete lines."""
    entries, damaged, complete = {}, 0, 0
    if not os.path.exists(path):
        return entries, damaged, complete
    with open(path, "rb") as file:
        while line := file.readline(LONGEST_LINE):
            if not line.endswith(b"\n"):
                while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
                    line = file.readline(LONGEST_LINE)         # skip the rest of an overlong line
                if not line.endswith(b"\n"):
                    break
                damaged, complete = damaged + 1, file.tell()
                continue
            complete = file.tell()
            try:
                output, entry = _entry(json.loads(line))
                entries[output] = entry
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
                damaged += 1
    return entries, damaged, complete


def _entry(record):
    if record["status"] not in ("ok", "failed") or not isinstance(record["output"], str):
        raise ValueError
    preview, size = record.get("preview"), record["bytes"] if record["status"] == "ok" else 0
    if not (isinstance(size, int) and (preview is None or isinstance(preview, str))):
        raise ValueError
    classes = record.get("classes")
    return record["output"], ManifestEntry(key=key(record["parameters"], record["seed"], record["inputs"],
                                                   record["versions"]),
                                           status=record["status"], bytes=size, preview=preview,
                                           seconds=float(record["seconds"]), sha256=record.get("sha256"),
                                           redrawn=int(record.get("redrawn", 0)),
                                           classes=None if classes is None else tuple(map(str, classes)))


def remove_leftovers(folders: Iterable[str]) -> None:
    """Remove the unfinished files of killed renders from folders."""
    for folder in folders:
        with contextlib.suppress(FileNotFoundError):
            for name in os.listdir(folder):
                if LEFTOVER.fullmatch(name):
                    with contextlib.suppress(FileNotFoundError):
                        os.unlink(os.path.join(folder, name))


def _hold(folder):
    """Lock the folder; the system releases the lock when the process ends."""
    import fcntl

    path = os.path.join(folder, LOCK)
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not (os.path.exists(path) and os.path.samestat(os.fstat(lock), os.stat(path))):
            os.close(lock)                             # the last holder has just removed it
            return _hold(folder)
    except BlockingIOError:
        holder = os.pread(lock, 1000, 0).decode(errors="replace").strip()
        os.close(lock)
        raise ValueError(f"the sweep in {folder} is being run by {holder or 'somebody else'}; wait until it ends, or "
                         "choose another folder by -o") from None
    since = datetime.datetime.now().astimezone().isoformat(" ", "seconds")
    with contextlib.suppress(OSError):                 # on a full disk the lock holds without its text
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"process {os.getpid()} on {platform.node()} since {since}\n".encode(), 0)
    return lock
