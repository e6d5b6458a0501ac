"""Checks of PLY meshes for Mitsuba's reader: triangles whose corners are vertices of the file.

That reader checks neither the header nor any index; an index beyond the vertices accesses foreign memory.
"""
import os
import warnings
from typing import NamedTuple

import numpy as np

from mitsonar.device.files import FilePath

LONGEST_HEADER = 1 << 16           # bytes
MOST = 1 << 30                     # vertices or faces: thrice as many are still counted in 32 bits
BLOCK = 1 << 22                    # bytes or records at a time
TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "long": "i8",
         "ulong": "u8", "half": "f2", "float": "f4", "double": "f8", "float16": "f2", "float32": "f4", "float64": "f8",
         **{f"{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4)}}
CORNERS = ("vertex_index", "vertex_indices")


class _Element(NamedTuple):
    name: str
    count: int
    fields: dict                   # name to type; of a face's corners: ".count", ".0", ".1", ".2"


def check(path: FilePath) -> None:
    """Check that Mitsuba's reader reads a PLY file correctly."""
    size = os.path.getsize(path)
    with open(path, "rb") as file:
        order, elements = _header(file)
        for element in elements:
            if element.count > min(MOST, size):
                raise ValueError(f"its header counts {element.count} elements, but it has {size} bytes")
        vertices = next(element.count for element in elements if element.name == "vertex")
        if order is None:
            for element, records in _spelt(file, elements):
                _check_faces(element, records.T, vertices)
            return
        wanted = file.tell() + sum(element.count * _record(element, order).itemsize for element in elements)
        if wanted != size:
            raise ValueError(f"its header asks for {wanted} bytes, but it has {size}")
        for element in elements:
            record, left = _record(element, order), element.count
            while left:
                records = np.fromfile(file, record, min(left, BLOCK // record.itemsize + 1))
                left -= len(records)
                if element.name == "face":
                    _check_faces(element, [records[name] for name in element.fields], vertices)


def _header(file):
    """Return the byte order, None for numbers in text, and the elements."""
    order, elements, seen, left = "", [], 0, LONGEST_HEADER
    while True:
        line = file.readline(left)
        left -= len(line)
        if not line.endswith(b"\n"):
            raise ValueError("its header does not end")
        words = line.decode("latin-1").split()
        if not words or words[0] == "comment":
            continue
        seen += 1
        if (words == ["ply"]) != (seen == 1):
            raise ValueError("it does not begin as a PLY file does")
        if words == ["end_header"]:
            break
        if words[0] == "format" and order == "":
            order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}.get(words[1], "")
            if words[2:] != ["1.0"] or order == "":
                raise ValueError(f"its format is {_shown(words[1:])}; it must be ascii, binary_little_endian or "
                                 "binary_big_endian 1.0")
        elif words[0] == "element" and len(words) == 3 and words[2].isascii() and words[2].isdigit():
            elements.append(_Element(words[1], int(words[2][:30]), {}))
        elif words[0] == "property" and elements and order != "":
            _add_property(elements[-1], words[1:])
        elif words[0] != "ply":
            raise ValueError(f'its header holds "{_shown(words)}"')
    names = [element.name for element in elements]
    if order == "" or names.count("vertex") != 1 or names.count("face") != 1:
        raise ValueError("its header must name one format, the vertices and the faces, each once")
    for element in elements:
        wanted = {"vertex": ("x", "y", "z"), "face": (".0",)}.get(element.name, ())
        if not element.fields or not set(wanted) <= set(element.fields) or (wanted and not element.count):
            raise ValueError(f'its "{_shown([element.name])}" elements are none, or lack '
                             f"{', '.join(wanted).replace('.0', CORNERS[1]) or 'properties'}")
    return order, elements


def _add_property(element, words):
    if words[:1] == ["list"] and element.name == "face" and len(words) == 4 and words[3] in CORNERS:
        kinds = [TYPES.get(word, "") for word in words[1:3]]
        fields = {".count": kinds[0], **dict.fromkeys((".0", ".1", ".2"), kinds[1])}
        if not all(kind[:1] in ("i", "u") for kind in kinds):
            raise ValueError(f"the corners of its faces are counted by {_shown(words[1:3])}, which are no integers")
    elif len(words) == 2 and words[0] in TYPES and not words[1].startswith("."):
        fields = {words[1]: TYPES[words[0]]}
    else:
        raise ValueError(f'its header holds the property "{_shown(words)}", which Mitsuba cannot read')
    if set(fields) & set(element.fields):
        raise ValueError(f'its header holds the property "{_shown(words)}" twice')
    element.fields.update(fields)


def _record(element, order):
    return np.dtype([(name, order + kind) for name, kind in element.fields.items()])


def _check_faces(element, columns, vertices):
    """Check the faces in records, given as columns."""
    if element.name != "face":
        return
    names = list(element.fields)
    corners = columns[names.index(".count")]
    if (other := corners[corners != 3]).size:
        raise ValueError(f"it has a face of {other[0]:g} corners; every face must be a triangle")
    for name in (".0", ".1", ".2"):
        index = columns[names.index(name)]
        # NaN is wrong, too
        if (wrong := index[~((index >= 0) & (index < vertices))]).size:
            raise ValueError(f"a face names vertex {wrong[0]:.0f}, and the vertices count from 0 to {vertices - 1}")


def _spelt(file, elements):
    """Yield blocks of the records of each element, (records, properties), from numbers in text."""
    blocks, kept = _numbers(file), np.empty(0)
    for element in elements:
        width, left = len(element.fields), element.count
        while left:
            while len(kept) < width:
                kept = np.concatenate([kept, _next(blocks, "its numbers are fewer than its header asks for")])
            whole = min(len(kept) // width, left)
            yield element, kept[:whole * width].reshape(whole, width)
            kept, left = kept[whole * width:], left - whole
    if len(kept) or next(blocks, None) is not None:
        raise ValueError("its numbers are more than its header asks for")


def _next(blocks, otherwise):
    block = next(blocks, None)
    if block is None:
        raise ValueError(otherwise)
    return block


def _numbers(file):
    """Yield arrays of the remaining numbers of a file, separated by white space only."""
    rest = b""
    while True:
        data = file.read(BLOCK)
        text = rest + data
        end = max(map(text.rfind, (b" ", b"\n", b"\t", b"\r"))) + 1 if data else len(text)
        text, rest = text[:end], text[end:]
        if len(rest) > LONGEST_HEADER:
            raise ValueError(f"it holds a number of more than {LONGEST_HEADER} digits")
        blank = np.isin(np.frombuffer(b" " + text, np.uint8), np.frombuffer(b" \t\n\r\v\f", np.uint8))
        words = int(np.count_nonzero(blank[:-1] & ~blank[1:]))
        if words:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)      # of older NumPy, where newer raises
                try:
                    values = np.fromstring(text, np.float64, sep=" ")
                except ValueError:
                    values = ()
            if len(values) != words:               # "1-2" is two numbers to this reader
                raise ValueError("it holds something that is no number, or its numbers run into one another")
            yield values
        if not data:
            return


def _shown(words):
    text = " ".join(words)
    return text if len(text) <= 60 else f"{text[:57]}..."
