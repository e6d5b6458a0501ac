"""What the shape `bathymetry` does with a survey beyond meshing it: sediments, holes and relief, as XML asks for them.

`tests/io` has the numbers; here is whether attributes reach them, and whether bsdfs read what is painted.
"""
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scene.errors import plain

rasterio = pytest.importorskip("rasterio")
pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture
def survey(tmp_path):
    """Surveyed at 2 m, 80 x 80 nodes that fall to the east, with a hole; a map of 2 classes, west and east of 80 m."""
    heights = -30 - 0.1 * np.arange(80.0) + np.random.default_rng(0).normal(0, 0.01, (80, 80))
    heights[20:24, 30:34] = 1e6
    place = {"driver": "GTiff", "count": 1, "crs": "EPSG:32630"}
    with rasterio.open(tmp_path / "survey.tif", "w", height=80, width=80, dtype="float32", nodata=1e6, **place,
                       transform=rasterio.transform.from_origin(400000, 6000160, 2, 2)) as raster:
        raster.write(heights.astype(np.float32), 1)
    with rasterio.open(tmp_path / "map.tif", "w", height=2, width=2, dtype="uint8", **place,
                       transform=rasterio.transform.from_origin(400000, 6000160, 80, 80)) as raster:
        raster.write(np.array([[[3, 8], [3, 8]]], np.uint8))
    return tmp_path


def load(folder, extra=""):
    return mi.load_string(f"""<scene version="3.0.0"><shape type="bathymetry" id="bed">
        <string name="filename" value="{folder / 'survey.tif'}"/>
        <string name="local_origin" value="400000, 6000000"/>{extra}</shape></scene>""", optimize=False)


def painted(folder, classes="3: clay, 8: sandy gravel", more=""):
    return load(folder, f"""<string name="sediment_map" value="{folder / 'map.tif'}"/>
        <string name="sediment_classes" value="{classes}"/>{more}""")


def drop(scene, x, y):
    x, y = np.broadcast_arrays(np.asarray(x, np.float32), np.asarray(y, np.float32))
    return scene.ray_intersect(mi.Ray3f(mi.Point3f(mi.Float(x), mi.Float(y), 100), mi.Vector3f(0, 0, -1)))


def strength(scene, x):
    si = drop(scene, x, np.full(len(x), 30.3))
    wi = mi.Vector3f(0.6, 0, 0.8)
    bsdf = scene.shapes()[0].bsdf()
    return np.array(bsdf.scattering_strength(si, wi, wi, mi.Float(50e3), mi.Float(1500.0)))


def strength_along(scene, x, y):
    si = drop(scene, x, y)
    wi = mi.Vector3f(0.6, 0, 0.8)
    return np.array(scene.shapes()[0].bsdf().scattering_strength(si, wi, wi, mi.Float(50e3), mi.Float(1500.0)))


def strength_of(sediment):
    bsdf = mi.load_dict({"type": "sediment", "sediment": sediment})
    wi = mi.Vector3f(0.6, 0, 0.8)
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    return np.array(bsdf.scattering_strength(si, wi, wi, mi.Float(50e3), mi.Float(1500.0)))[0]


def test_painted_bed_has_its_sediments_without_a_bsdf(survey):
    scene = painted(survey, more='<float name="sediment_border" value="0"/>')
    (bed,) = scene.shapes()
    assert bed.sediments == ["clay", "sandy gravel"] and bed.seabed
    x = np.array([10.3, 50.3, 77.3, 83.3, 120.3])
    wanted = np.where(x < 80, strength_of("clay"), strength_of("sandy gravel"))
    assert np.allclose(strength(scene, x), wanted, rtol=1e-4)
    assert strength_of("sandy gravel") > 2 * strength_of("clay")


def test_sediments_go_over_into_each_other_across_a_border(survey):
    """Six cells of 2 m about the first that the map calls gravel, [79, 81]: two means over three cells each."""
    scene = painted(survey, more='<float name="sediment_border" value="12"/>')
    clay, gravel = strength_of("clay"), strength_of("sandy gravel")
    aside, north = np.arange(2000) * 0.05 % 1.9 + 0.05, 10.02 + 0.05 * np.arange(2000)

    def share_of_gravel(west):
        return (strength_along(scene, west + aside, north) - clay) / (gravel - clay)

    found = np.array([share_of_gravel(west) for west in (73, 75, 77, 79, 81, 83)])
    assert set(np.unique(np.abs(np.round(found, 3)))) == {0, 1}                 # patches of one or the other
    share = found.mean(1)
    assert share[0] == pytest.approx(0, abs=1e-4) and share[5] == pytest.approx(1, abs=1e-4)
    np.testing.assert_allclose(share[1:5], np.array([1, 3, 6, 8]) / 9, atol=0.04)
    assert np.array_equal(share_of_gravel(77), found[2])


def test_faces_about_holes_keep_their_classes(survey):
    scene = painted(survey)
    x, y = np.meshgrid(np.arange(3.3, 157, 7.1), np.arange(3.7, 157, 6.3))
    si = drop(scene, x.ravel(), y.ravel())
    number = np.array(scene.shapes()[0].eval_attribute_1("face_sediment_class", si, si.is_valid()))
    hit = np.array(si.is_valid())
    assert hit.sum() > 400 and np.array_equal(number[hit], (x.ravel()[hit] > 80).astype(float))


