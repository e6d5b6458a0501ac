"""The files that a scene names, wherever it names them: looked at before Mitsuba opens them."""
import os
import shutil

import pytest
from mesh_files import FACES, ascii_ply, binary_ply, damaged, obj, serialized
from picture_files import png_of

import mitsonar

SCENE = """<scene version="3.0.0">
    <default name="mesh" value="sound.ply"/>
    <integrator type="sonar_path"><integer name="rays" value="2000"/></integrator>
    <sensor type="sidescan">
        <integer name="pings" value="1"/>
        <medium type="seawater"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="60"/><integer name="bins" value="20"/></film>
    </sensor>
    <shape type="seabed" id="bed"><float name="depth" value="30"/><float name="spacing" value="20"/></shape>
    BODY
</scene>
"""
SHAPE = '<shape type="ply" id="body"><string name="filename" value="{}"/></shape>'
TARGETS = ('<shape type="targets"><string name="meshes" value="{}"/><string name="count" value="1"/><ref id="bed"/>'
           '</shape>')
BITMAP = ('<bsdf type="lambert"><texture type="bitmap" name="mu_db"><string name="filename" value="{}"/></texture>'
          '</bsdf>')
INCLUDED = '<scene version="3.0.0">BODY</scene>'


@pytest.fixture
def load(tmp_path, variant):
    """Load a scene that holds a body, beside meshes that are sound and some that are not."""
    broken = [(0, 1, 99), *FACES[1:]]
    for name, content in {"sound.ply": binary_ply(), "broken.ply": binary_ply(broken), "spelt.ply": ascii_ply(broken),
                          "sound.obj": obj(), "sound.serialized": serialized(),
                          "broken.serialized": serialized(broken)}.items():
        (tmp_path / name).write_bytes(content)

    def load(body, **parameters):
        path = tmp_path / "scene.xml"
        path.write_text(SCENE.replace("BODY", body))
        return mitsonar.load_file(path, **parameters)
    return load


@pytest.mark.parametrize("name", ["sound.ply", "sound.obj", "sound.serialized"])
def test_sound_meshes_load(load, name):
    scene = load(SHAPE.replace('"ply"', f'"{name.rpartition(".")[2]}"').format(name))
    assert [shape.face_count() for shape in scene.shapes() if shape.id() == "body"] == [4]


@pytest.mark.parametrize("body, parameters, place", [
    (SHAPE.format("broken.ply"), {}, "line 10: ply"), (SHAPE.format("spelt.ply"), {}, "line 10: ply"),
    (SHAPE.format("$mesh"), {"mesh": "broken.ply"}, "line 10: ply"),
    ('<default name="other" value="broken"/>' + SHAPE.format("$other.ply"), {}, "line 10: ply"),
    (SHAPE.format("$filename.ply"), {"filename": "broken"}, "scene.xml: ply"),
    (SHAPE.replace('"ply"', '"serialized"').format("broken.serialized"), {}, "line 10: serialized"),
    (SHAPE.format("sound.ply") + TARGETS.format("broken.ply"), {}, "line 10: targets"),
    (f'<shape type="shapegroup" id="group">{SHAPE.format("broken.ply")}</shape>', {}, "line 10: ply"),
], ids=["plain", "spelt", "parameter", "default", "a name of the parser's", "serialized", "targets", "group"])
def test_faces_beyond_the_vertices_are_refused(load, body, parameters, place):
    with pytest.raises(ValueError, match="a face names vertex 99, and the vertices count from 0 to 3") as error:
        load(body, **parameters)
    assert place in str(error.value)


def test_included_files_are_looked_into(load, tmp_path):
    (tmp_path / "sub").mkdir()
    shutil.copy(tmp_path / "broken.ply", tmp_path / "sub" / "deep.ply")
    for name, body in (("inc.xml", '<include filename="sub/more.xml"/>'), ("sub/more.xml", SHAPE.format("$mesh"))):
        (tmp_path / name).write_text(INCLUDED.replace("BODY", body))
    assert len(load('<include filename="inc.xml"/>').shapes()) == 2
    for mesh in ("sub/deep.ply", tmp_path / "sub" / "deep.ply"):
        with pytest.raises(ValueError, match="more.xml, line 1: ply: the mesh .*deep.ply is damaged"):
            load('<include filename="inc.xml"/>', mesh=mesh)
    with pytest.raises(ValueError, match="deep.ply is damaged"):
        load('<path value="sub"/>' + SHAPE.format("deep.ply"))


@pytest.mark.parametrize("name", ["i" * 201, "ж" * 101])
def test_ids_that_no_image_has_room_for_are_refused(load, name):
    with pytest.raises(ValueError, match="scene.xml, line 10: ply: the id .* has 20[12] bytes; give at most 200"):
        load(SHAPE.replace("ply", f'ply" id="{name}', 1).replace(' id="body"', "").format("sound.ply"))


def test_the_longest_id_is_written_and_read(load, tmp_path):
    name = "ж" * 100
    image = mitsonar.render(load(SHAPE.replace("body", name).format("sound.ply")))
    mitsonar.write(image, tmp_path / "a.exr")
    assert mitsonar.read(tmp_path / "a.exr").identical(image) and name in image.attrs["labels"].values()


@pytest.mark.parametrize("kind", ["ellipsoids", "ellipsoidsmesh"])
def test_files_that_nobody_checks_are_refused(load, kind):
    with pytest.raises(ValueError, match=f"{kind} cannot be used here"):
        load(SHAPE.replace('"ply"', f'"{kind}"').format("sound.ply"))


