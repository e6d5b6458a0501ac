"""Checks of mesh files before Mitsuba's readers open them."""
import functools
import hashlib
import mmap
import os
import re
import struct
import zlib
from pathlib import Path

import numpy as np

from mitsonar.device import files
from mitsonar.device.files import FilePath

from . import ply

__all__ = ["KINDS", "check", "check_target", "listed"]

KINDS = (".ply", ".obj")           # that targets are read from
LARGEST = 50e6                     # [bytes] of a target's file: a million triangles
SAID = {"ply": "PLY file of triangles", "obj": "OBJ file of triangles", "serialized": "serialized mesh"}
LARGEST_UNPACKED = 4e9             # [bytes] of a serialized mesh
MOST = 1 << 30                     # vertices or faces: thrice as many are still counted in 32 bits
WORDS = 1 << 20                    # at a time
OBJ_LINES = ("vertices", rb"(?m)^[ \t\r]*v[ \t]"), ("faces", rb"(?m)^[ \t\r]*f[ \t]")
# of an OBJ file: what corners may have, a line that gives one, and a face with a corner that has none
OBJ_CORNERS = tuple((what, rb"(?m)^[ \t\r]*%b[ \t]" % kind,
                     rb"(?m)^[ \t\r]*f[ \t](?:[^\n]*?[ \t])??\d+%b(?=\s|\Z)" % rest)
                    for what, kind, rest in (("texture coordinates", b"vt", rb"(?:/0*(?:/\d*)?)?"),
                                             ("normals", b"vn", rb"(?:/\d*(?:/0*)?)?")))


def listed(folder: FilePath) -> list[Path]:
    """Return the meshes of a folder, sorted by name.

    Parameters
    ----------
    folder : str or path

    Returns
    -------
    list of Path

    Raises
    ------
    ValueError
        If there are none.
    """
    found = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() in KINDS and path.is_file())
    if not found:
        raise ValueError(f"the folder {folder} holds no mesh; put {' or '.join(KINDS)} files into it")
    return found


def check_target(path: FilePath) -> str:
    """Check that a target's mesh can be read and is not too large; content that was right before is not read again.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    str
        SHA-256 of its content.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is of no known kind, empty, too large, or damaged.
    """
    path = Path(path)
    if path.suffix.lower() not in KINDS:
        raise ValueError(f"{path} is no mesh that can be read; give a {' or '.join(KINDS)} file")
    if not path.exists():
        raise FileNotFoundError(f"the mesh {path} is not there; it is looked for beside the scene, then where you are")
    files.check_readable(path, "the mesh", "a mesh")
    size = path.stat().st_size
    if not 0 < size <= LARGEST:
        raise ValueError(f"the mesh {path} has {size} bytes; targets are meshes of at most {LARGEST:.0f} bytes")
    content = hashlib.sha256(path.read_bytes()).hexdigest()
    _check_once(str(path), path.suffix.lower()[1:], content)
    return content


@functools.lru_cache(maxsize=4096)
def _check_once(path, kind, content):              # an error is not kept
    check(path, kind)


def check(path: FilePath, kind: str, index: int = 0) -> None:
    """Refuse a mesh whose faces name missing vertices, which Mitsuba's readers do not check.

    Parameters
    ----------
    path : str or path
    kind : {"ply", "obj", "serialized", "linearcurve", "bsplinecurve"}
        Reader that is to read the file, whatever its name.
    index : int
        Number of the mesh in a serialized file.

    Raises
    ------
    ValueError
        If the file is damaged, of another kind, or too large for that reader.
    """
    files.check_readable(path, "the mesh", "a mesh")
    try:
        if kind == "ply":
            ply.check(path)
        elif kind == "obj":
            _check_obj(path)
        elif kind == "serialized":
            _check_serialized(path, index)
        else:
            _check_end(path)
    except ValueError as error:
        raise ValueError(f"the mesh {path} is damaged, or no {SAID.get(kind, 'list of points')}: {error}; export it "
                         "again") from None


def _check_obj(path):
    """Refuse mixed corners: for parts that they lack, Mitsuba would read random memory."""
    _check_end(path)
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        for what, line in OBJ_LINES:
            if not re.search(line, text):
                raise ValueError(f"it has no {what}")
        for what, given, left_out in OBJ_CORNERS:
            if re.search(given, text) and re.search(left_out, text):
                raise ValueError(f"some corners of its faces have {what} and others have none")


def _check_end(path):
    """Refuse a file that fills its last memory page: Mitsuba looks one byte beyond it for the end of its last line."""
    size = os.path.getsize(path)
    if size == 0:
        raise ValueError("it is empty")
    with open(path, "rb") as file:
        file.seek(size - 1)
        if size % mmap.PAGESIZE == 0 and file.read(1) != b"\n":
            raise ValueError("its last line has no end, and Mitsuba would read on beyond the file")


def _check_serialized(path, index):
    """Unpack a mesh as Mitsuba's reader does, a piece at a time."""
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        magic, version = struct.unpack("<HH", _whole(file.read(4), 4))
        if magic != 0x041C or version not in (3, 4):
            raise ValueError("it does not begin as a serialized mesh does")
        if index:
            file.seek(max(0, size - 4))
            (count,) = struct.unpack("<I", _whole(file.read(4), 4))
            width = 8 if version == 4 else 4
            if not 0 < index < count or count * width > size:
                raise ValueError(f"it holds {count} meshes, and mesh {index} was asked for")
            # the table of version 3 ends as that of version 4
            file.seek(size - width * (count - index) - 4)
            file.seek(min(size, int.from_bytes(file.read(width), "little")) + 4)
        unpacked = _Unpacked(file)
        (flags,) = struct.unpack("<I", unpacked.read(4))
        while version == 4 and unpacked.read(1) != b"\0":
            pass
        vertices, faces = struct.unpack("<QQ", unpacked.read(16))
        numbers = 3 * (1 + bool(flags & 1) + bool(flags & 8)) + 2 * bool(flags & 2)
        wanted = vertices * numbers * (8 if flags & 0x2000 else 4)
        if not (0 < vertices < MOST and 0 < faces < MOST) or wanted + 12 * faces > LARGEST_UNPACKED:
            raise ValueError(f"it counts {vertices} vertices and {faces} faces")
        while wanted:
            wanted -= len(unpacked.read(min(wanted, 4 * WORDS)))
        for start in range(0, 3 * faces, WORDS):
            indices = np.frombuffer(unpacked.read(4 * min(WORDS, 3 * faces - start)), "<u4")
            if indices.max() >= vertices:
                raise ValueError(f"a face names vertex {indices.max()}, and the vertices count from 0 to "
                                 f"{vertices - 1}")


class _Unpacked:
    """Stream that zlib compressed."""

    def __init__(self, file):
        self._file, self._zlib, self._kept = file, zlib.decompressobj(), b""

    def read(self, size: int) -> bytes:
        parts = []
        try:
            while size:
                packed = self._kept or self._file.read(1 << 16)
                part = self._zlib.decompress(packed, size)
                self._kept = self._zlib.unconsumed_tail
                if not part and (self._zlib.eof or not packed):
                    raise ValueError("it is cut off")
                parts.append(part)
                size -= len(part)
        except zlib.error as error:
            raise ValueError(f"it cannot be unpacked ({error})") from None
        return b"".join(parts)


def _whole(data, size):
    if len(data) < size:
        raise ValueError("it is cut off")
    return data
