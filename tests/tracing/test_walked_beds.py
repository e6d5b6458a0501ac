"""Large beds that are grids are walked cell by cell: the same first hits as Embree's, and no tree of Mitsuba's.

Embree answers in float32, too, so both differ by its rounding. Triangles are widened by 0.002 cells, 1 mm here, which
raises crests of slope 0.5 by half a millimetre on a relief of 400 mm rms: a ray in some hundreds that runs almost level
meets a crest there which it would have passed, and one in thousands of all others.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsonar
from mitsonar.scene.loading import load_file, load_for_sonar
from mitsonar.scene.queries import height_field
from mitsonar.scene.queries.height_field import HeightField, as_grid, mesh_arrays
from mitsonar.scene.queries.several_scenes import SeveralScenes

RAYS = 20_000
SHARE = {"anywhere": 1e-3, "grazing": 1e-2, "level": 1e-2, "vertical": 1e-3}

SCENE = """<scene version="3.0.0">
    <integrator type="sonar_path"><integer name="rays" value="20000"/></integrator>
    <shape type="seabed" id="seabed">
        <float name="depth" value="20"/> <float name="length" value="40"/> <float name="width" value="60"/>
        <float name="spacing" value="0.5"/> <string name="fractal_sediment" value="medium sand"/> {more}
    </shape>
    <shape type="sphere" id="ball"><point name="center" x="3" y="0.2" z="-18"/><float name="radius" value="1"/></shape>
    <sensor type="sidescan"><integer name="pings" value="2"/><float name="altitude" value="10"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="25"/><integer name="bins" value="100"/></film></sensor>
