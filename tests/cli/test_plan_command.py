"""The command that plans a survey: what it prints, what it writes, and what it refuses."""
import json
from pathlib import Path

import numpy as np
import pytest

from mitsonar.cli.main import main
from mitsonar.io.tracks import tracks

ROOT = Path(__file__).resolve().parents[2]
SANDWAVES, SUMMER = ROOT / "scenes/bathymetry/sandwaves.tif", ROOT / "scenes/casts/summer.csv"
SURVEY = ROOT / "../shared/data/bathymetry/JD211_public_Release_1-4_UTM.bag"
LEVEL = ["plan", "--depth", "30", "--area", "0 0, 600 0, 600 400, 0 400"]


def planned(capsys, *arguments):
    capsys.readouterr()
    assert main([str(one) for one in arguments]) == 0
    return capsys.readouterr()


def test_everything_of_a_plan_is_written(folder, capsys):
    found = planned(capsys, "plan", SANDWAVES, "--cast", SUMMER, "--sonar", "shallow_400khz", "-o", "a.csv", "-o",
                    "a.geojson", "-o", "a.gpx", "--picture", "a.png", "--json", "a.json", "--cast-error", 2,
                    "--order", "special", "--turn-radius", 20)
    for words in ("256 beams over 130 degrees", "along the contours", "coverage  100 %", "S-44 order special"):
        assert words in found.out
    assert found.out.splitlines()[-5:] == ["a.csv", "a.geojson", "a.gpx", "a.json", "a.png"] and not found.err
    numbers = json.loads((folder / "a.json").read_text())
    assert len(numbers["lines"]) == len({line["line"] for line in numbers["lines"]}) == 4
    assert len(tracks.load(folder / "a.csv").x) == 12                                     # run-in, start and end
    assert numbers["area"]["crs"] == "EPSG:32631" and numbers["gaps"]["number"] == 0
    assert 3 < numbers["lines"][0]["start"]["longitude"] < 4
    assert min(opened(folder / "a.png").size) > 800


def test_lines_too_far_apart_are_red_on_the_map(folder, capsys):
    reds = []
    for spacing in (90, 250):
        planned(capsys, *LEVEL, "--spacing", spacing, "--picture", "a.png")
        picture = np.asarray(opened(folder / "a.png")).astype(int)
        reds.append(np.count_nonzero((picture[..., 0] > 200) & (picture[..., 1:3] < 40).all(-1)))
    assert reds[0] == 0 and reds[1] > 10_000


def opened(path):
    from PIL import Image

    return Image.open(path).convert("RGB")


def test_a_level_bed_in_degrees_lies_in_its_utm_zone(folder, capsys):
    planned(capsys, "plan", "--depth", 30, "--area", "52.0N 5.0E, 52.0N 5.01E, 52.005N 5.01E, 52.005N 5.0E", "--json",
            "a.json", "-o", "a.gpx")
    numbers = json.loads((folder / "a.json").read_text())
    assert numbers["area"]["crs"] == "EPSG:32631"
    assert all(52 <= line["start"]["latitude"] <= 52.005 for line in numbers["lines"])


def test_a_preset_gives_its_swath_and_what_is_said_goes_before_it(folder, capsys):
    preset = planned(capsys, *LEVEL, "--sonar", "shelf_80khz").out
    assert "shelf_80khz: 400 beams over 130 degrees, even in distance" in preset
    said = planned(capsys, *LEVEL, "--sonar", "shelf_80khz", "--swath", 90, "--beam-spacing", "angle", "--head-depth",
                   4)
    assert "400 beams over 90 degrees, even in angle, head at 4 m" in said.out and "52/52 m" in said.out


