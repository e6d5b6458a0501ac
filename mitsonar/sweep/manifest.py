"""Manifest of a sweep: ``manifest.jsonl`` in its folder, a line of JSON for every finished or failed render.

A part of a sweep has one of its own, ``manifest.part-17-of-200.jsonl``. A run of the whole sweep reads those of parts,
too, and a part that of the whole.

Each line holds ``index``, ``plan`` (SHA-256 of plan and table), ``output``, ``parameters``, ``seed``, ``inputs``
(SHA-256 of the scene and the files it reads), ``versions``, ``instruction_set`` (of the machine that rendered it),
``status`` ("ok" or "failed"), ``attempts``, ``seconds``, ``bytes`` and ``sha256`` of the output, ``error``, and if
present ``redrawn`` (number of repeated draws of its parameters), ``scene`` (name in a plan of several), ``split``
(subset of the plan), ``classes``, ``labelled`` (numbers of a sample's pictures), ``balance`` (wishes of the plan),
``preview`` and ``warnings``. The last line about an output counts.

Only the holder of its lock writes, a line at a time. Readers ignore an incomplete line (after a power failure
or on a full disk), and the next writer removes it.
"""
import contextlib
import datetime
import errno
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import re
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from mitsonar.device.files import FULL, FilePath, check_readable
from mitsonar.labels.tally import checked
from mitsonar.version import __version__

from .parts import MANIFEST, WHOLE, Part, manifests

SUBSETS = ("train", "val", "test")
LONGEST_LINE = 1 << 20             # bytes; lines of mitsonar are far shorter
FLUSH_SECONDS = 5.0
LOCKLESS = errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP      # of some network disks: nothing tells of another run there
# as made by `device.files.replacing`
LEFTOVER = re.compile(r"\.(.+)\.([0-9a-f]+-)?[0-9a-f]{8}\.(exr|png|tar|nc|gsf|kmall|s7k|csv|las)", re.I)
STEM = 100                         # letters of an output's name in that


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
    index: int = -1
    inputs: str = ""
    stamp: str | None = None
    split: str | None = None
    labelled: str | None = None  # JSON of `labels.tally`
    balance: str | None = None  # JSON of the plan's wishes


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
    """Manifest of a sweep or of a part in a folder, locked by one runner at a time."""

    def __init__(self, folder: str, part: Part = WHOLE):
        self.path, self._lock_path = (os.path.join(folder, name) for name in (part.manifest, part.lock))
        self._lock = hold(folder, part)
        try:
            self.entries, self.damaged, complete = read_all(folder, part)
            self.fresh = not self.entries and not os.path.exists(self.path)
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
        if not self._end:                              # no render was made: remove both files
            os.unlink(self.path)
            os.unlink(self._lock_path)
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


def read_all(folder: FilePath, part: Part = WHOLE) -> tuple[dict[str, ManifestEntry], int, int]:
    """Return as `read` what a run has to know: all manifests of a folder, or of a part its own and the whole sweep's.

    A finished render counts before a failed one. The length is that of the run's own manifest.
    """
    folder, entries, damaged, complete = os.fspath(folder), {}, 0, 0
    for name in _names(folder, part):
        found, bad, complete = read(os.path.join(folder, name))
        damaged += bad
        entries |= {output: entry for output, entry in found.items()
                    if entry.status == "ok" or output not in entries or entries[output].status != "ok"}
    return entries, damaged, complete


def _names(folder, part):
    """Return the names of the manifests that a run reads; those that count more come later."""
    return list(dict.fromkeys([*(manifests(folder) if part.whole else [MANIFEST]), part.manifest]))


def moved(folder: str, part: Part, changes: Mapping[str, Mapping[str, Any]], plan: str) -> Iterator[dict[str, Any]]:
    """Yield the contents of the last lines about finished outputs, with `changes` by output; see `changed`."""
    last = {line.output: line for name in (_names(folder, part) if changes else ()) for line in
            lines(os.path.join(folder, name))
            if line.output in changes and line.entry is not None and line.entry.status == "ok"}
    for output, line in last.items():
        yield changed(line.record(), changes[output], plan)


def changed(record: Mapping[str, Any], changes: Mapping[str, Any], plan: str) -> dict[str, Any]:
    """Return the content of a line with other values by a plan of that stamp; None: without the key."""
    rest = {name: item for name, item in record.items() if name not in changes}
    return {**rest, "plan": plan, **{name: item for name, item in changes.items() if item is not None}}


def read(path: FilePath) -> tuple[dict[str, ManifestEntry], int, int]:
    """Return the entries of a manifest by output, the number of damaged lines, and the length of complete lines."""
    entries, damaged, complete = {}, 0, 0
    for line in lines(path):
        complete = line.end
        if line.entry is None:
            damaged += 1
        else:
            entries[line.output] = line.entry
    return entries, damaged, complete


