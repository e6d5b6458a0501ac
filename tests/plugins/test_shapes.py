"""The shapes `seabed` and `bathymetry` as Mitsuba sees them: rays dropped on them land at the heights of their grids.

Vertices are float32 about the local origin, so heights are right to 1e-5 m; between nodes a triangle differs from the
relief by its curvature, so rays are dropped on nodes. A ray on an edge may slip through a mesh: they aim 1 mm beside.
"""
import time

import numpy as np
import pytest

import mitsonar  # noqa: F401  sets up LLVM before Dr.Jit is loaded
from mitsonar.scattering import Fractal, Plane, Ripples, RoughnessSpectrum, Sinusoid

mi = pytest.importorskip("mitsuba")


@pytest.fixture(scope="module", autouse=True)
def shapes():
    """Register the shapes for the variant of these tests."""
    mi.set_variant("llvm_ad_mono")
    import mitsonar.plugins.shapes.bathymetry
    import mitsonar.plugins.shapes.seabed  # noqa: F401  (registers it)


def seabed(**attributes):
    return mi.load_dict({"type": "seabed", "id": "bed", "depth": 20.0, "length": 20.0, "width": 30.0, "spacing": 0.25,
                         **attributes})


def drop(shape, x, y):
    """Return what rays falling from z = 100 m meet."""
    scene = mi.load_dict({"type": "scene", "bed": shape}, optimize=False)
    x, y = np.broadcast_arrays(np.asarray(x, np.float32), np.asarray(y, np.float32))
    origin = mi.Point3f(mi.Float(x.ravel()), mi.Float(y.ravel()), 100.0)
    return scene.ray_intersect(mi.Ray3f(origin, mi.Vector3f(0, 0, -1)))


def heights_below(shape, x, y):
    hits = drop(shape, x, y)
    return np.where(np.array(hits.is_valid()), np.array(hits.p.z), np.nan)


