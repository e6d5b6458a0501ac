"""Areas of plans: corners in a line, GeoJSON of every shape, and what is neither."""
import json

import numpy as np
import pytest

from mitsonar.io.tracks.navigation import Frame
from mitsonar.planning import areas

SQUARE = [[5.0, 52.0], [5.01, 52.0], [5.01, 52.01], [5.0, 52.01], [5.0, 52.0]]
HOLE = [[5.004, 52.004], [5.006, 52.004], [5.006, 52.006], [5.004, 52.004]]
UTM = Frame(crs="EPSG:32631", origin=(637000.0, 5763000.0))


def written(folder, content):
    path = folder / "area.geojson"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def polygon(*rings):
    return {"type": "Polygon", "coordinates": list(rings)}


def feature(geometry):
    return {"type": "Feature", "properties": None, "geometry": geometry}


def test_corners_in_metres_are_those_of_the_bathymetry():
    found = areas.read("637100 5763100, 637900 5763100; 637900 5763800")
    assert found.crs == "" and found.bounds == (637100, 5763100, 637900, 5763800)
    np.testing.assert_array_equal(found.placed(UTM)[0], [[100, 100], [900, 100], [900, 800]])


def test_corners_in_degrees_are_where_geojson_has_them(tmp_path):
    text = areas.read("52.0N 5.0E, 52.0N 5.01E, 52.01N 5.01E, 52.01N 5.0E")
    file = areas.read(written(tmp_path, polygon(SQUARE)))
    np.testing.assert_allclose(file.placed(UTM)[0][:4], text.placed(UTM)[0], atol=1e-6)


def test_places_and_degrees_lead_to_each_other(tmp_path):
    found = areas.read(written(tmp_path, polygon(SQUARE)))
    latitude, longitude, _ = UTM.on_globe(found.placed(UTM)[0])
    np.testing.assert_allclose(np.stack([longitude, latitude], -1), SQUARE, rtol=0, atol=1e-9)     # 0.1 mm


@pytest.mark.parametrize("content, rings", [
    (polygon(SQUARE, HOLE), 2),
    (feature(polygon(SQUARE)), 1),
    ({"type": "MultiPolygon", "coordinates": [[SQUARE, HOLE], [HOLE]]}, 3),
    ({"type": "FeatureCollection", "features": [feature(None), feature(polygon(SQUARE)), feature(
        {"type": "Point", "coordinates": [0, 0]}), feature({"type": "GeometryCollection", "geometries": [
            polygon(HOLE)]})]}, 2)])
def test_all_polygons_of_a_file_are_of_the_area(tmp_path, content, rings):
    assert len(areas.read(written(tmp_path, content)).rings) == rings


def test_a_coordinate_system_of_before_the_standard_is_taken(tmp_path):
    content = polygon([[637100, 5763100], [637900, 5763100], [637900, 5763800]])
    for name in ("urn:ogc:def:crs:EPSG::32631", "EPSG:32631"):
        found = areas.read(written(tmp_path, content | {"crs": {"type": "name", "properties": {"name": name}}}))
        np.testing.assert_allclose(found.placed(UTM)[0][0], [100, 100], atol=1e-6)
    content = polygon(SQUARE) | {"crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}}
    assert areas.read(written(tmp_path, content)).utm() == "EPSG:32631"


def test_degrees_have_no_place_over_plain_metres(tmp_path):
    with pytest.raises(ValueError, match="names no coordinate system"):
        areas.read(written(tmp_path, polygon(SQUARE))).placed(Frame(crs=""))


HUGE = "9" * 5000
BAD = {
    "no JSON": ("{", "it is no GeoJSON"),
    "nested without end": ('{"type": ' + "[" * 500_000, "it is no GeoJSON"),
    "nested objects": ('{"type":"Feature","geometry":' * 50_000, "it is no GeoJSON"),
    "collections in collections": ('{"type":"GeometryCollection","geometries":[' * 300 + "]}" * 300, "no polygon"),
    "a list": ([1, 2], "holds no polygon"),
    "a line": ({"type": "LineString", "coordinates": SQUARE}, "holds no polygon"),
    "nothing": ({"type": "FeatureCollection", "features": []}, "holds no polygon"),
    "coordinates that are none": ({"type": "Polygon", "coordinates": 5}, "not lists of finite corners"),
    "polygons that are none": ({"type": "MultiPolygon", "coordinates": {"a": 1}}, "not lists of finite corners"),
    "rings of words": (polygon([["a", "b"]] * 4), "not lists of finite corners"),
    "rings of one number": (polygon([[1.0]] * 4), "not lists of finite corners"),
    "no ring at all": (polygon(5), "not lists of finite corners"),
    "NaN": ('{"type":"Polygon","coordinates":[[[NaN,1],[2,3],[4,5]]]}', "not lists of finite corners"),
    "numbers beyond measure": (
        f'{{"type":"Polygon","coordinates":[[[1e999,1],[2,3],[{HUGE}.5,5]]]}}', "not lists of finite corners"),
    "digits without end": (f'{{"type":"Polygon","coordinates":[[[{HUGE},1],[2,3],[4,5]]]}}', "it is no GeoJSON"),
    "an empty ring": (polygon([]), "holds no polygon with corners"),
    "too many corners": (polygon([[0.5, 0.5]] * 200_001), "more than 200000 corners"),
    "a system without a name": (polygon(SQUARE) | {"crs": {"type": "link"}}, "crs has no name"),
    "a system that is a file": (polygon(SQUARE) | {"crs": {"properties": {"name": "/etc/passwd"}}}, "no coordinate"),
}


@pytest.mark.parametrize("content, words", BAD.values(), ids=BAD)
def test_what_is_no_area_is_refused(tmp_path, content, words):
    with pytest.raises(ValueError, match=words) as refused:
        areas.read(written(tmp_path, content))
    assert len(str(refused.value)) < 600


def test_a_file_beyond_measure_is_not_read(tmp_path):
    with open(tmp_path / "area.geojson", "wb") as file:
        file.truncate(50_000_000_000)
    with pytest.raises(ValueError, match="it has 50000 MB, more than 10; simplify"):
        areas.read(tmp_path / "area.geojson")


@pytest.mark.parametrize("text, error, words", [
    ("0 0, 5 x, 3 3", ValueError, 'corner 2 is "5 x"'), ("0 0, 52.0N 5.0E", ValueError, "not written alike"),
    ("no.geojson", FileNotFoundError, "there is no such file"), (".", ValueError, "it is a folder"),
    ("/dev/zero", ValueError, "a device or a pipe")])
def test_words_that_are_no_area_are_refused(text, error, words):
    with pytest.raises(error, match=words):
        areas.read(text)
