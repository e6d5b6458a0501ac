"""Lines of a plan in files: what other readers find in them is where the lines are, to a tenth of a millimetre."""
import json
from xml.etree import ElementTree

import numpy as np
import pytest

from mitsonar.io.tracks import tracks
from mitsonar.io.tracks.navigation import Frame
from mitsonar.planning import line_files as planned_lines, summary as plan_summary
from mitsonar.planning.bed import flat_bed
from mitsonar.planning.coverage import SwathSonar
from mitsonar.planning.plan import Layout, plan
from mitsonar.sonar.motion.waypoints import Course
from mitsonar.water import SoundSpeedProfile

UTM = Frame(crs="EPSG:32631", origin=(637000.0, 5763000.0))


@pytest.fixture(scope="module")
def lines():
    return plan(flat_bed(30.0, 0, 0, 500, 400), SoundSpeedProfile.constant(1500.0), SwathSonar(swath=2.0),
                Layout(run_in=40.0, turn_radius=15.0), used=SoundSpeedProfile([0, 0.01], [1502, 1502]))


def places(plan):
    return np.array([place for line in plan.lines for place in (line.run_in, line.start, line.end)])


def test_csv_is_read_as_way_points_that_can_be_sailed(lines, tmp_path):
    planned_lines.write(lines, tmp_path / "a.csv", UTM)
    found = tracks.load(tmp_path / "a.csv")
    assert isinstance(found, tracks.Waypoints) and not found.geographic and found.z is None
    np.testing.assert_allclose(found.placed(UTM), places(lines), atol=6e-4)             # written to the millimetre
    assert Course(found.placed(UTM)).length > sum(line.length for line in lines.lines)


def test_latitudes_of_the_csv_are_those_of_the_places(lines, tmp_path):
    planned_lines.write(lines, tmp_path / "a.csv", UTM)
    text = (tmp_path / "a.csv").read_text().replace("x,y", "easting,northing")
    (tmp_path / "b.csv").write_text(text)
    found = tracks.load(tmp_path / "b.csv")
    assert found.geographic
    np.testing.assert_allclose(found.placed(UTM), places(lines), atol=2e-4)


def test_without_a_coordinate_system_only_metres_are_written(lines, tmp_path):
    planned_lines.write(lines, tmp_path / "a.csv", Frame(crs="", origin=(10.0, 20.0)))
    np.testing.assert_allclose(tracks.load(tmp_path / "a.csv").placed(), places(lines) + (10, 20), atol=6e-4)
    for name in ("a.geojson", "a.gpx"):
        with pytest.raises(ValueError, match="takes latitudes and longitudes"):
            planned_lines.write(lines, tmp_path / name, Frame(crs=""))
        assert not (tmp_path / name).exists()


def test_geojson_has_a_line_string_for_every_line(lines, tmp_path):
    planned_lines.write(lines, tmp_path / "a.geojson", UTM)
    features = json.loads((tmp_path / "a.geojson").read_text())["features"]
    assert [one["properties"]["line"] for one in features] == [line.number for line in lines.lines]
    degrees = np.array([one["geometry"]["coordinates"] for one in features]).reshape(-1, 2)
    found, _ = UTM.project(degrees[:, 1], degrees[:, 0])
    np.testing.assert_allclose(found, [place for line in lines.lines for place in (line.start, line.end)], atol=2e-4)


def test_gpx_has_a_route_for_every_line(lines, tmp_path):
    planned_lines.write(lines, tmp_path / "a.gpx", UTM)
    space = {"g": "http://www.topografix.com/GPX/1/1"}
    routes = ElementTree.parse(tmp_path / "a.gpx").getroot().findall("g:rte", space)
    assert [route.findtext("g:name", namespaces=space) for route in routes] == [f"line {k + 1}" for k in
                                                                                range(len(lines.lines))]
    points = [point for route in routes for point in route.findall("g:rtept", space)]
    found, _ = UTM.project(*(np.array([float(point.get(axis)) for point in points]) for axis in ("lat", "lon")))
    np.testing.assert_allclose(found, places(lines), atol=2e-4)


def test_numbers_add_up(lines):
    found = plan_summary.summary(lines, UTM)
    length = found["length_m"]
    assert length["all"] == pytest.approx(length["lines"] + length["run_ins"] + length["turns"])
    assert found["time_s"]["all"] == pytest.approx(length["all"] / lines.layout.speed)
    assert found["soundings"] == 256 * found["pings"] == 256 * sum(line["pings"] for line in found["lines"])
    assert found["refraction"][0]["nadir_error_m"] == pytest.approx(30 * 2 / 1500, rel=1e-3)     # right at the head
    json.dumps(found, allow_nan=False)


def test_a_name_that_says_no_format_is_refused(lines, tmp_path):
    with pytest.raises(ValueError, match="must end in .csv, .geojson or .gpx"):
        planned_lines.write(lines, tmp_path / "a.kml", UTM)
