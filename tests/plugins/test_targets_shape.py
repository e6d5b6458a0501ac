"""The shape `targets`: what it makes of a folder of meshes and a seabed, what it says of them, what it refuses.

Where targets lie and how is the business of tests/seabed/test_placing.py; here a ray from above must meet them there.
"""
import json
from pathlib import Path

import numpy as np
import pytest

import mitsonar

SCENES = Path(__file__).resolve().parents[2] / "scenes"
FOLDER = str(SCENES / "targets")
PLY = """ply
format ascii 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""
TETRAHEDRON = PLY.format(vertices=4, faces=4) + """0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 0 3 2
3 1 2 3
"""


def bed(**attributes):
    return {"type": "seabed", "depth": 10.0, "length": 40.0, "width": 60.0, "spacing": 0.5, **attributes}


@pytest.fixture
def strewn(variant):
    """Return a scene's targets and seabed."""
    import mitsuba as mi

    def run(ground=None, **attributes):
        targets = {"type": "targets", "meshes": FOLDER, "bed": {"type": "ref", "id": "seabed"}, **attributes}
        scene = mi.load_dict({"type": "scene", "seabed": ground or bed(), "mines": targets}, optimize=False)
        return next(shape for shape in scene.shapes() if shape.id() == "mines"), scene
    return run


def geometry_of(shape):
    import mitsuba as mi

    parameters = mi.traverse(shape)
    return (np.array(parameters["vertex_positions"]).reshape(-1, 3), np.array(parameters["faces"]).reshape(-1, 3))


def test_parts_are_the_targets_told(strewn):
    shape, _ = strewn(count=20, spacing=1.0, burial="0.1, 0.4", seed=3)
    assert tuple(shape.placed) == shape.part_names and len(shape.part_names) == 20
    assert json.loads(json.dumps(shape.placed)) == shape.placed
    vertices, faces = geometry_of(shape)
    assert len(shape.part_of_face) == len(faces) and shape.part_of_face.dtype == np.uint32
    for part, (name, told) in enumerate(shape.placed.items()):
        assert name == f"{told['species']}.mines.{part + 1}"
        corners = vertices[faces[shape.part_of_face == part]].reshape(-1, 3)
        low, high = corners.min(axis=0), corners.max(axis=0)
        assert (-10 - low[2]) / (high[2] - low[2]) == pytest.approx(told["burial"], abs=1e-3)
        assert np.hypot(*(corners[:, :2] - told["position"][:2]).T).max() == pytest.approx(told["radius"], abs=1e-3)


def test_faces_look_outwards_whatever_the_pose(strewn):
    shape, _ = strewn(count=10, pose="any", tilt_deg="0, 90", seed=2)
    vertices, faces = geometry_of(shape)
    for part in range(10):
        a, b, c = np.moveaxis(vertices[faces[shape.part_of_face == part]].astype(float), 1, 0)
        middle = (a + b + c).mean(axis=0) / 3                          # near by, so that rounding stays small
        assert np.einsum("ij,ij->", a - middle, np.cross(b - a, c - a)) > 0


def test_a_ray_from_above_meets_what_the_labels_say(strewn):
    import mitsuba as mi

    from mitsonar.scene.geometry import Geometry

    shape, scene = strewn(species="crate, drum", count=6, spacing=2.0)
    labels = Geometry(scene).labels
    assert set(labels.values()) == {"seabed", *shape.part_names}
    for name, told in shape.placed.items():
        x, y, _ = told["position"]
        hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(x + 0.01, y + 0.02, 0), mi.Vector3f(0, 0, -1)))
        assert float(hit.t[0]) < 9.6                                   # on the target, 0.4 m or higher over the bed
        assert shape.part_names[shape.part_of_face[hit.prim_index.numpy()[0]]] == name


def test_an_image_names_every_target(variant, tmp_path):
    scene = mitsonar.load_file(SCENES / "minefield.xml", pings=4, rays=4000, bins=100, bed_spacing=0.3, count="3, 6",
                               clutter_count=2, target_seed=5)
    mines, clutter = ({shape.id(): shape for shape in scene.shapes()}[name] for name in ("mines", "clutter"))
    image = mitsonar.render(scene, 1)
    assert 3 <= len(mines.placed) <= 6 and len(clutter.placed) == 2
    assert set(image.attrs["labels"].values()) == {"seabed", *mines.part_names, *clutter.part_names}
    places = np.array([(*told["position"][:2], told["radius"]) for told in (*mines.placed.values(),
                                                                            *clutter.placed.values())])
    gaps = np.hypot(*(places[:, None, :2] - places[:, :2]).transpose(2, 0, 1)) - places[:, 2] - places[:, None, 2]
    assert gaps[~np.eye(len(places), dtype=bool)].min() >= 2 - 1e-3    # the clutter is kept clear of the mines


def test_none_at_all_leaves_nothing_but_the_seabed(strewn):
    from mitsonar.scene.geometry import Geometry

    shape, scene = strewn(count=0)
    assert shape.placed == {} and set(Geometry(scene).labels.values()) == {"seabed"}
    assert float(shape.bbox().max.z) < -10