</scene>"""


@pytest.fixture
def rough(variant):
    """A rough bed of 90 x 70 cells, whose blocks do not divide it, and its heights and mesh."""
    scene = mi.load_dict({"type": "scene", "seabed": {
        "type": "seabed", "depth": 20.0, "length": 35.0, "width": 45.0, "spacing": 0.5, "fractal_rms": 0.4}})
    return scene, as_grid(*mesh_arrays(scene.shapes()[0]))


def directions(name, generator):
    """Unit directions of a kind (RAYS, 3)."""
    azimuth, up = generator.uniform(0, 2 * np.pi, RAYS), generator.uniform(-1, 1, RAYS)
    up = {"anywhere": up, "grazing": 0.05 * up, "level": 0 * up, "vertical": np.sign(up)}[name]
    return np.stack([np.sqrt(1 - up**2) * np.cos(azimuth), np.sqrt(1 - up**2) * np.sin(azimuth), up])


@pytest.mark.parametrize("longest", [np.inf, 2.0])
@pytest.mark.parametrize("name", ["anywhere", "grazing", "level", "vertical"])
def test_hits_are_those_of_a_tree(rough, name, longest):
    scene, grid = rough
    generator = np.random.default_rng(3)
    starts = generator.uniform([-30, -25, -21], [30, 25, -17], (RAYS, 3)).T
    ray = mi.Ray3f(mi.Point3f(starts.astype(np.float32)), mi.Vector3f(directions(name, generator).astype(np.float32)))
    ray.maxt = mi.Float(longest)
    walked, tree = (asked.ray_intersect_preliminary(ray) for asked in (HeightField(grid, 1), scene))
    hit, same = walked.is_valid().numpy(), walked.is_valid().numpy() & tree.is_valid().numpy()
    assert same.sum() > 100
    assert np.mean(hit != tree.is_valid().numpy()) < SHARE[name]
    assert np.mean(np.abs(walked.t.numpy() - tree.t.numpy())[same] > 1e-3) < SHARE[name]
    face = same & (walked.prim_index.numpy() == tree.prim_index.numpy())
    assert face.sum() > 0.97 * same.sum()                  # the others lie on an edge of two
    assert np.quantile(np.abs(walked.prim_uv.numpy() - tree.prim_uv.numpy())[:, face], 0.99) < 1e-3


@pytest.mark.parametrize("place", [0.0, 900.0])
def test_steep_hits_on_wide_grids_are_as_exact_as_their_rays(variant, place):
    """Times of steep hits are found from their small distance across, so that micrometres count.

    float32 places are 30 um apart at 900 m, where the ray begins exactly on one; the corner is 12,000 cells away.
    """
    heights = np.random.default_rng(4).uniform(-20.2, -20, (3, 24_001)).astype(np.float32)
    grid = height_field.HeightGrid(corner=np.array([-1200.0, -0.1]), spacing=np.array([0.1, 0.1]), heights=heights)
    off = np.geomspace(1e-7, 1e-3, 2000)
    direction = np.stack([off, 0.5 * off, -np.ones_like(off)]).astype(np.float32)
    ray = mi.Ray3f(mi.Point3f(place, 0.0, 0.0), mi.Vector3f(direction))
    found = HeightField(grid, 1).ray_intersect_preliminary(ray)
    column, upper = np.divmod(found.prim_index.numpy() // 2, 24_000)[1], found.prim_index.numpy() % 2
    u, v = found.prim_uv.numpy().astype(float)
    x = -1200 + 0.1 * (column + np.where(upper, 1 - v, u))
    assert found.is_valid().numpy().all()
    assert np.abs(x - np.float32(place) - found.t.numpy() * direction[0].astype(float)).max() < 2e-7


def test_nothing_is_hit_by_inactive_rays_and_beyond_the_bed(rough):
    field = HeightField(rough[1], 1)
    ray = mi.Ray3f(mi.Point3f(mi.Float([0, 0, 30]), 0, 0), mi.Vector3f(0, 0, -1))
    found = field.ray_intersect_preliminary(ray, active=mi.Bool([True, False, True]))
    assert found.is_valid().numpy().tolist() == [True, False, False]
    assert found.t.numpy()[0] == pytest.approx(-float(np.asarray(rough[1].heights)[35, 45]), abs=1e-4)


@pytest.mark.parametrize("broken", [np.nan, np.inf, -np.inf, 1e30])
@pytest.mark.parametrize("which", ["o", "d"])
@pytest.mark.parametrize("axis", range(3))
def test_rays_of_no_numbers_hit_nothing_and_end(rough, broken, which, axis):
    ray = mi.Ray3f(mi.Point3f(mi.Float([1, 1]), 2, 0), mi.Vector3f(mi.Float([0.1, 0.1]), 0.1, -1))
    getattr(ray, which)[axis] = mi.Float([broken, getattr(ray, which)[axis].numpy()[0]])
    found = HeightField(rough[1], 1).ray_intersect_preliminary(ray)
    assert found.is_valid().numpy()[1]
    assert which == "d" and not np.isnan(broken) or not found.is_valid().numpy()[0]
    assert (found.prim_index.numpy() < 1 << 31).all() and (np.abs(found.prim_uv.numpy()) <= 1).all()


@pytest.mark.parametrize("edit", ["shuffled faces", "a node aside", "a hole", "mirrored"])
def test_other_meshes_are_no_grids(rough, edit):
    vertices, faces = (array.copy() for array in mesh_arrays(rough[0].shapes()[0]))
    if edit == "shuffled faces":
        faces[[0, 9]] = faces[[9, 0]]
    elif edit == "a node aside":
        vertices[40, 0] += 0.01
    elif edit == "a hole":
        faces = faces[:-1]
    else:
        faces = faces[:, ::-1]
    assert as_grid(vertices, faces) is None


@pytest.fixture
def few(variant, monkeypatch):
    """Beds of any size count as large."""
    monkeypatch.setattr(height_field, "FEWEST", 1)


@pytest.mark.parametrize("more", ["", '<float name="scour_depth" value="0.5"/><float name="scour_extent" value="4"/>'
                                      '<ref id="pile"/>'], ids=["bare", "scoured"])
def test_a_scene_loaded_for_a_sonar_has_the_image_of_any_other(few, tmp_path, more):
    path, pile = tmp_path / "scene.xml", ""
    if more:
        pile = ('<shape type="cube" id="pile"><transform name="to_world"><scale value="2"/>'
                '<translate x="-5" z="-19"/></transform></shape>')
    path.write_text(SCENE.format(more=more).replace('<shape type="seabed"', f'{pile}<shape type="seabed"'))
    scenes = load_file(path), load_for_sonar(path)
    beds = [mesh_arrays(next(shape for shape in scene.shapes() if shape.id() == "seabed")) for scene in scenes]
    assert all(np.array_equal(whole, withheld) for whole, withheld in zip(*beds))
    below = mi.Ray3f(mi.Point3f(5, 5, -1), mi.Vector3f(0, 0, -1))
    assert [bool(scene.ray_test(below)[0]) for scene in scenes] == [True, False]
    images = [mitsonar.render(scene, seed=2) for scene in scenes]
    assert images[0].equals(images[1])                     # their attributes hold the time


def test_a_bed_within_a_group_keeps_its_tree(few, tmp_path):
    path = tmp_path / "scene.xml"
    bed = SCENE.format(more="")
    first, last = bed.index('    <shape type="seabed"'), bed.index("</shape>") + len("</shape>")
    group = (f'<shape type="shapegroup" id="group">{bed[first:last]}</shape>'
             '<shape type="instance" id="bed"><ref id="group"/></shape>')
    path.write_text(bed[:first] + group + bed[last:])
    assert dr.all(load_for_sonar(path).ray_test(mi.Ray3f(mi.Point3f(5, 5, -1), mi.Vector3f(0, 0, -1))))


def test_the_nearest_of_fields_and_scene_is_hit(rough):
    scene, grid = rough
    ball = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "center": [0, 0, -18], "radius": 1.0}})
    both = SeveralScenes(scene, HeightField(grid, 1), ball)
    ray = mi.Ray3f(mi.Point3f(mi.Float([0, 6]), 0, -10), mi.Vector3f(0, 0, -1))
    assert both.ray_intersect_preliminary(ray).t.numpy()[0] == pytest.approx(7.0, abs=1e-4)
    assert both.ray_intersect_preliminary(ray).t.numpy()[1] == pytest.approx(10.0, abs=1.5)
    ray.maxt = mi.Float(7.5)
    assert both.ray_test(ray).numpy().tolist() == [True, False]