def test_a_bsdf_of_its_own_reads_the_classes(survey):
    scene = painted(survey, more="""<bsdf type="sediment"><string name="classes" value="silt, medium sand"/>
        <texture name="sediment_class" type="mesh_attribute"><string name="name" value="face_sediment_class"/></texture>
        </bsdf>""")
    assert np.allclose(strength(scene, np.array([10.3, 120.3])), [strength_of("silt"), strength_of("medium sand")],
                       rtol=1e-4)


def test_table_from_a_file_and_a_bed_without_map(survey):
    (survey / "table.csv").write_text("code,sediment\n3,clay\n8,silt\n")
    assert painted(survey, survey / "table.csv").shapes()[0].sediments == ["clay", "silt"]
    assert load(survey).shapes()[0].sediments == []
    assert load(survey, '<string name="sediment_map" value=""/><string name="sediment_classes" value=""/>').shapes()


def test_holes_and_relief_through_xml(survey):
    assert not np.array(drop(load(survey), [63.3], [115.3]).is_valid())[0]
    filled = load(survey, '<string name="holes" value="filled"/><float name="holes_max" value="20"/>')
    assert np.array(drop(filled, [63.3], [115.3]).is_valid())[0]
    relief = '<boolean name="relief" value="true"/><float name="resolution" value="0.5"/>{}'
    rough = load(survey, relief.format("")).shapes()[0]
    given = load(survey, relief.format('<float name="relief_w2" value="1e-5"/><float name="relief_gamma" value="3"/>'
                                       '<integer name="relief_seed" value="3"/>')).shapes()[0]
    assert rough.survey.spacing == (0.5, 0.5) and rough.survey.roughness is not None
    assert (given.survey.roughness.w2, given.survey.roughness.gamma) == (1e-5, 3.0)
    assert not np.allclose(given.survey.heights, rough.survey.heights, equal_nan=True)


@pytest.mark.parametrize("extra, said", [
    ('<string name="sediment_map" value="map.none"/>', "which is not there"),
    ('<string name="sediment_map" value="{map}"/>', "a map needs sediment_map and sediment_classes"),
    ('<string name="sediment_classes" value="1: clay"/>', "a map needs sediment_map and sediment_classes"),
    ('<float name="sediment_border" value="3"/>', "sediment_border is written alone"),
    ('<string name="sediment_map" value="{map}"/><string name="sediment_classes" value="3: clay"/>',
     "the map has the code 8 on 5"),
    ('<string name="sediment_map" value="{map}"/><string name="sediment_classes" value="clay"/>',
     'sediment_classes names the file "clay", which is not there'),
    ('<string name="sediment_map" value="{map}"/><string name="sediment_classes" value="3: tar"/>',
     'no sediment is called "tar"'),
    ('<boolean name="relief" value="true"/>', "relief needs a resolution finer than the survey's 2 m"),
    ('<float name="relief_gamma" value="3"/>', "relief_gamma is written without relief; write relief true"),
    ('<boolean name="relief" value="false"/><integer name="relief_seed" value="3"/>',
     "relief_seed is written without relief; write relief true"),
    ('<boolean name="relief" value="true"/><float name="relief_w2" value="1"/>', "relief_w2 is given without"),
    ('<float name="holes_max" value="3"/>', 'holes_max is 3 m, but holes are cut; write holes "filled" too'),
    ('<string name="holes" value="bridged"/>', 'expected one of "cut", "filled"'),
    ('<string name="variable" value="z"/>', "only netCDF files hold variables"),
])
def test_refusals(survey, extra, said):
    with pytest.raises(RuntimeError) as caught:
        load(survey, extra.format(map=survey / "map.tif"))
    assert said in plain(caught.value)


@pytest.mark.parametrize("name, parameters", [("bed.npy", {"spacing": "0.5"}), ("bed.xyz", {"crs": "EPSG:4326"})])
def test_the_scene_of_surveys_takes_what_a_file_leaves_unsaid(tmp_path, name, parameters):
    lon, lat = (part.ravel() for part in np.meshgrid(-122.38 + np.arange(60) * 5e-6, 37.75 + np.arange(60) * 4e-6))
    np.save(tmp_path / "bed.npy", np.full((60, 60), -20.0))
    np.savetxt(tmp_path / "bed.xyz", np.c_[lon, lat, np.full(3600, -20.0)], fmt="%.7f")
    scene = str(Path(__file__).parents[2] / "scenes" / "sidescan_survey.xml")
    with pytest.raises(RuntimeError, match="spacing of its nodes|no coordinate system is named"):
        mi.load_file(scene, bathymetry=str(tmp_path / name), optimize=False)
    bed = mi.load_file(scene, bathymetry=str(tmp_path / name), optimize=False, **parameters).shapes()[0]
    assert 20 < bed.bbox().extents()[0] < 31 and bed.bbox().max.z == -20