def test_two_shapes_of_one_seed_are_not_alike(variant):
    import mitsuba as mi

    both = {name: {"type": "targets", "meshes": FOLDER, "count": 5, "bed": {"type": "ref", "id": "seabed"}}
            for name in ("mines", "rocks")}
    scene = mi.load_dict({"type": "scene", "seabed": bed(), **both}, optimize=False)
    a, b = (list(shape.placed.values()) for shape in scene.shapes() if shape.id() != "seabed")
    assert not any(one["position"] == other["position"] for one, other in zip(a, b))


def test_shapes_that_keep_clear_of_others_share_their_bed(variant):
    import mitsuba as mi

    def targets(on, *others):
        return {"type": "targets", "meshes": FOLDER, "count": 2, "bed": {"type": "ref", "id": on},
                **{f"clear{number}": {"type": "ref", "id": other} for number, other in enumerate(others)}}

    scene = mi.load_dict({"type": "scene", "seabed": bed(), "other": bed(depth=30.0), "a": targets("seabed"),
                          "b": targets("seabed", "a"), "c": targets("other", "a")}, parallel=False, optimize=False)
    shapes = {shape.id(): shape for shape in scene.shapes()}
    assert shapes["b"].bed is shapes["a"].bed and shapes["c"].bed is not shapes["a"].bed
    assert all(place["position"][2] < -25 for place in shapes["c"].placed.values())


def test_meshes_may_be_files_of_either_kind(strewn, tmp_path):
    (tmp_path / "rock.ply").write_text(TETRAHEDRON)
    (tmp_path / "mine.OBJ").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    shape, _ = strewn(meshes=f"{tmp_path}/rock.ply, {tmp_path}/mine.OBJ", count=12)
    assert {told["species"] for told in shape.placed.values()} == {"rock", "mine"}
    shape, _ = strewn(meshes=str(tmp_path), species="mine", count=3)
    assert {told["species"] for told in shape.placed.values()} == {"mine"}


def test_a_folder_states_class_units_and_axes_of_its_meshes(strewn, tmp_path):
    """A tetrahedron of 400 mm whose file has y up stands as high as the same in metres, z up."""
    corners = TETRAHEDRON.replace("0 0 1\n3", "0 2 0\n3")
    (tmp_path / "peak.ply").write_text(corners.replace("1 0 0\n0 1 0\n0 2 0", "200 0 0\n0 0 -200\n0 400 0"))
    (tmp_path / "meshes.toml").write_text('unit = "mm"\nup = "y"\n[peak]\nclass = "mine"\nlicence = "CC0-1.0"\n')
    shape, scene = strewn(meshes=str(tmp_path), count=3, heading_deg="0")
    assert shape.part_names == ("mine.mines.1", "mine.mines.2", "mine.mines.3")
    vertices, _ = geometry_of(shape)
    first = vertices[:4] - vertices[:4].min(axis=0)
    np.testing.assert_allclose(first.max(axis=0), [0.2, 0.2, 0.4], atol=1e-5)
    assert {entry["species"] for entry in shape.placed.values()} == {"peak"}
    assert shape.mesh_sources["peak"][1].licence == "CC0-1.0"
    (tmp_path / "meshes.toml").write_text("[peek]\n")
    with pytest.raises(Exception, match=r'has the table \[peek\] \(did you mean "peak"\?\)'):
        strewn(meshes=str(tmp_path), count=3)


