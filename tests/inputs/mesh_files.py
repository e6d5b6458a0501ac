"""A tetrahedron as mesh files of every kind, whole or with other faces."""
import struct
import zlib

import numpy as np

VERTICES = np.array([[0, 0, -22], [3, 0, -22], [0, 3, -22], [1, 1, -20]], np.float32)
FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3))
HEADER = """ply
format {format} 1.0
comment a tetrahedron
element vertex 4
property float x
property float y
property float z
element face {count}
property list uchar int vertex_indices
end_header
"""


def ascii_ply(faces=FACES):
    rows = ["%g %g %g" % tuple(vertex) for vertex in VERTICES] + ["3 %d %d %d" % tuple(face) for face in faces]
    return (HEADER.format(format="ascii", count=len(faces)) + "\n".join(rows) + "\n").encode()


def binary_ply(faces=FACES, order="<"):
    records = np.zeros(len(faces), [("count", "u1"), ("corners", f"{order}u4", 3)])
    records["count"], records["corners"] = 3, np.array(faces, np.int64).astype(np.uint32)
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    header = HEADER.format(format=kind, count=len(faces)).encode()
    return header + VERTICES.astype(f"{order}f4").tobytes() + records.tobytes()


def big_endian_ply(faces=FACES):
    return binary_ply(faces, ">")


def obj(faces=FACES):
    rows = ["v %g %g %g" % tuple(vertex) for vertex in VERTICES]
    rows += ["f %d %d %d" % tuple(corner + 1 for corner in face) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def serialized(faces=FACES):
    packed = struct.pack("<I", 0x1000) + b"tetrahedron\0" + struct.pack("<QQ", 4, len(faces))
    packed += VERTICES.tobytes() + np.array(faces, np.int64).astype(np.uint32).tobytes()
    mesh = struct.pack("<HH", 0x041C, 4) + zlib.compress(packed)
    return mesh + struct.pack("<QI", 0, 1)


MAKERS = {"ascii": (ascii_ply, "ply"), "binary": (binary_ply, "ply"), "big endian": (big_endian_ply, "ply"),
          "obj": (obj, "obj"), "serialized": (serialized, "serialized")}


def damaged(data, rng):
    """The same bytes with one to four faults: a byte changed, bytes left out, doubled, put in, or the end cut off."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        at, length = int(rng.integers(len(data))), int(rng.integers(1, 9))
        fault = rng.integers(6)
        if fault == 0:
            data[at] = rng.integers(256)
        elif fault == 1:
            data[at] = rng.choice(list(b"0123456789 -\n.e\0\xff"))
        elif fault == 2:
            del data[at:at + length]
        elif fault == 3:
            data[at:at] = data[at:at + length]
        elif fault == 4:
            data[at:at + length] = rng.bytes(length)
        elif rng.integers(4) == 0:
            del data[at:]
        if not data:
            data = bytearray(b"\n")
    return bytes(data)
