"""Mesh files before Mitsuba sees them: nothing that its readers would read or write outside of memory gets to them."""
import mmap
import struct
import zlib

import numpy as np
import pytest
from mesh_files import FACES, HEADER, MAKERS, ascii_ply, binary_ply, damaged, obj

from mitsonar.io.scene_files import meshes


@pytest.fixture
def checked(tmp_path):
    """Write a file and check it; gives its path."""
    def check(content, kind):
        path = tmp_path / f"mesh.{kind}"
        path.write_bytes(content)
        meshes.check(path, kind)
        return path
    return check


@pytest.mark.parametrize("make, kind", MAKERS.values(), ids=MAKERS)
def test_sound_meshes_pass_and_mitsuba_reads_them(checked, variant, make, kind):
    import mitsuba as mi

    mesh = mi.load_dict({"type": kind, "filename": str(checked(make(), kind))})
    assert mesh.face_count() == len(FACES)


@pytest.mark.parametrize("vertex", [4, 99, 10**6, -1, 2**31])
@pytest.mark.parametrize("make, kind", MAKERS.values(), ids=MAKERS)
def test_faces_that_name_vertices_which_are_not_there(checked, variant, make, kind, vertex):
    import mitsuba as mi

    if kind != "obj":
        with pytest.raises(ValueError, match=r"a face names vertex -?\d+, and the vertices count from 0 to 3; export"):
            checked(make([(0, 1, vertex), *FACES[1:]]), kind)
        return
    path = checked(make([(0, 1, vertex), *FACES[1:]]), kind)       # here Mitsuba checks for itself
    with pytest.raises(RuntimeError, match="reference to invalid vertex"):
        mi.load_dict({"type": kind, "filename": str(path)})


def spoilt(old, new):
    text = HEADER.format(format="ascii", count=4)
    assert old in text
    return text.replace(old, new).encode() + ascii_ply().partition(b"end_header\n")[2]


PLY = {
    "empty": (b"", "its header does not end"),
    "none": (b"solid\nend_header\n", "does not begin as a PLY file does"),
    "header without an end": (ascii_ply().replace(b"end_header\n", b""), "header"),
    "endless header": (b"ply\n" + b"comment\n" * 20000, "its header does not end"),
    "other format": (spoilt("ascii 1.0", "ascii 2.0"), "its format is ascii 2.0"),
    "no faces": (spoilt("element face 4\nproperty list uchar int vertex_indices\n", ""), "vertices and the faces"),
    "vertices twice": (spoilt("element face", "element vertex 4\nproperty float x\nelement face"), "each once"),
    "negative count": (spoilt("vertex 4", "vertex -4"), 'its header holds "element vertex -4"'),
    "endless count": (spoilt("vertex 4", "vertex " + "9" * 10000), "its header counts 99999"),
    "faces of floats": (spoilt("list uchar int", "list uchar float"), "which are no integers"),
    "list of vertices": (spoilt("property float x", "property list uchar int vertex_indices"), "Mitsuba cannot read"),
    "unknown type": (spoilt("float x", "quad x"), '"quad x", which Mitsuba cannot read'),
    "twice the same": (spoilt("float y", "float x"), '"float x" twice'),
    "no z": (spoilt("float z", "float w"), 'its "vertex" elements are none, or lack x, y, z'),
    "quadrangle": (ascii_ply().replace(b"3 0 2 1", b"4 0 2 1"), "it has a face of 4 corners; every face must be a"),
    "word": (ascii_ply().replace(b"3 0 2 1", b"3 0 b 1"), "something that is no number"),
    "numbers that touch": (ascii_ply().replace(b"3 0 2 1", b"3 0 2-1"), "run into one another"),
    "half a corner": (ascii_ply().replace(b"3 0 2 1", b"3 0 2 nan"), "a face names vertex nan"),
    "numbers missing": (ascii_ply()[:-2], "its numbers are fewer than its header asks for"),
    "numbers left": (ascii_ply() + b"3\n", "its numbers are more than its header asks for"),
    "cut off": (binary_ply()[:-1], "its header asks for 291 bytes, but it has 290"),
    "bytes left": (binary_ply() + b"\0", "its header asks for 291 bytes, but it has 292"),
}