def test_a_scene_gives_its_sonar_its_window_and_its_cast(folder, capsys):
    (folder / "cast.csv").write_text("depth,speed\n0,1500\n20,1490\n")
    (folder / "line.xml").write_text("""<scene version="3.0.0"><default name="swath" value="120"/>
        <sensor type="multibeam"><string name="preset" value="shallow_350khz"/><float name="swath_deg" value="$swath"/>
        <point name="start" x="0" y="0" z="-2"/><medium type="seawater"><string name="cast" value="cast.csv"/></medium>
        <film type="sonar_film"><float name="range" value="40"/></film></sensor></scene>""")
    found = planned(capsys, *LEVEL, "--sonar", "line.xml", "--json", "a.json")
    sonar = json.loads((folder / "a.json").read_text())["sonar"]
    assert sonar == {"name": "shallow_350khz", "swath_deg": 120, "beams": 512, "even": "distance", "rate_hz": None,
                     "head_depth_m": 2, "max_range_m": 40}
    assert "the cast ends at 20 m and the bed lies down to 30 m; sound speed is taken as constant below" in found.err


def test_a_scene_of_the_lines_sails_them_over_the_bed(folder, capsys):
    import mitsonar

    planned(capsys, "plan", SANDWAVES, "--swath", 70, "--beams", 16, "--head-depth", 2, "--scene", "lines.xml", "-o",
            "a.csv", "--run-in", 0)
    scene = mitsonar.load_file("lines.xml", pings=1, rays=1000)
    with pytest.warns(UserWarning, match="the course is cut by pings, 1"):
        image = mitsonar.render(scene)
    lines = tracks.load(folder / "a.csv")
    begin = np.array([image.x[0], image.y[0]]) + image.attrs["local_origin"]
    assert np.hypot(lines.x - begin[0], lines.y - begin[1]).min() < 20             # less what lies beside the bed
    assert float(image.z[0]) == -2 and image.sizes["beam"] == 16 and image.attrs["course_planned"] > 450


def test_a_scene_of_a_level_bed_has_its_depth(folder, capsys):
    planned(capsys, *LEVEL, "--scene", "lines.xml", "--head-depth", 1, "--speed", 7, "--rate", 3)
    text = (folder / "lines.xml").read_text()
    for words in ('type="seabed"', '"depth" value="30.000"', '"speed_knots" value="7.0"', '"ping_rate_hz" value="3.0"'):
        assert words in text


def test_a_sweep_has_every_line_of_the_scene_and_a_line_sails_from_its_start_to_its_end(folder, capsys):
    import mitsonar
    from mitsonar.sweep import load_plan
    from mitsonar.verbs.images import opened

    planned(capsys, *LEVEL, "--scene", "lines.xml", "--sweep", "lines.toml", "-o", "a.csv", "--swath", 60, "--rate", 2)
    sweep = load_plan("lines.toml")
    lines = [sweep.render(index).parameters["line"] for index in range(len(sweep))]
    assert lines == list(range(1, len(lines) + 1)) and len(lines) > 2
    assert sweep.render(1).output == "line_0002.nc" and sweep.soundings == {}
    _, sonar, _ = opened(mitsonar.load_file("lines.xml", line=2))
    ends = tracks.load(folder / "a.csv", 2)
    assert len(ends.x) == 2                            # without the run-in
    shift = np.array([sonar.route.record.x - ends.x, sonar.route.record.y - ends.y])
    assert np.ptp(shift, axis=1).max() < 0.002         # the scene's frame is the middle of the area
    with pytest.raises(ValueError, match=f"the way points are those of {len(lines)} lines"):
        mitsonar.load_file("lines.xml", line=len(lines) + 1)


def test_cross_lines_are_of_their_own_kind_in_all_files_and_a_fast_ship_is_warned(folder, capsys):
    found = planned(capsys, *LEVEL, "--crs", "EPSG:32632", "--cross", 2, "-o", "a.csv", "-o", "a.geojson", "-o",
                    "a.gpx", "--json", "a.json", "--beam-width", 0.5, "--rate", 2, "--speed", 10, "--order", "special")
    rows = [row.split(",") for row in (folder / "a.csv").read_text().splitlines()]
    kinds = {row[0]: row[-1] for row in rows[1:]}
    numbers = json.loads((folder / "a.json").read_text())
    assert rows[0][-1] == "kind" and {line["kind"] for line in numbers["lines"]} == {"main", "cross"}
    assert kinds == {str(line["line"]): line["kind"] for line in numbers["lines"]}
    features = json.loads((folder / "a.geojson").read_text())["features"]
    assert [one["properties"]["kind"] for one in features] == list(kinds.values())
    assert (folder / "a.gpx").read_text().count("cross line") == numbers["cross_lines"]["number"] > 0
    assert "pings leave gaps along the track straight below; sail at" in found.err
    assert "fewer than 3 pings meet a feature of 1 m, the least that order special asks for" in found.err


