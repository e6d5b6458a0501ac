"""Beds with marks, and scour about objects: what the shapes `seabed`, `bathymetry` and `targets` make of them.

The shapes of marks and moats are the business of tests/seabed; here the vertices must show them, in any order of
objects, and what a grid cannot carry must be refused.
"""
import numpy as np
import pytest
from scipy import ndimage

from mitsonar.scattering import DragMarks, PockMarks, SandRibbons

POCKMARKS = {"pockmark_density": 0.01, "pockmark_diameter": 3.0, "pockmark_depth": 0.3, "pockmark_spread": 0.2}
DRAG = {"drag_density": 0.003, "drag_width": 0.8, "drag_depth": 0.2, "drag_length": 20.0, "drag_heading_deg": 30.0}
RIBBONS = {"ribbon_spacing": 8.0, "ribbon_height": 0.2, "ribbon_heading_deg": 90.0, "ribbon_wander": 0.5}


def bed(**attributes):
    return {"type": "seabed", "id": "seabed", "depth": 10.0, "length": 24.0, "width": 30.0, "spacing": 0.2,
            **attributes}


def ref(name):
    return {"type": "ref", "id": name}


def block(x, y, size=(1.0, 1.0, 1.0)):
    """A cuboid about x, y, half a metre of which lies in the bed."""
    import mitsuba as mi

    return {"type": "cube", "to_world": mi.ScalarTransform4f().translate([x, y, -10 + size[2] - 0.5]).scale(size)}


def stones(on="seabed", **attributes):
    return {"type": "targets", "species": "rounded_stone", "count": 4, "scale": "1, 2", "burial": 0.2, "spacing": 3.0,
            "bed": ref(on), **attributes}


@pytest.fixture
def heights(variant):
    """Return the heights (Y, X) [m] of the bed of a scene."""
    import mitsuba as mi

    def of(shapes, name="seabed", rows=121):
        scene = mi.load_dict({"type": "scene", **shapes}, parallel=False, optimize=False)
        shape = next(shape for shape in scene.shapes() if shape.id() == name)
        return np.array(mi.traverse(shape)["vertex_positions"]).reshape(rows, -1, 3)[..., 2].astype(float)
    return of


@pytest.mark.parametrize("attributes, relief", [
    (POCKMARKS, PockMarks(density=0.01, diameter=3.0, depth=0.3, spread=0.2, seed=3)),
    (DRAG, DragMarks(density=0.003, width=0.8, depth=0.2, length=20.0, heading=np.deg2rad(30),
                     heading_spread=np.deg2rad(12), seed=3)),
    (RIBBONS, SandRibbons(spacing=8.0, height=0.2, heading=np.pi / 2, wander=0.5, seed=3)),
    ({**POCKMARKS, "pockmark_density": 0.0, "pockmark_diameter": 0.5, "pockmark_depth": 0.1},
     PockMarks(density=0.0, diameter=0.5, depth=0.1)),                             # however fine
], ids=["pock marks", "drag marks", "ribbons", "none"])
def test_marks_of_a_seabed(heights, attributes, relief):
    x, y = np.arange(-75, 76) * 0.2, np.arange(-60, 61) * 0.2
    np.testing.assert_allclose(heights({"seabed": bed(seed=3, **attributes)}), relief.on_grid(x, y) - 10, atol=2e-6)


def test_a_bed_is_scoured_about_what_it_refers_to(heights):
    shapes = {"block": block(2.0, -3.0), "seabed": bed(scour_depth=0.3, scour_heading_deg=90.0, on=ref("block"))}
    found = heights(shapes) + 10
    # the block stands 1.5 m out of the bed and is 2 m wide: 1.5 m is its size
    assert found.min() == pytest.approx(-0.3 * 1.5, rel=0.02) and found.max() == pytest.approx(0.15 * 1.5, rel=0.05)
    assert np.all(found[43:48, 83:88] == 0) and np.all(found[:, :20] == 0)           # below it, and far away
    assert found[45, 70] < -0.3 and found[45, 105] > 0.15                          # upstream, downstream
    away = heights({**shapes, "block": block(2.0, -3.0 + 2.0)}) + 10
    np.testing.assert_allclose(away[10:], found[:-10], atol=1e-5)                       # the moat moves with it


def test_targets_scour_their_bed_and_keep_their_places(variant, heights):
    import mitsuba as mi

    def placed(**attributes):
        scene = mi.load_dict({"type": "scene", "seabed": bed(), "stones": stones(**attributes)}, parallel=False,
                             optimize=False)
        return next(shape for shape in scene.shapes() if shape.id() == "stones").placed

    found = heights({"seabed": bed(), "stones": stones(scour_depth=0.3, scour_extent=2.5)}) + 10
    assert -0.6 < found.min() < -0.1 and 0.03 < found.max() < 0.3
    assert placed() == placed(scour_depth=0.3, scour_extent=2.5)
    for place in placed().values():
        x, y, z = place["position"]
        assert found[round((y + 12) / 0.2), round((x + 15) / 0.2)] == 0 and z == -10
        around = np.hypot(np.arange(-75, 76) * 0.2 - x, (np.arange(-60, 61) * 0.2)[:, None] - y)
        assert found[around < place["radius"] + 0.5].min() < -0.05
    assert not (heights({"seabed": bed(), "stones": stones()}) + 10).any()


