"""Check files before they are read or written, and write each as a whole.

Output goes to a temporary name beside its target and is renamed when complete (`replacing`). A reader never meets half
a file, and an older file stays as it was after a failure. `check_readable` refuses pipes and devices, which may block
or never end.
"""
import contextlib
import errno
import os
import re
import secrets
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

FilePath = str | os.PathLike[str]
FULL = {errno.ENOSPC: "the disk is full", errno.EDQUOT: "the disk quota is used up",
        errno.EFBIG: "the file grew past the largest size allowed here"}
# first bytes of files
EXR, HDF5, PNG, JPEG = b"\x76\x2f\x31\x01", b"\x89HDF", b"\x89PNG", b"\xff\xd8\xff"
CLASSIC = (b"CDF\1", b"CDF\2", b"CDF\5")               # netCDF before version 4
TIFF = (b"II*\0", b"MM\0*")
BEGINNINGS = {EXR: "an OpenEXR image", HDF5: "a netCDF or HDF5 file", b"CDF": "a netCDF file", PNG: "a PNG picture",
              JPEG: "a JPEG picture", TIFF[0]: "a TIFF picture", TIFF[1]: "a TIFF picture",
              b"PK\3\4": "a ZIP archive", b"%PDF": "a PDF document", b"\x93NUMPY": "a NumPy array",
              b"ply": "a PLY mesh"}


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
    """Return True for a file that the kernel makes while it is read, such as those in /proc."""
    # file systems of the kernel have no blocks, and the files no size
    return hasattr(os, "statvfs") and os.path.getsize(path) == 0 and os.statvfs(path).f_blocks == 0


def described(path: FilePath) -> str:
    """Return the kind of a binary file by its first bytes, such as "an OpenEXR image", or an empty text."""
    with open(path, "rb") as file:
        head = file.read(8)
    if head[:1] == b"{" and str(path).lower().endswith(".xtf"):
        return "an XTF record"
    return next((what for start, what in BEGINNINGS.items() if head.startswith(start)), "")


def checked_suffix(path: FilePath, suffixes: Sequence[str], advice: str = "", what: str = "") -> str:
    """Return the suffix of an output file in lower case; raise `ValueError` for one that is not among some."""
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in suffixes:
        *others, last = suffixes
        known = f"{', '.join(others)} or {last}" if others else last
        raise ValueError(f"cannot write {what}{' ' if what else ''}{path}: its name must end in {known}{advice}.")
    return suffix


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
    """Turn the error of a full disk into one sentence about ``path``."""
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
    """Yield a temporary path, which is renamed to ``path`` if the block succeeds and removed if not.

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
    """Remove the temporary files beside ``path`` that ended programs of this machine have left."""
    target = check_writable(path)
    left = re.compile(re.escape(_hidden(target)) + "([0-9a-f]+)-[0-9a-f]{8}" + re.escape(target.suffix))
    for file in target.parent.iterdir():
        if (match := left.fullmatch(file.name)) and not _runs(int(match[1], 16)):
            file.unlink(missing_ok=True)


@contextlib.contextmanager
def replacing_all(paths: Iterable[FilePath]) -> Iterator[list[Path]]:
    """Yield a temporary path for each of several files, as `replacing` does; none is left if one fails."""
    with contextlib.ExitStack() as stack:
        yield [stack.enter_context(replacing(path)) for path in paths]


def _link(temporary: Path, target: Path) -> None:
    """Rename a file in one step, safe against other processes; raise `FileExistsError` if the name is taken."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:                                    # some file systems have no links
        if target.exists():
            raise FileExistsError(target) from None
        os.replace(temporary, target)


def _hidden(target: Path) -> str:
    """Return the beginning of a file's temporary names."""
    return f".{target.stem[:100]}."


def _runs(process: int) -> bool:
    """Return True if a process of that number runs, or may run."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        pass
    return True


def _flush(path):
    """Flush a file or folder to the disk: some disks report only now that they are full."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):  # some network file systems cannot; not a failure
            raise
    finally:
        os.close(handle)