def test_doubts_are_said(folder, capsys):
    places = [(x, y) for x in range(0, 401, 10) for y in range(0, 301, 10) if not (200 < x < 300 and 100 < y < 200)]
    (folder / "slope.txt").write_text("".join(f"{x} {y} {-x / 10}\n" for x, y in places))
    found = planned(capsys, "plan", "slope.txt", "--vertical", "elevation", "--area", "-0 0, 390 0, 390 290, 0 290",
                    "--max-range", 100, "--least-depth", 5)
    assert "% of the area has no depth; it is not counted in the coverage" in found.err
    assert "% of the area is shoaler than 5 m, and is left out" in found.err


def test_another_cast_is_compared_with_the_true_one(folder, capsys):
    (folder / "old.csv").write_text("depth,speed\n0,1513\n40,1513\n")
    found = planned(capsys, *LEVEL, "--cast", SUMMER, "--other-cast", "old.csv", "--json", "a.json", "--order", "1a")
    one = json.loads((folder / "a.json").read_text())["refraction"][0]
    assert one["outer_beam_error_m"] < -0.3 and one["by_angle"][0][0] == 0
    assert f"outermost beams {one['outer_beam_error_m']:+.2f} m" in found.out
    assert 30 < one["within_order_to_deg"] < 65 or abs(one["outer_beam_error_m"]) < one["allowed_m"]


@pytest.mark.skipif(not SURVEY.exists(), reason=f"no {SURVEY.name} beside the checkout")
def test_a_real_survey_is_planned_over_its_own_bed(folder, capsys):
    planned(capsys, "plan", SURVEY, "--resolution", 6, "--json", "a.json")
    numbers = json.loads((folder / "a.json").read_text())
    assert numbers["coverage_percent"]["once"] > 99.9 and numbers["area"]["size_m2"] == pytest.approx(4.6e6, rel=0.02)
    assert len(numbers["lines"]) < 14 and numbers["lines"][0]["start"]["longitude"] < -168