def test_targets_lie_in_the_moat_about_a_fixed_object(variant, heights):
    import mitsuba as mi

    shapes = {"block": block(0.0, 0.0), "seabed": bed(scour_depth=0.4, scour_extent=3.0, on=ref("block"))}
    scene = mi.load_dict({"type": "scene", **shapes, "stones": stones(count=12, spacing=0.0, scale=0.3, scour_depth=0.3,
                                                                      scour_extent=8.0, area="-4, -6, 4, 6")},
                         parallel=False, optimize=False)
    ground = heights(shapes)
    placed = next(shape for shape in scene.shapes() if shape.id() == "stones").placed
    x, y, z = np.transpose([place["position"] for place in placed.values()])
    expected = ndimage.map_coordinates(ground, ((y + 12) / 0.2, (x + 15) / 0.2), order=1)
    assert expected.min() < -10.3
    np.testing.assert_allclose(z, expected, rtol=0, atol=0.03)             # a stone's footprint has a mean height


def test_the_order_of_objects_does_not_matter(heights):
    a, b = stones(scour_depth=0.3, scour_extent=2.5, seed=1), stones(scour_depth=0.5, scour_extent=3.0, seed=2)
    both = {"block": block(0.0, 0.0),
            "seabed": bed(scour_depth=0.2, on=ref("block"), ripple_wavelength=2.0, ripple_height=0.1)}
    one, other = heights({**both, "a": a, "b": b}), heights({**both, "b": b, "a": a})
    assert np.array_equal(one, other)


def test_a_bathymetry_is_scoured_too(heights, tmp_path):
    np.save(tmp_path / "flat.npy", np.full((121, 151), -10.0))
    survey = {"type": "bathymetry", "id": "seabed", "filename": str(tmp_path / "flat.npy"), "spacing": 0.2,
              "vertical": "elevation"}
    found = heights({"seabed": survey, "stones": stones(scour_depth=0.3, scour_extent=2.5)}) + 10
    assert -0.6 < found.min() < -0.1
    found = heights({"block": block(0.0, 0.0), "seabed": {**survey, "scour_depth": 0.3, "on": ref("block")}}) + 10
    assert found.min() == pytest.approx(-0.45, rel=0.02)


@pytest.mark.parametrize("shapes, said", [
    ({"seabed": {"pockmark_depth": 0.1}}, "pockmark_depth is written without pockmark_density and pockmark_diameter"),
    ({"seabed": {**POCKMARKS, "pockmark_diameter": 0.9}},
     "pockmark_diameter is 0.9 m on a grid of 0.2 m; the narrowest, 0.72 m, needs 4 nodes: use spacing <= 0.18"),
    ({"seabed": {**POCKMARKS, "pockmark_depth": 1.0}}, "its sides would be steeper than 45 degrees"),
    ({"seabed": {**DRAG, "drag_width": 0.5}}, "drag_width is 0.5 m on a grid of 0.2 m"),
    ({"seabed": {"drag_density": 0.1}}, "drag_density is written without drag_width and drag_depth and drag_length"),
    ({"seabed": {**RIBBONS, "ribbon_width": 0.5}}, "ribbon_width is 0.5 m on a grid of 0.2 m"),
    ({"seabed": {**RIBBONS, "ribbon_spacing": 1.5}}, "the narrowest, 0.75 m, needs 4 nodes: use spacing <= 0.1875"),
    ({"seabed": {"scour_depth": 0.3}}, "scour_depth is written, but no object"),
    ({"seabed": {"on": ref("block")}}, 'it refers to "block" without scour_depth'),
    ({"seabed": {"on": ref("block"), "scour_extent": 3.0}}, "scour_extent is written without scour_depth"),
    ({"seabed": {"on": ref("block"), "scour_depth": 0.3, "scour_extent": 0.5}}, "its sides would be steeper than 45"),
    ({"seabed": {"on": ref("block"), "scour_depth": 0.3, "scour_tail": 1.0}}, "tail is 1.0; it must be at least 2"),
    ({"seabed": {"on": ref("block"), "scour_depth": 0.01, "scour_extent": 0.4}},
     "the widest moat is 0.6 m wide on a bed with nodes every 0.2 m; a moat needs 4: use spacing <= 0.15"),
    ({"seabed": {}, "stones": {"scour_depth": 0.2, "scale": 0.1}}, "a moat needs 4"),
    ({"seabed": {"on": ref("far"), "scour_depth": 0.3}}, '"far" covers no node of the bed'),
    ({"seabed": {}, "stones": {"scour_depth": 0.2, "bed": ref("plate")}}, 'the bed "plate" is a'),
])
def test_refusals(heights, shapes, said):
    import mitsuba as mi

    from mitsonar.scene.errors import plain
    plate = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([0, 0, -20]).scale([20, 20, 1])}
    scene = {"block": block(0.0, 0.0), "far": block(90.0, 0.0), "plate": plate, "seabed": bed(**shapes["seabed"])}
    if "stones" in shapes:
        scene["stones"] = stones(**shapes["stones"])
    with pytest.raises((RuntimeError, ValueError)) as caught:
        heights(scene)
    assert said in plain(caught.value)



def test_a_bed_outlives_the_memory_of_its_mesh(variant):
    """Targets share the bed of a mesh, whose memory is given back when the first of them scour it."""
    import mitsuba as mi

    from mitsonar.plugins.shapes.scoured import mesh_arrays, vertices_before

    shape = mi.load_dict({"type": "scene", "seabed": bed()}, optimize=False).shapes()[0]
    kept, view = vertices_before(shape), mesh_arrays(shape)[0]
    assert (kept == view).all() and not np.shares_memory(kept, view)


def test_what_floats_scours_nothing(heights):
    scour = {"scour_depth": 0.2, "seed": 5}
    level = heights({"seabed": bed(), "boulders": stones(**scour, height="0.5, 2")})
    assert np.ptp(level) == 0 and np.ptp(heights({"seabed": bed(), "boulders": stones(**scour)})) > 0.1