@pytest.mark.parametrize("content, words", PLY.values(), ids=PLY)
def test_damaged_ply(checked, content, words):
    with pytest.raises(ValueError, match="is damaged, or no PLY file of triangles") as error:
        checked(content, "ply")
    assert words in str(error.value) and len(str(error.value)) < 500


def test_obj_that_ends_with_its_last_page(checked):
    """Mitsuba maps the file and reads one byte beyond it, which the page after has not got."""
    text = obj()
    text = text + b"#" * (mmap.PAGESIZE - len(text))
    with pytest.raises(ValueError, match="its last line has no end"):
        checked(text, "obj")
    checked(text[:-1] + b"\n", "obj")
    checked(text[:-1], "obj")


@pytest.mark.parametrize("text, lacking", [("Some words\nabout vertices.\n", "vertices"), ("v 0 0 0\n", "faces")])
def test_text_that_is_no_obj(checked, text, lacking):
    with pytest.raises(ValueError, match=f"no OBJ file of triangles: it has no {lacking}; export it again"):
        checked(text.encode(), "obj")


@pytest.mark.parametrize("given, face, what", [
    ("vt 0 0", "1/1 2/1 3", "texture coordinates"), ("vt 0 0", "1//1 2/1 3/1", "texture coordinates"),
    ("vt 0 0", "1/0 2/1 3/1", "texture coordinates"), ("vn 0 0 1", "1//1 2//1 3", "normals"),
    ("vn 0 0 1", "1/1 2//1 3//1", "normals"),
])
def test_obj_whose_corners_leave_something_out(checked, given, face, what):
    """Mitsuba takes what is in the memory for it."""
    start = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    with pytest.raises(ValueError, match=f"some corners of its faces have {what} and others have none"):
        checked(f"{start}{given}\nf {face}\n".encode(), "obj")
    checked(f"{start}f {face}\n".encode(), "obj")
    checked(f"{start}vt 0 0\nvn 0 0 1\n f\t1/1/1 2/1/1 3/1/1\r\n".encode(), "obj")


def test_serialized_mesh_that_unpacks_without_end(checked):
    packed = struct.pack("<IB", 0x1000, 0) + struct.pack("<QQ", 2**31, 4) + bytes(10**6)
    with pytest.raises(ValueError, match="it counts 2147483648 vertices and 4 faces"):
        checked(struct.pack("<HH", 0x041C, 4) + zlib.compress(packed), "serialized")
    packed = struct.pack("<IB", 0x1000, 0) + struct.pack("<QQ", 10**8, 4) + bytes(10**6)
    with pytest.raises(ValueError, match="it is cut off"):
        checked(struct.pack("<HH", 0x041C, 4) + zlib.compress(packed), "serialized")


def test_long_meshes_are_read_in_blocks(checked, monkeypatch):
    monkeypatch.setattr("mitsonar.io.scene_files.ply.BLOCK", 16)
    for make in (ascii_ply, binary_ply):
        checked(make(), "ply")
        with pytest.raises(ValueError, match="a face names vertex 7"):
            checked(make([*FACES[:3], (2, 0, 7)]), "ply")


@pytest.mark.parametrize("make, kind", MAKERS.values(), ids=MAKERS)
def test_what_passes_is_a_mesh_to_mitsuba_or_an_error(checked, variant, rng, make, kind):
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    passed, whole = 0, make()
    for _ in range(300):
        try:
            path = checked(damaged(whole, rng), kind)
        except ValueError as error:
            assert "\n" not in str(error) and len(str(error)) < 500
            continue
        passed += 1
        try:
            mesh = mi.load_dict({"type": kind, "filename": str(path)})
        except (RuntimeError, UnicodeDecodeError):                 # the latter where it quotes the file
            continue
        faces = mi.traverse(mesh)["faces"].numpy()
        assert np.all(faces < mesh.vertex_count())
    assert passed > (0 if kind == "serialized" else 10)             # a packed one has a sum that tells