@pytest.mark.parametrize("attributes, said", [
    ({"meshes": "nowhere"}, 'meshes names "nowhere", which is no folder; it is looked for beside the scene'),
    ({"meshes": " "}, "meshes is empty; give a folder, or files"),
    ({"meshes": "a.ply, b.ply"}, "the mesh a.ply is not there"),
    ({"meshes": "a.ply, b.stl"}, 'meshes names "a.ply, b.stl", which is no folder'),
    ({"species": "cylinder, mermaid"}, 'no species is called "mermaid"; meshes holds anchor, boulder'),
    ({"species": "tyre, tyre"}, "species names one twice"),
    ({"weights": "1, 2"}, "weights are 2 numbers for 13 species (anchor, boulder"),
    ({"weights": "0, 0"}, "weights are not at least 0, one of them above"),
    ({"count": "3, 8.5"}, 'count is 3, 8.5; expected a whole number or two, "low, high", from 0 to 100000'),
    ({"count": -1}, "count is -1; expected a whole number"),
    ({"count": "many"}, 'count is the string "many"; expected a list of numbers'),
    ({"count": 90_000}, "90000 targets of up to 1840 triangles are more than 5000000 together; use fewer, or coarser"),
    ({"burial": "0.5, 0.2"}, 'burial is 0.5, 0.2; expected a number or two, "low, high", from 0 to 1'),
    ({"burial": 1.5}, "burial is 1.5; expected a number"),
    ({"scale": "1, 2, 3"}, "scale is 1, 2, 3; expected a number or two"),
    ({"scale": 1000.0, "species": "tyre"}, "the mesh tyre is 1000 m long at a scale of 1000; targets measure 0.001 to"),
    ({"tilt_deg": -5}, "tilt_deg is -5; expected a number or two"),
    ({"pose": "stand"}, 'pose is the string "stand"; expected one of "upright", "rest", "any"'),
    ({"area": "10, 0, 0, 10"}, "area is 10, 0, 0, 10; expected west, south, east, north [m], west below east"),
    ({"exclude": "0, 0, 1"}, "exclude holds 3 numbers; expected four a box"),
    ({"area": "100, 100, 120, 120"}, "the area 100, 100, 120, 120 lies beside the seabed, which is -30, -20, 30, 20"),
    ({"spacing": 40.0}, "of 5 targets found room on 60 x 40 m"),
    ({"height": 10.5}, "target 1, of height 10.5 m, floats above the sea surface (z = 0); give a height below"),
    ({"seed": -1}, "seed is the integer -1; expected an integer at least 0"),
    ({"radius": 2.0}, 'unknown attribute "radius"'),
])
def test_refusals(strewn, attributes, said):
    from mitsonar.scene.errors import plain
    with pytest.raises(RuntimeError) as caught:
        strewn(**{"count": 5, **attributes})
    sentence = plain(caught.value)
    assert said in sentence and "\n" not in sentence


def test_a_crowded_field_has_fewer_targets_and_says_so(strewn):
    with pytest.warns(UserWarning, match=r"\d of 5 targets found room"):
        field, _ = strewn(count=5, spacing=40.0, crowded="fewer")
    assert 0 < len(field.placed) < 5


@pytest.mark.parametrize("name, text, said", [
    ("empty.ply", "", "has 0 bytes"),
    ("cut.ply", TETRAHEDRON[:200], "is damaged, or no PLY file of"),
    ("huge.ply", TETRAHEDRON.replace("vertex 4", "vertex 1000000000"), "its header counts 1000000000 elements"),
    ("faceless.ply", PLY.format(vertices=4, faces=0) + "0 0 0\n1 0 0\n0 1 0\n0 0 1\n", "elements are none"),
    ("beyond.ply", TETRAHEDRON.replace("3 1 2 3", "3 1 2 9"), "a face names vertex 9, and the vertices count from"),
    ("flat.ply", TETRAHEDRON.replace("0 0 1\n", "1 1 0\n"), "the mesh flat lies in a plane"),
    ("text.obj", "hello\nworld\n", "or no OBJ file of triangles: it has no vertices"),
    ("millimetres.ply", TETRAHEDRON.replace("1 0 0\n", "1900 0 0\n"), "is the file in metres?"),
    ("big.mine.ply", TETRAHEDRON, "has a dot in its name"),
])
def test_meshes_that_are_refused(strewn, tmp_path, name, text, said):
    from mitsonar.scene.errors import plain
    (tmp_path / name).write_text(text)
    with pytest.raises(RuntimeError) as caught:
        strewn(meshes=str(tmp_path / name), count=2)
    sentence = plain(caught.value)
    assert said in sentence and "\n" not in sentence
    assert name.rpartition(".")[0] in sentence


def test_a_folder_without_meshes_and_beds_that_are_none_are_refused(strewn, make, tmp_path):
    from mitsonar.scene.errors import plain

    def said(run):
        with pytest.raises(RuntimeError) as caught:
            run()
        return plain(caught.value)
    assert f"the folder {tmp_path} holds no mesh; put .ply or .obj files into it" in said(
        lambda: strewn(meshes=str(tmp_path), count=2))
    assert 'a seabed is missing; refer to one: <ref id="seabed"/>' in said(
        lambda: make("targets", meshes=FOLDER, count=2))
    assert "is no mesh; refer to a seabed" in said(lambda: strewn(ground={"type": "sphere"}, count=2))


def test_a_mesh_is_read_once_for_scenes_and_again_when_its_content_differs(strewn, tmp_path, monkeypatch):
    # Same size and time, so that nothing but the content shows the change.
    import os

    from mitsonar.plugins.shapes import targets

    read, path = [], tmp_path / "tetrahedron.ply"
    monkeypatch.setattr(targets.mi, "load_dict", lambda d, load=targets.mi.load_dict, **kw: (
        read.append(d["filename"]) if d["type"] == "ply" else None, load(d, **kw))[1])
    heights = []
    for text in (TETRAHEDRON, TETRAHEDRON, TETRAHEDRON.replace("0 0 1", "0 0 2")):
        path.write_text(text)
        os.utime(path, ns=(10**18, 10**18))
        vertices, _ = geometry_of(strewn(count=1, meshes=str(path), seed=1)[0])
        heights.append(float(np.ptp(vertices[:, 2])))
    assert heights == pytest.approx([1, 1, 2], rel=1e-5)
    assert len(read) == 2
