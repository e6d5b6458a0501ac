"""Manifest of a sweep: ``manifest.jsonl`` in its folder, a line of JSON for every render that ended.

Each line holds ``index``, ``output``, ``parameters``, ``seed``, ``inputs`` (SHA-256 of the scene and the files it
reads), ``versions``, ``instruction_set`` (of the machine that rendered it), ``status`` ("ok" or "failed"),
``attempts``, ``seconds``, ``bytes`` and ``sha256`` of the output, ``error``, and where there are any ``redrawn`` (how
often its parameters were drawn again), ``classes``, ``preview`` and ``warnings``. The last line about an output counts.

Only who holds the folder's lock writes, a line in one piece. A line cut short (the machine went down, the disk was
full) is none: readers pass over it, and the next writer cuts it off.
"""
import contextlib
import datetime
import hashlib
import json
import os
import platform
import re
import time
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from mitsonar.device.files import FULL, FilePath

MANIFEST, LOCK = "manifest.jsonl", ".sweep.lock"
LONGEST_LINE = 1 << 20             # bytes; no line of ours comes near
FLUSH_SECONDS = 5.0
LEFTOVER = re.compile(r"\..+\.([0-9a-f]+-)?[0-9a-f]{8}\.(exr|png)", re.I)  # as `device.files.replacing` does


class ManifestEntry(NamedTuple):
    """Entry of one output in the manifest: its inputs and its result."""

    key: bytes
    status: str
    bytes: int
    preview: str | None
    seconds: float
    sha256: str | None = None
    redrawn: int = 0
    classes: tuple[str, ...] | None = None


def key(parameters: Mapping[str, Any], seed: int, inputs: str, versions: Mapping[str, str]) -> bytes:
    """Return 16 bytes that tell what a render is made of."""
    made_of = json.dumps([parameters, seed, inputs, versions], sort_keys=True)
    return hashlib.sha256(made_of.encode()).digest()[:16]


class Manifest:
    """The manifest of a folder, held by one runner at a time."""

    def __init__(self, folder: str):
        self.path = os.path.join(folder, MANIFEST)
        self._lock = _hold(folder)
        try:
            self.fresh = not os.path.exists(self.path)
            self.entries, self.damaged, whole = read(self.path)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            try:
                if whole < os.fstat(self._file).st_size:
                    os.ftruncate(self._file, whole)
                self._end, self._flushed = whole, time.monotonic()
            except BaseException:
                os.close(self._file)
                raise
        except BaseException:
            os.close(self._lock)
            raise

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):             # the lines are written; that is what counts here
            os.fsync(self._file)
        os.close(self._file)
        if self.fresh and not self._end:               # nothing was rendered: leave no trace
            os.unlink(self.path)
            os.unlink(os.path.join(os.path.dirname(self.path), LOCK))
        os.close(self._lock)

    def append(self, record: Mapping[str, Any]) -> None:
        """Write a line, whole or not at all."""
        line = json.dumps(record, allow_nan=False).encode() + b"\n"
        try:
            written = os.pwrite(self._file, line, self._end)
            while written < len(line):                 # a disk that fills up takes a part first, and says so next time
                written += os.pwrite(self._file, line[written:], self._end + written)
            if time.monotonic() - self._flushed > FLUSH_SECONDS:
                os.fsync(self._file)
                self._flushed = time.monotonic()
        except OSError as error:
            os.ftruncate(self._file, self._end)
            raise OSError(error.errno, full(self.path, error)) from error
        self._end += len(line)


def full(path: str, error: OSError) -> str:
    """Say why a file could not be written, and that nothing is lost."""
    what = FULL.get(error.errno or 0, error.strerror or str(error))
    return f"cannot write {path}: {what}; the sweep stopped and keeps what is done: free some space and run it again"


def read(path: FilePath) -> tuple[dict[str, ManifestEntry], int, int]:
    """Read a manifest."""
    entries, damaged, whole = {}, 0, 0
    if not os.path.exists(path):
        return entries, damaged, whole
    with open(path, "rb") as file:
        while line := file.readline(LONGEST_LINE):
            if not line.endswith(b"\n"):
                while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
                    line = file.readline(LONGEST_LINE)         # the rest of a line that is none of ours
                if not line.endswith(b"\n"):
                    break
                damaged, whole = damaged + 1, file.tell()
                continue
            whole = file.tell()
            try:
                output, entry = _entry(json.loads(line))
                entries[output] = entry
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
                damaged += 1
    return entries, damaged, whole


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
    """Remove the unfinished files that killed renders left in these folders."""
    for folder in folders:
        with contextlib.suppress(FileNotFoundError):
            for name in os.listdir(folder):
                if LEFTOVER.fullmatch(name):
                    with contextlib.suppress(FileNotFoundError):
                        os.unlink(os.path.join(folder, name))


def _hold(folder):
    """Lock the folder; the system frees it however we end."""
    import fcntl

    path = os.path.join(folder, LOCK)
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not (os.path.exists(path) and os.path.samestat(os.fstat(lock), os.stat(path))):
            os.close(lock)                             # whoever held it has just taken it away
            return _hold(folder)
    except BlockingIOError:
        holder = os.pread(lock, 1000, 0).decode(errors="replace").strip()
        os.close(lock)
        raise ValueError(f"the sweep in {folder} is being run by {holder or 'somebody else'}; wait until it ends, or "
                         "choose another folder by -o") from None
    since = datetime.datetime.now().astimezone().isoformat(" ", "seconds")
    with contextlib.suppress(OSError):                 # on a full disk it is held all the same, only not told by whom
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"process {os.getpid()} on {platform.node()} since {since}\n".encode(), 0)
    return lock
