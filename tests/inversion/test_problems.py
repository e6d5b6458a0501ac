"""Problems of `mitsonar fit` by name: files in, an answer that is drawn and said in sentences, and what is refused."""
import mitsonar  # noqa: F401  isort: skip
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from raw_record import raw_record

from mitsonar.inversion import problems
from mitsonar.io.records import netcdf
from mitsonar.plots.sheets.fit_sheet import fit_figure

WATER = '<medium type="seawater"><string name="profile" value="0:1500"/></medium>'
BED = """<shape type="seabed" id="bed"><float name="depth" value="20"/> <float name="length" value="60"/>
    <float name="width" value="60"/> <float name="spacing" value="5"/>
    <bsdf type="lambert" id="sand"><float name="mu_db" value="-27"/></bsdf></shape>"""
BOX = """<scene version="3.0.0">
    <default name="y" value="9"/> <default name="speckle" value="true"/> <default name="rays" value="15000"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <sensor type="sidescan" id="sonar"> <float name="frequency_khz" value="300"/> <integer name="pings" value="7"/>
        <boolean name="speckle" value="$speckle"/>
        <float name="ping_rate_hz" value="3.2"/> <float name="speed_knots" value="4"/>
        <point name="start" x="-2.5" y="0" z="-10"/> <float name="heading_deg" value="90"/> """ + WATER + """
        <film type="sonar_film"><float name="range" value="25"/> <integer name="bins" value="160"/></film> </sensor>
    """ + BED + """<shape type="cube" id="box"> <transform name="to_world"><scale x="1" y="1.5" z="0.8"/>
    <translate x="0" y="$y" z="-19.2"/></transform> <bsdf type="lambert"><float name="mu_db" value="-10"/></bsdf>
    </shape> </scene>"""
TARGETS = [(3, 15, -15), (-5, 19, -18), (7, 23, -17), (-2, 14, -12)]
ARRAY = """<scene version="3.0.0"> <default name="elements" value=""/>
    <integrator type="sonar_path"><float name="cell" value="2"/></integrator>
    <sensor type="array_sonar" id="sonar"> <float name="frequency_khz" value="100"/>
        <string name="pulse" value="lfm"/> <float name="bandwidth_khz" value="20"/> <float name="pulse_ms" value="1"/>
        <string name="receive" value="file"/> <string name="receive_file" value="$elements"/>
        <integer name="pings" value="5"/> <float name="ping_rate_hz" value="4"/> <float name="speed_knots" value="4"/>
        <point name="start" x="-2" y="0" z="-10"/> <float name="heading_deg" value="80"/> """ + WATER + """
        <film type="sonar_film"><float name="range" value="30"/></film> </sensor>""" + BED + "".join(
    f"""<shape type="point_target" id="target{number}"><point name="position" x="{x}" y="{y}" z="{z}"/>
    <float name="target_strength_db" value="5"/></shape>""" for number, (x, y, z) in enumerate(TARGETS)) + "</scene>"


def solved(what, *inputs, **options):
    answer = problems.solve(what, [str(one) for one in inputs], options, lambda done, total: None)
    fit_figure(answer.dataset)
    answer.dataset.to_netcdf(tmp := Path(str(inputs[0])).with_name("answer.nc"))
    assert tmp.stat().st_size > 0
    assert answer.sentences and answer.dataset.attrs["kind"] == "fit"
    return answer


def written(folder, text):
    path = folder / "scene.xml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_box_is_found_where_it_lies(variant, tmp_path):
    """It is 0.3 m north of where the scene has it, two bins of range; a third of that is asked for."""
    scene = written(tmp_path, BOX)
    mitsonar.write(mitsonar.render(mitsonar.load_file(scene, y=9.3, speckle=False), 7), tmp_path / "seen.exr")
    answer = solved("pose", scene, tmp_path / "seen.exr", "box", "up=0", "pitch=0", "roll=0", "yaw=0", "east=0.1",
                    parameters={"rays": "3000"}, farthest=20.0, looks=4.0)
    pose = answer.dataset["pose"]
    assert float(pose.sel(number="north")) == pytest.approx(0.3, abs=0.1)
    assert np.all(pose.sel(number=["up", "pitch", "roll", "yaw"]) == 0)
    assert sum("north is off by" in sentence for sentence in answer.sentences) == 1


