"""Statements about meshes beside them: licence, class and units, and what is refused."""
import numpy as np
import pytest

from mitsonar.io.scene_files.mesh_lists import LARGEST, NAME, NOT_STATED, MeshStatement, statement

TEXT = """
licence = "CC-BY-4.0"
unit = "mm"
[manta]
class = "mine"
licence = "CC0-1.0"
author = "A. Maker"
source = "https://example.org/manta"
[barrel]
up = "y"
"""


@pytest.fixture
def folder(tmp_path):
    for name in ("manta.ply", "barrel.OBJ", "rock.obj"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / NAME).write_text(TEXT, encoding="utf-8")
    return tmp_path


def test_a_table_of_a_mesh_goes_before_what_is_said_of_all(folder):
    assert statement(folder / "manta.ply") == MeshStatement(
        class_name="mine", licence="CC0-1.0", author="A. Maker", source="https://example.org/manta", scale=0.001)
    assert statement(folder / "barrel.OBJ") == MeshStatement(licence="CC-BY-4.0", scale=0.001, up="y")
    assert statement(folder / "rock.obj") == MeshStatement(licence="CC-BY-4.0", scale=0.001)


def test_a_folder_that_states_nothing(tmp_path):
    assert statement(tmp_path / "a.ply") == MeshStatement() and MeshStatement().licence == NOT_STATED
    vertices = np.ones((4, 3))
    assert MeshStatement().placed(vertices) is vertices            # not even rounded


def test_y_up_becomes_z_up_in_metres_without_mirroring():
    turned = MeshStatement(scale=0.001, up="y").placed(1000 * np.eye(3))
    np.testing.assert_allclose(turned, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])         # -z of the file is the front, +y
    assert np.linalg.det(turned) == pytest.approx(1)


def test_a_changed_file_is_read_again(folder):
    assert statement(folder / "rock.obj").licence == "CC-BY-4.0"
    (folder / NAME).write_text('licence = "MIT"', encoding="utf-8")
    assert statement(folder / "rock.obj").licence == "MIT"


@pytest.mark.parametrize("text, said", [
    ("[mantra]", r'has the table \[mantra\] \(did you mean "manta"\?\), and no mesh of that name'),
    ("license = 'MIT'", r"unknown key 'license' \(did you mean"), ("licence = 5", "licence is 5; give a text"),
    ('licence = "a\\nb"', "licence is"), ('author = "a\\u0007"', "author is"),
    ("unit = 'ell'", "unit is 'ell'; give m, cm"), ("unit = [1]", r"unit is \[1\]; give m"),
    ("up = 'x'", "up is 'x'; give z, y"), ("scale = 0", "scale is 0; give metres"), ("scale = inf", "scale is inf"),
    ("scale = true", "scale is True"), ("unit = 'm'\nscale = 1", "unit and scale are"),
    ("[manta]\nclass = 'a.b'", r"\[manta\]: class is 'a\.b'; give a name without dots"),
    ("class = ' a'", "class is ' a'"), ("class = 'mine shadow'", 'without " shadow"'),
    (f"class = '{'a' * 101}'", "class is"), ("a" * 50, "cannot read"),
    ("[" * 5000, "cannot read"), ("\0", "cannot read"),
    ("licence = 'é'".encode("latin-1"), "cannot read"), (b"#" * (LARGEST + 1), "give a TOML file of at most")])
def test_hostile_statements_are_refused_in_a_sentence(folder, text, said):
    (folder / NAME).write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=said) as refused:
        statement(folder / "manta.ply")
    assert len(str(refused.value)) < 1000


def test_a_pipe_is_not_waited_for(folder):
    import os

    if not hasattr(os, "mkfifo"):
        pytest.skip("no pipes here")
    (folder / NAME).unlink()
    os.mkfifo(folder / NAME)
    with pytest.raises(ValueError, match="it is a device or a pipe"):
        statement(folder / "manta.ply")