def inner(count, spacing):
    return (np.arange(count) - count // 2) * spacing + 1e-3


def test_flat_seabed():
    bed = seabed()
    assert bed.vertex_count() == 81 * 121 and bed.face_count() == 2 * 80 * 120
    assert np.array_equal(np.array([bed.bbox().min, bed.bbox().max]), [[-15, -10, -20], [15, 10, -20]])
    hits = drop(bed, inner(40, 0.5), 0.7)
    assert np.allclose(np.array(hits.n), [[0], [0], [1]]) and np.allclose(np.array(hits.p.z), -20)


def test_extent_reaches_at_least_as_far_as_asked_with_a_node_at_the_origin():
    bed = seabed(length=20.1, width=0.3, spacing=0.25)
    assert np.array_equal(np.array(bed.bbox().max)[:2], [0.25, 10.25])


@pytest.mark.parametrize("attributes, relief", [
    ({"slope_deg": 5.0, "slope_heading_deg": 30.0}, Plane(slope=np.deg2rad(5), heading=np.deg2rad(30))),
    ({"sine_wavelength": 4.0, "sine_height": 0.8, "sine_heading_deg": 20},
     Sinusoid(wavelength=4.0, height=0.8, heading=np.deg2rad(20))),
    ({"ripple_wavelength": 2.0, "ripple_height": 0.3, "ripple_heading_deg": 90, "ripple_asymmetry": 0.3,
      "ripple_sharpness": 0.5, "ripple_wander": 0.2, "ripple_wander_length": 9.0, "ripple_defects": 0.05, "seed": 4},
     Ripples(wavelength=2.0, height=0.3, heading=np.pi / 2, asymmetry=0.3, sharpness=0.5, wander=0.2,
             wander_length=9.0, defect_density=0.05, seed=4)),
    ({"fractal_sediment": "medium sand", "fractal_outer_scale": 3.0, "seed": 1},
     Fractal(spectrum=RoughnessSpectrum.of_sediment("medium sand", outer_scale=3.0), seed=1)),
    ({"fractal_w2": 1e-4, "fractal_gamma": 3.0},
     Fractal(spectrum=RoughnessSpectrum(w2=1e-4, gamma=3.0))),
    ({"fractal_rms": 0.05, "fractal_gamma": 3.0},
     Fractal(spectrum=RoughnessSpectrum.of_height(0.05, gamma=3.0))),
    ({"slope_deg": 5.0, "sine_wavelength": 4.0, "sine_height": 0.8, "fractal_rms": 0.05},
     Plane(slope=np.deg2rad(5)) + Sinusoid(wavelength=4.0, height=0.8)
     + Fractal(spectrum=RoughnessSpectrum.of_height(0.05))),
], ids=lambda value: next(iter(value)) if isinstance(value, dict) else "")
def test_parts(attributes, relief):
    x, y = np.arange(-60, 61) * 0.25, np.arange(-40, 41) * 0.25
    expected = relief.on_grid(x, y) - 20
    bed = seabed(**attributes)
    nodes = np.array(mi.traverse(bed)["vertex_positions"]).reshape(81, 121, 3)
    assert np.abs(nodes[..., 2] - expected).max() < 1e-5
    assert np.array_equal(nodes[0, :, 0], x) and np.array_equal(nodes[:, 0, 1], y)
    columns, rows = np.meshgrid(np.arange(5, 116, 10), np.arange(5, 76, 10))
    seen = heights_below(bed, x[columns] + 1e-4, y[rows] + 1e-4).reshape(columns.shape)
    assert np.abs(seen - expected[rows, columns]).max() < 1e-3  # 0.1 mm aside on a steep face


def test_to_world_and_texture_coordinates():
    to_world = mi.ScalarTransform4f().translate([100, 50, -3]).rotate([0, 0, 1], 90)
    bed = seabed(to_world=to_world, slope_deg=5.0, slope_heading_deg=90.0)  # falls to the east, then to the north
    hits = drop(bed, [100.001], [50 + np.array([-5.0, 0.0, 5.0])])
    assert np.allclose(np.array(hits.p.z), -23 - np.tan(np.deg2rad(5)) * np.array([-5, 0, 5]), atol=2e-4)
    assert np.allclose(np.array(hits.uv), [[1 / 3, 1 / 2, 2 / 3], [0.5] * 3], atol=1e-3)


def test_mirrored_bed_still_looks_up():
    hits = drop(seabed(to_world=mi.ScalarTransform4f().scale([-1, 1, 1])), [0.1], [0.1])
    assert np.allclose(np.array(hits.n).ravel(), [0, 0, 1])


def test_a_point_target_goes_where_to_world_brings_it():
    turned = mi.ScalarTransform4f().translate([1, 2, -3]).rotate([0, 0, 1], 90)
    target = mi.load_dict({"type": "point_target", "position": [4.0, 0.0, -5.0], "to_world": turned})
    np.testing.assert_allclose(target.position, [1, 6, -8], atol=1e-6)
    np.testing.assert_allclose(target.bbox().center(), [1, 6, -8], atol=1e-5)


def test_from_xml_with_id_and_bsdf():
    scene = mi.load_string("""<scene version="3.0.0"><bsdf type="diffuse" id="sand"/>
        <shape type="seabed" id="floor"><float name="depth" value="12"/><integer name="spacing" value="5"/>
        <ref id="sand"/></shape></scene>""", optimize=False)
    (bed,) = scene.shapes()
    assert bed.id() == "floor" and type(bed).__name__ == "Seabed" and bed.bsdf().id() == "sand"
    assert "depth 12.0 m" in str(bed)


@pytest.mark.parametrize("attributes, said", [
    ({"depth": "deep"}, 'depth is the string "deep"; expected a number [m]'),
    ({"lenght": 5.0}, 'unknown attribute "lenght" (did you mean "length"?)'),
    ({"ripple_height": 0.1}, "ripple_height is written without ripple_wavelength"),
    ({"ripple_sharpness": 0.1}, "ripple_sharpness is written without ripple_wavelength and ripple_height"),
    ({"sine_heading_deg": 0.1}, "sine_heading_deg is written without sine_wavelength and sine_height"),
    ({"ripple_wavelength": 0.5, "ripple_height": 0.1},
     "ripple_wavelength is 0.5 m on a grid of 0.25 m; a wave needs 4 nodes: use spacing <= 0.125"),
    ({"ripple_wavelength": 2.0, "ripple_height": 0.1, "ripple_wander": 2.0, "ripple_wander_length": 2.0},
     "seabed: ripples: wander_length is 2.0; it must be at least twice the wander of 2.0 m"),
    ({"fractal_sediment": "mud pie"}, 'no sediment is called "mud pie"; known are'),
    ({"fractal_w2": 1e-4, "fractal_rms": 0.1}, "fractal_w2 and fractal_rms are written; give one of them"),
    ({"fractal_gamma": 3.0}, "fractal_gamma is written; give fractal_sediment, fractal_w2 or fractal_rms with it"),
    ({"fractal_sediment": "sand", "fractal_gamma": 3.0}, "the sediment has its own"),
    ({"spacing": 1e-4}, "nodes at a spacing of 0.0001 m are more than 5e+07; use a coarser spacing"),
    ({"slope_deg": 90.0}, "slope_deg is the float 90.0; expected a number [degrees] at least 0 and below 90"),
    ({"seed": -1}, "seed is the integer -1; expected an integer at least 0"),
])
def test_seabed_refusals(attributes, said):
    from mitsonar.scene.errors import plain
    with pytest.raises(RuntimeError) as caught:
        seabed(**attributes)
    assert said in plain(caught.value)


def test_a_million_nodes_take_about_a_second():
    # Generous: 0.5 s on two idle cores. A Python loop over nodes would take minutes.
    start = time.perf_counter()
    bed = seabed(length=100.0, width=100.0, spacing=0.1, ripple_wavelength=0.8, ripple_height=0.1, ripple_defects=0.05,
                 ripple_wander=0.1, fractal_sediment="medium sand")
    assert bed.vertex_count() == 1001**2
    assert time.perf_counter() - start < 20


@pytest.fixture
def survey(tmp_path):
    """A GeoTIFF, north up, that falls to the east, with a hole and an unmeasured corner node."""
    rasterio = pytest.importorskip("rasterio")
    heights = -30 - 0.1 * np.arange(40.0) - np.arange(30.0)[:, None]
    heights[10:15, 20:26] = heights[0, 0] = 1e6
    path = tmp_path / "survey.tif"
    with rasterio.open(path, "w", driver="GTiff", height=30, width=40, count=1, dtype="float32", nodata=1e6,
                       crs="EPSG:32630", transform=rasterio.transform.from_origin(400000, 6000060, 2, 2)) as raster:
        raster.write(heights.astype(np.float32), 1)
    return str(path)


def surface(x, y):
    """Return the heights of `survey` at local points, about its local origin 400040, 6000030."""
    return -30 - 0.1 * ((x + 40) / 2 - 0.5) - ((30 - y) / 2 - 0.5)


def test_bathymetry_lands_where_it_was_surveyed(survey):
    bed = mi.load_dict({"type": "bathymetry", "filename": survey})
    assert bed.local_origin == (400040.0, 6000030.0) and bed.crs == "EPSG:32630"
    assert bed.bathymetry_bounds == (400001.0, 6000001.0, 400079.0, 6000059.0)
    assert np.array_equal(np.array([bed.bbox().min, bed.bbox().max])[:, :2], [[-39, -29], [39, 29]])
    x, y = np.meshgrid(np.arange(-38, 38, 2) + 0.3, np.arange(-28, 28, 2) + 0.3)
    seen = heights_below(bed, x, y).reshape(x.shape)
    # Cells touching the hole (nodes 20 to 25 of the columns, 10 to 14 of the rows from the north) are open.
    column, row = (x + 39) / 2, (29 - y) / 2
    hole = (column > 19) & (column < 26) & (row > 9) & (row < 15)
    corner = ((column < 20) | (column > 25)) & ((row < 10) | (row > 14))  # one node is missing: one triangle may stay
    assert np.isnan(seen[hole & ~corner]).all()
    assert np.abs(seen - surface(x, y))[~hole].max() < 1e-4
    assert bed.vertex_count() == 40 * 30 - 31  # nodes without depth are left out
    assert np.allclose(bed.survey.height_at(5.0, -9.0), surface(5.0, -9.0), atol=1e-4)


def test_bathymetry_attributes(survey):
    bed = mi.load_dict({"type": "bathymetry", "filename": survey, "crop_frame": "local", "crop": "-20, -20, -5, 0",
                        "resolution": 1.0, "vertical": "elevation", "local_origin": "400000, 6000000",
                        "to_world": mi.ScalarTransform4f().translate([0, 0, 5])})
    assert bed.local_origin == (400000.0, 6000000.0)
    assert np.allclose(heights_below(bed, 30.3, 20.3), surface(30.3 - 40, 20.3 - 30) + 5, atol=1e-4)
    assert "taken as elevation" in str(bed)


@pytest.mark.parametrize("attributes, said", [
    ({"filename": "none.bag"}, 'bathymetry: filename names the file "none.bag", which is not there'),
    ({"filename": __file__}, "this is not a bathymetry grid that GDAL can read"),
    ({"crop": "1, 2, 3"}, 'crop is the string "1, 2, 3"; expected 4 numbers separated by commas'),
    ({"crop": "0, 0, 5, 5"}, "0 x 0 nodes are left in 0, 0, 5, 5; the file covers 400001, 6000001"),
    ({"vertical": "down"}, 'vertical is the string "down"; expected one of "auto", "elevation", "depth"'),
    ({"depth": 5.0}, 'unknown attribute "depth"'),
    ({"crop": "400000, 6000058, 400004, 6000060"}, "1 x 2 nodes are left"),
    ({"crop": "400041, 6000037, 400043, 6000039"}, "the requested part has no depths, only holes"),
    ({"crop": "400000, 6000056, 400003, 6000060", "local_origin": "0, 0"}, "holds no two neighbouring"),
])
def test_bathymetry_refusals(survey, attributes, said):
    from mitsonar.scene.errors import plain
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": "bathymetry", "filename": survey, **attributes})
    assert said in plain(caught.value)