def test_the_pose_of_an_object_is_a_parameter_of_a_scenes_fit(variant, tmp_path):
    """The box is 0.15 m north of where the scene has it, one bin of range; half of that is asked for."""
    scene = written(tmp_path, BOX)
    mitsonar.write(mitsonar.render(mitsonar.load_file(scene, y=9.15, speckle=False), 7), tmp_path / "seen.exr")
    answer = solved(str(scene), tmp_path / "seen.exr", "box.pose=0.1", parameters={"rays": "2000"}, looks=20.0,
                    iterations=3, directions=2, noise=0.0)
    pose, deviation = (answer.dataset[f"box.pose{part}"].values for part in ("", "_deviation"))
    assert pose[1] == pytest.approx(0.15, abs=0.075)
    assert deviation[1] < 0.05


def test_an_array_is_found_from_its_scene_and_its_signals(variant, tmp_path, rng):
    """Elements 2 mm off a coordinate, of a wavelength of 15 mm: shapes to half of that or better, by five pings."""
    turn = np.arange(8) * np.pi / 4
    drawing = np.stack([0.1 * np.cos(3 * turn), 0.25 * np.cos(turn), 0.25 * np.sin(turn)], 1)
    true = drawing + 2e-3 * rng.standard_normal(drawing.shape)
    for name, places in (("true", true), ("drawing", drawing)):
        np.savetxt(tmp_path / f"{name}.csv", places, delimiter=",", header="x,y,z", comments="")
    scene = written(tmp_path, ARRAY)
    signals = mitsonar.element_signals(mitsonar.load_file(scene, elements="true.csv"), range(5))
    for number, axis in enumerate("xyz"):
        signals = signals.assign_coords({f"rx_{axis}": ("rx", drawing[:, number])})
    mitsonar.write(signals, tmp_path / "signals.nc")
    answer = solved("array", scene, tmp_path / "signals.nc", "rx_position=0.002", "rx_delay=0", "position_offset=0",
                    "attitude_offset=0", "velocity_offset=0", "target_position=0",
                    parameters={"elements": "drawing.csv"})
    off = [np.sqrt(np.mean((part - true) ** 2)) for part in (drawing, answer.dataset["rx_position"].values)]
    assert off[1] < 0.5 * off[0] and answer.dataset.attrs["parameters"] == ["rx_position"]
    assert np.all(answer.dataset["rx_position_deviation"] < answer.dataset["rx_position_prior_deviation"])


def test_the_answer_of_a_sway_is_a_trajectory(tmp_path):
    """Of noise nothing is found, which is said; the file holds what `focus --trajectory` takes."""
    raw = raw_record(pings=6, samples=200)
    raw["signal"][0, 0, :2] = 0
    netcdf.write(raw, tmp_path / "raw.nc")
    answer = solved("sway", tmp_path / "raw.nc")
    assert {"motion_time", "motion_x", "motion_heading"} <= set(answer.dataset.variables)
    assert answer.dataset["sway"].dims == ("ping",) and any("not observable" in one for one in answer.sentences)
    netcdf.write(answer.dataset, tmp_path / "sway.nc")
    with xr.open_dataset(tmp_path / "sway.nc") as again:
        assert again["sway"].attrs["units"] == "m"


@pytest.mark.parametrize("what, inputs, words", [
    ("pose", ["scene.xml", "seen.exr"], "takes a scene, a record and the object's id"),
    ("pose", ["scene.xml", "none.exr", "box"], "none.exr"),
    ("array", ["scene.xml"], "takes a scene with point targets and the signals"),
    ("array", ["scene.xml", "s.nc", "rx_positon=1"], "did you mean"),
    ("array", ["scene.xml", "s.nc", "rx_delay=-1"], "has no deviation of 0 or more"),
    ("array", ["scene.xml", "s.nc", "rx_delay=1", "rx_delay=2"], "given twice"),
    ("sway", [], "takes one file of raw echoes"),
    ("sway", ["a.nc", "b.nc"], "takes one file of raw echoes"),
])
def test_what_cannot_be_solved_is_refused_in_a_sentence(tmp_path, monkeypatch, what, inputs, words):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, BOX)
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        problems.solve(what, inputs, {}, lambda done, total: None)


def test_a_scene_without_targets_calibrates_nothing(variant, tmp_path):
    np.savetxt(tmp_path / "e.csv", np.eye(3), delimiter=",", header="x,y,z", comments="")
    scene = written(tmp_path, ARRAY[:ARRAY.index('<shape type="point_target"')] + "</scene>")
    signals = mitsonar.element_signals(mitsonar.load_file(scene, elements="e.csv"))
    mitsonar.write(signals, tmp_path / "signals.nc")
    with pytest.raises(ValueError, match="has no point targets"):
        problems.solve("array", [str(scene), str(tmp_path / "signals.nc")], {"parameters": {"elements": "e.csv"}},
                       lambda done, total: None)
