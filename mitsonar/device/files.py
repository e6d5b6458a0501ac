"""Whole files or none: output goes to a temporary name beside its target and is renamed when complete.

A reader never meets half a file, and a failure (disk full, exception, Ctrl-C) leaves an older file of that name as it
was. `check_writable` asks the questions that can be asked before the work; `replacing` does the writing.
`check_readable` is asked before anything is opened: a pipe or a device may have nothing to read for ever, or no end.
"""
import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterable, Iterator
from pathlib import Path

FilePath = str | os.PathLike[str]        # what names a file or a folder
FULL = {errno.ENOSPC: "the disk is full", errno.EDQUOT: "the disk quota is used up",
        errno.EFBIG: "the file grew past the largest size allowed here"}
BEGINNINGS = ((b"\x76\x2f\x31\x01", "an OpenEXR image"), (b"\x89HDF", "a netCDF or HDF5 file"),
              (b"CDF", "a netCDF file"), (b"\x89PNG", "a PNG picture"),
              (b"\xff\xd8\xff", "a JPEG picture"), (b"II*\0", "a TIFF picture"),
              (b"MM\0*", "a TIFF picture"), (b"PK\3\4", "a ZIP archive"), (b"%PDF", "a PDF document"),
              (b"\x93NUMPY", "a NumPy array"), (b"ply", "a PLY mesh"))


def check_readable(path: FilePath, what: str = "", wanted: str = "a file") -> None:
    """Check that ``path`` is an ordinary file that can be read, before it is opened."""
    name = f"cannot read {what}{' ' if what else ''}{path}"
    if not os.path.exists(path):
        raise FileNotFoundError(f"{name}: there is no such file; check the name.")
    if os.path.isdir(path):
        raise ValueError(f"{name}: it is a folder; give the path of {wanted}.")
    if not os.path.isfile(path):
        raise ValueError(f"{name}: it is a device or a pipe; give the path of {wanted}.")
    if is_of_the_kernel(path):
        raise ValueError(f"{name}: it is a file of the kernel, which may have no end; give the path of {wanted}.")
    if not os.access(path, os.R_OK):
        raise PermissionError(f"{name}: you may not read it; change its permissions.")


def is_of_the_kernel(path: FilePath) -> bool:
    """Return True for a file that the kernel makes while it is read, as in /proc: its log is read without end."""
    # their file systems have no blocks, and the files no size
    return hasattr(os, "statvfs") and os.path.getsize(path) == 0 and os.statvfs(path).f_blocks == 0


def described(path: FilePath) -> str:
    """Return what a binary file is by its first bytes, such as "an OpenEXR image"; an empty text if they say nothing.
    """
    with open(path, "rb") as file:
        head = file.read(8)
    if head[:1] == b"{" and str(path).lower().endswith(".xtf"):
        return "an XTF record"
    return next((what for start, what in BEGINNINGS if head.startswith(start)), "")


def check_writable(path: FilePath) -> Path:
    """Check that a file can be written at ``path``, before any work is spent on it."""
    if os.fspath(path) == "" or str(path).endswith(os.sep):
        raise ValueError(f"cannot write {str(path)!r}: it names no file; give a file name.")
    target = Path(os.path.realpath(path))
    folder = target.parent
    if not folder.exists():
        raise FileNotFoundError(f"cannot write {path}: the folder {folder} does not exist; make it first.")
    if not folder.is_dir():
        raise ValueError(f"cannot write {path}: {folder} is a file, not a folder; choose another place.")
    if target.is_dir():
        raise ValueError(f"cannot write {path}: it is a folder; give a file name inside it.")
    if target.exists() and not target.is_file():
        raise ValueError(f"cannot write {path}: it is a device or a pipe, which cannot be replaced as a whole; "
                         "give the name of an ordinary file.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise PermissionError(f"cannot write {path}: no permission to write in {folder}; choose another folder.")
    return target


@contextlib.contextmanager
def full_disk_said(path: FilePath) -> Iterator[None]:
    """Turn the error of a full disk into one sentence about ``path``, which is to vanish then; others pass unchanged.
    """
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        plain = OSError(f"cannot write {path}: {FULL[error.errno]}; free some space or choose another disk "
                        "(nothing was left behind).")
        plain.errno = error.errno
        raise plain from error


@contextlib.contextmanager
def replacing(path: FilePath, *, anew: bool = False) -> Iterator[Path]:
    """Return a temporary path to write to; it becomes ``path`` if the block succeeds and vanishes if not.

    Examples
    --------
    >>> import os, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(folder + "/a.txt") as temporary:
    ...         _ = temporary.write_text("whole")
    ...     os.listdir(folder)
    ['a.txt']
    """
    target = check_writable(path)
    temporary = target.with_name(f"{_hidden(target)}{os.getpid():x}-{secrets.token_hex(4)}{target.suffix}")
    try:
        # 0o666 lets the umask decide, as for a file opened in the ordinary way (mkstemp would hide it from others).
        with full_disk_said(path):
            os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
            yield temporary
            _flush(temporary)
            if anew:
                _link(temporary, target)
            else:
                if target.exists():
                    temporary.chmod(target.stat().st_mode & 0o7777)
                os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)
    _flush(target.parent)


def clear_left(path: FilePath) -> None:
    """Remove what killed programs of this machine left of `replacing` beside ``path``; those that run keep theirs."""
    target = check_writable(path)
    left = re.compile(re.escape(_hidden(target)) + "([0-9a-f]+)-[0-9a-f]{8}" + re.escape(target.suffix))
    for one in target.parent.iterdir():
        if (found := left.fullmatch(one.name)) and not _runs(int(found[1], 16)):
            one.unlink(missing_ok=True)


@contextlib.contextmanager
def replacing_all(paths: Iterable[FilePath]) -> Iterator[list[Path]]:
    """Return a temporary path for each of some files that belong together, as `replacing`: none is left if one fails.
    """
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(replacing(path)) for path in paths]


def _link(temporary: Path, target: Path) -> None:
    """Rename a file in one step, whoever does the same; `FileExistsError` if the name is taken."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:                                    # some file systems have no links
        if target.exists():
            raise FileExistsError(target) from None
        os.replace(temporary, target)


def _hidden(target: Path) -> str:
    """Beginning of the names that a file has while it is written."""
    return f".{target.stem[:100]}."


def _runs(process: int) -> bool:
    """Return True if a process of that number runs, or cannot be asked."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        pass
    return True


def _flush(path):
    """Push a file or a folder's list of names to the disk: some disks report that they are full only now."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems cannot; not a failure
            raise
    finally:
        os.close(handle)