class Line(NamedTuple):
    """Complete line of a manifest."""

    path: str
    start: int  # [bytes]
    end: int  # [bytes]
    output: str
    entry: ManifestEntry | None  # None: damaged

    @property
    def folder(self) -> str:
        """Return the folder of its output."""
        return os.path.dirname(self.path)

    def text(self) -> bytes:
        """Return the line itself."""
        with open(self.path, "rb") as file:
            file.seek(self.start)
            return file.read(self.end - self.start)

    def record(self) -> dict[str, Any]:
        """Return its content."""
        return json.loads(self.text())


def lines(path: FilePath) -> Iterator[Line]:
    """Yield the complete lines of a manifest, none if there is no such file."""
    path = os.fspath(path)
    if not os.path.exists(path):
        return
    check_readable(path, "the manifest", "a manifest of a sweep")
    with open(path, "rb") as file:
        start = 0
        while line := file.readline(LONGEST_LINE):
            whole = line.endswith(b"\n")
            while len(line) == LONGEST_LINE and not line.endswith(b"\n"):
                line = file.readline(LONGEST_LINE)             # skip the rest of an overlong line
            if not line.endswith(b"\n"):
                break
            output, entry = "", None
            with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError):
                output, entry = _entry(json.loads(line)) if whole else ("", None)
            end = file.tell()
            yield Line(path=path, start=start, end=end, output=output, entry=entry)
            start = end


def _entry(record):
    if record["status"] not in ("ok", "failed") or not isinstance(record["output"], str):
        raise ValueError
    preview, size = record.get("preview"), record["bytes"] if record["status"] == "ok" else 0
    if not (isinstance(size, int) and 0 <= size < 1 << 63 and isinstance(record["index"], int)
            and isinstance(preview, str | None) and isinstance(record.get("sha256"), str | None)
            and all(isinstance(text, str) for text in record["versions"].values())
            and isinstance(record["seed"], int) and record.get("split") in (None, *SUBSETS)
            and json.dumps([record["output"], record["parameters"]], ensure_ascii=False).encode()
            and all(map(_is_value, record["parameters"].values()))
            and 0 <= float(record["seconds"]) < math.inf):
        raise ValueError
    classes, labelled = record.get("classes"), checked(record.get("labelled"))
    return record["output"], ManifestEntry(key=key(record["parameters"], record["seed"], record["inputs"],
                                                   record["versions"]),
                                           status=record["status"], bytes=size, preview=preview,
                                           seconds=float(record["seconds"]), sha256=record.get("sha256"),
                                           redrawn=int(record.get("redrawn", 0)),
                                           classes=None if classes is None else tuple(map(str, classes)),
                                           index=record["index"], inputs=sys.intern(record["inputs"]),
                                           stamp=stamp_of(record.get("plan"), record["versions"]),
                                           split=record.get("split"),
                                           labelled=None if labelled is None else sys.intern(json.dumps(labelled)),
                                           balance=None if (balance := record.get("balance")) is None else
                                           sys.intern(json.dumps(balance)))


def _is_value(given):
    """Return True for a value that a plan may give a parameter."""
    if isinstance(given, list):
        return all(isinstance(item, (int, float)) and math.isfinite(item) for item in given)
    return isinstance(given, str) or math.isfinite(given)


def stamp_of(plan: str | None, versions: Mapping[str, str]) -> str | None:
    """Return what tells whether a line was made from a plan by the same versions; None if it does not say."""
    return None if plan is None else sys.intern(f"{plan} {' '.join(map(versions.__getitem__, sorted(versions)))}")


def remove_leftovers(folders: Iterable[str], of: Iterable[str] | None = None) -> None:
    """Remove the unfinished files of killed renders from folders; only those of the outputs `of`, if given."""
    stems = None if of is None else {os.path.splitext(os.path.basename(output))[0][:STEM] for output in of}
    for folder in folders:
        with contextlib.suppress(FileNotFoundError):
            for name in os.listdir(folder):
                if (match := LEFTOVER.fullmatch(name)) and (stems is None or match[1] in stems):
                    with contextlib.suppress(FileNotFoundError):
                        os.unlink(os.path.join(folder, name))


def hold(folder: str, part: Part = WHOLE) -> int:
    """Lock the manifest of a sweep or a part, and return the open file; closing it, or any end, releases the lock."""
    import fcntl

    path = os.path.join(folder, part.lock)
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not (os.path.exists(path) and os.path.samestat(os.fstat(lock), os.stat(path))):
            os.close(lock)                             # the last holder has just removed it
            return hold(folder, part)
    except BlockingIOError:
        holder = os.pread(lock, 1000, 0).decode(errors="replace").strip()
        os.close(lock)
        what = "the sweep" if part.whole else f"part {part} of the sweep"
        raise ValueError(f"{what} in {folder} is being run by {holder or 'somebody else'}; wait until it ends, or "
                         "choose another folder by -o") from None
    except OSError as error:
        if error.errno not in LOCKLESS:
            os.close(lock)
            raise
    since = datetime.datetime.now().astimezone().isoformat(" ", "seconds")
    with contextlib.suppress(OSError):                 # on a full disk the lock holds without its text
        os.ftruncate(lock, 0)
        os.pwrite(lock, f"process {os.getpid()} on {platform.node()} since {since}\n".encode(), 0)
    return lock