def test_a_mesh_from_elsewhere_is_refused_when_rendered(load):
    import drjit as dr
    import mitsuba as mi

    scene = load(SHAPE.format("sound.ply"))
    parameters = mi.traverse(scene)
    parameters["body.vertex_positions"] = dr.zeros(mi.Float, 9)     # and the faces still name a fourth vertex
    with pytest.raises(ValueError, match='a face of the mesh "body" names vertex 3, and the vertices count from 0 to'):
        mitsonar.render(scene)


def test_a_texture_that_claims_more_than_a_memory_holds_is_refused(load, tmp_path):
    (tmp_path / "huge.png").write_bytes(png_of(20000, 20000))
    with pytest.raises(ValueError, match="line 10: bitmap: the picture .*huge.png cannot be read: Image size"):
        load(BITMAP.format("$mesh"), mesh="huge.png")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("body", [
    SHAPE.format("{}"), SHAPE.replace('"ply"', '"obj"'), BITMAP, TARGETS, '<include filename="{}"/>',
    '<bsdf type="diffuse"><spectrum name="reflectance" filename="{}"/></bsdf>',
    '<shape type="bathymetry"><string name="filename" value="{}"/></shape>',
    '<shape type="linearcurve"><string name="filename" value="{}"/></shape>',
    '<medium type="seawater"><string name="cast" value="{}"/></medium>',
], ids=["ply", "obj", "bitmap", "targets", "include", "spectrum", "bathymetry", "curve", "cast"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_pipes_devices_and_folders_are_refused(load, tmp_path, body, kind):
    name = {"pipe": tmp_path / "pipe.ply", "device": "/dev/zero", "folder": tmp_path / "folder.ply"}[kind]
    os.mkfifo(tmp_path / "pipe.ply")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(ValueError, match="device or a pipe|is a folder|names the folder|holds no mesh|is no folder"):
        load(body.format(name))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_scene_that_is_a_pipe_is_refused(tmp_path, variant):
    os.mkfifo(tmp_path / "scene.xml")
    with pytest.raises(ValueError, match="scene.xml: it is a device or a pipe; give the path of a Mitsuba XML file"):
        mitsonar.load_file(tmp_path / "scene.xml")


def test_elements_within_elements_without_end(load):
    with pytest.raises(ValueError, match="more than 200 elements are nested in one another"):
        load("<a>" * 100_000 + "</a>" * 100_000)


def test_damaged_scenes_load_or_say_why(load, tmp_path, rng):
    import mitsuba as mi

    mi.set_log_level(mi.LogLevel.Error)
    path = tmp_path / "scene.xml"
    (tmp_path / "inc.xml").write_text(INCLUDED.replace("BODY", SHAPE.format("sound.ply")))
    whole = SCENE.replace("BODY", '<include filename="inc.xml"/>' + SHAPE.format("$mesh")).encode()
    for _ in range(150):
        path.write_bytes(damaged(whole, rng))
        try:
            mitsonar.load_file(path)
        except (ValueError, OSError) as error:
            assert "\n" not in str(error) and "Traceback" not in str(error) and len(str(error)) < 2000


@pytest.mark.parametrize("content, sentence", [
    ("root:secret\n", "the file .*table.txt., line 1, is not a table; expected two numbers a line, such as 10 1490.5"),
    ("0 1500\n9 secret\n", "the file .*table.txt., line 2, is not a table"),
    ("9 1500\n0 1500\n", "the file .*table.txt.: the first numbers of a table .* must increase"),
    ("9 1500\n", "the file .*table.txt.: a table needs at least two entries"),
])
def test_files_that_are_no_tables_are_not_quoted(load, tmp_path, content, sentence):
    (tmp_path / "table.txt").write_text(content)
    with pytest.raises(ValueError, match=sentence) as error:
        load('<bsdf type="diffuse"><spectrum name="reflectance" filename="table.txt"/></bsdf>')
    assert "secret" not in str(error.value) and "cpp" not in str(error.value)


def test_a_list_of_a_million_numbers_is_refused_in_a_sentence(load):
    body = '<shape type="point_target"><point name="position" value="0"/><string name="nothing" value="{}"/></shape>'
    with pytest.raises(ValueError, match="point_target: .* ... ") as error:
        load(body.format("1, " * 1_000_000))
    assert len(str(error.value)) < 1000


def blends(levels, first):
    """A blend of a blend of ... of one material with itself: 2^levels ways lead down to it."""
    ends = '<bsdf type="diffuse" id="m0"/>'
    return ends + "".join(f'<bsdf type="blendbsdf" id="m{k}"><float name="weight" value="0.5"/><ref id="m{k - 1}"/>'
                          f'<ref id="{first or f"m{k - 1}"}"/></bsdf>' for k in range(1, levels + 1))


def test_materials_that_hold_others_in_too_many_ways(load):
    assert len(load(blends(8, None)).shapes()) == 1
    assert len(load(blends(40, "m0")).shapes()) == 1               # deep, and of few ways
    with pytest.raises(ValueError, match="line 10: blendbsdf: it holds other objects in more than 100000 ways"):
        load(blends(40, None))


def test_objects_that_hold_themselves(load):
    with pytest.raises(ValueError):
        load('<bsdf type="blendbsdf" id="a"><float name="weight" value="0.5"/><ref id="a"/><ref id="a"/></bsdf>')