COMMANDS = {
    "no bed": (["plan"], "a plan needs a bed"), "two beds": (["plan", SANDWAVES, "--depth", "30"], "and not both"),
    "level bed without an area": (["plan", "--depth", "30"], "give --area too"),
    "bed of no depth": (["plan", "--depth", "nan", "--area", "0 0, 9 0, 9 9"], "--depth is nan m"),
    "resolution of a level bed": ([*LEVEL, "--resolution", "2"], "leave them out with --depth"),
    "no such bathymetry": (["plan", "no.tif"], "no.tif"),
    "bathymetry that is none": (["plan", "scene.xml"], "scene.xml"),
    "bathymetry of land": (["plan", "hill.asc", "--vertical", "elevation"], "no node of the bathymetry lies below"),
    "empty area": (["plan", SANDWAVES, "--area", ""], "cannot read the area"),
    "area of two corners": (["plan", SANDWAVES, "--area", "0 0, 1 1"], "ring of 2 corners"),
    "area elsewhere": (["plan", SANDWAVES, "--area", "0 0, 9 0, 9 9"], "where the bathymetry has no depth"),
    "area that crosses itself": (["plan", SANDWAVES, "--area", "512000 5790000, 512300 5790300, 512300 5790000, 512000 "
                                                               "5790300"], "crosses itself near x = "),
    "area between nodes": (["plan", SANDWAVES, "--area", "512100.1 5790100.1, 512100.3 5790100.1, 512100.3 5790100.3"],
                           "no node of the bathymetry (2 m apart) lies in it"),
    "whole overlap": ([*LEVEL, "--overlap", "100"], "the overlap is 100 %; give 0 to below 100"),
    "overlap and spacing": ([*LEVEL, "--overlap", "10", "--spacing", "9"], "leave one out"),
    "heading of a word": ([*LEVEL, "--heading", "north"], "--heading is 'north'"),
    "heading without end": ([*LEVEL, "--heading", "inf"], "the heading is not a finite number"),
    "spacing of nothing": ([*LEVEL, "--spacing", "0"], "must be above 0"),
    "swath of all": ([*LEVEL, "--swath", "180"], "more than 0 and less than 180"),
    "head below the bed": ([*LEVEL, "--head-depth", "31"], "nowhere deeper than 30 m, and bed shoaler than 32 m"),
    "head on the bed": ([*LEVEL, "--head-depth", "31", "--least-depth", "1"], "the head must be in the water"),
    "sonar that is none": ([*LEVEL, "--sonar", "shallow_40khz"], "no preset 'shallow_40khz' of multibeam (did"),
    "scene without one": ([*LEVEL, "--sonar", "scene.xml"], "has no sensor of type multibeam"),
    "cast that is none": ([*LEVEL, "--cast", "scene.xml"], "none of the formats known"),
    "error without a number": ([*LEVEL, "--cast-error", "nan"], "sound_speed[0] is nan"),
    "error without end": ([*LEVEL, "--cast-error", "inf"], "--cast-error is inf m/s"),
    "area of a point": (["plan", "--depth", "30", "--area", "0 0"], "the area has no extent"),
    "area of one corner thrice": (["plan", "--depth", "30", "--area", "0 0, 0 0, 0 0"], "the area has no extent"),
    "bed heard from nowhere": ([*LEVEL, "--max-range", "1e-30"], "apart give 1000000000 lines in the area"),
    "cells beyond number": (["plan", SANDWAVES, "--resolution", "1e-9"], "give a larger resolution"),
    "error beyond water": ([*LEVEL, "--cast-error", "9999"], "outside 300..3000 m/s"),
    "layer without an error": ([*LEVEL, "--layer", "5"], "--layer is the thickness of the layer of --cast-error"),
    "two errors": ([*LEVEL, "--cast-error", "1", "--other-cast", SUMMER], "leave one out"),
    "no order": ([*LEVEL, "--order", "3"], "S-44 has no order '3'"),
    "lines of no format": ([*LEVEL, "-o", "a.kml"], "must end in .csv, .geojson or .gpx"),
    "picture of no format": ([*LEVEL, "--picture", "a.bmp"], "must end in .png, .pdf or .svg"),
    "lines on Earth without a place": ([*LEVEL, "-o", "a.csv", "-o", "a.gpx"], "names no coordinate system"),
    "output twice": ([*LEVEL, "-o", "a.csv", "-o", "./a.csv"], "is the name of two outputs"),
    "scene of no format": ([*LEVEL, "--scene", "a.json"], "its name must end in .xml"),
    "sweep of no scene": ([*LEVEL, "--sweep", "a.toml"], "give --scene OUT.xml too"),
    "sweep of no format": ([*LEVEL, "--scene", "a.xml", "--sweep", "a.csv"], "its name must end in .toml"),
    "no folder": ([*LEVEL, "--json", "no/a.json"], "make it first"),
    "crs that is none": ([*LEVEL, "--crs", "EPSG:1"], "is no coordinate system; write an EPSG code"),
    "crs of a file": ([*LEVEL, "--crs", "scene.xml"], "is no coordinate system; write an EPSG code"),
    "crs in degrees": ([*LEVEL, "--crs", "EPSG:4326"], "metres"),
}


@pytest.mark.parametrize("arguments, words", COMMANDS.values(), ids=COMMANDS)
def test_what_cannot_be_planned_is_refused(refusal, folder, arguments, words):
    (folder / "hill.asc").write_text("ncols 2\nnrows 2\nxllcorner 1000\nyllcorner 1000\ncellsize 9\n5 6\n7 8\n")
    assert words in refusal(*arguments)
