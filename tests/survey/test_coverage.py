"""A window of range that does not fit the bed: a warning before anything is rendered, and none where it fits."""
import warnings

import pytest
from small_scene import spoilt

import mitsonar
from mitsonar.cli.main import main
from mitsonar.io.scene_files.scenes import shipped

SENSORS = '<sensor type="sidescan" id="sonar">', '        <boolean name="speckle" value="$speckle"/>\n'
COARSE = {"sidescan_wreck": {"bed_spacing": 0.5, "ripple_wavelength": 2.4, "stone_scour": 0}}  # of 2.6 million faces
NARROW = ('<float name="width" value="200"/>\n        <float name="spacing" value="20"/>',
          '<float name="width" value="60"/> <float name="spacing" value="10"/>')


def said(scene):
    """Return the warnings of planning a scene's sensors."""
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        for sensor in scene.sensors():
            scene.integrator().survey(scene, sensor)
    return [str(one.message) for one in seen if "the range of" in str(one.message)]


def scene_of(tmp_path, *edits, **parameters):
    path = tmp_path / "scene.xml"
    path.write_text(spoilt(*edits))
    return mitsonar.load_file(path, **parameters)


@pytest.mark.parametrize("name", shipped())
def test_scenes_that_come_with_mitsonar_raise_no_false_alarm(name):
    assert said(mitsonar.load_file(name, **COARSE.get(name, {}))) == []


@pytest.mark.parametrize("reach", [15, 20])           # to the bed itself: its echo begins where the record ends
def test_a_range_that_ends_above_the_bed_is_said_once(tmp_path, reach):
    message, = said(scene_of(tmp_path, range=reach))
    assert f"range of {reach} m ends above the seabed" in message and "20 m" in message and "every ping" in message


def test_a_bed_narrower_than_the_window_is_said_with_both_lengths(tmp_path):
    message, = said(scene_of(tmp_path, NARROW))
    # the bed ends 30 m off the track; a slant range of 60 m over 20 m of water reaches 56.6 m
    assert "ends about 30" in message and "reaches 56.6 m" in message and "no shadow" in message


@pytest.mark.parametrize("kind, extra", [("forward_looking", ""), ("sector_scan", ""), ("multibeam", ""),
                                         ("synthetic_aperture", ""), ("interferometric", "")])
def test_every_kind_of_sonar_is_told(tmp_path, kind, extra):
    sensor = f'<sensor type="{kind}" id="sonar">{extra}'
    edits = ((SENSORS[0], sensor), (SENSORS[1], ""), ('<integer name="bins" value="50"/>', ""))
    narrow = ('<float name="length" value="200"/> <float name="width" value="200"/>',
              '<float name="length" value="30"/> <float name="width" value="30"/>')
    assert said(scene_of(tmp_path, *edits)) == []
    assert len(said(scene_of(tmp_path, *edits, narrow))) == 1
    assert "ends above" in said(scene_of(tmp_path, *edits, range=15))[0]


def test_a_quay_at_the_edge_of_the_bed_and_a_target_above_it_are_meant(tmp_path):
    quays = "".join(f'<shape type="cube" id="quay_{side}"><transform name="to_world"><scale x="1" y="100" z="30"/>'
                    f'<translate x="{side}29" y="0" z="0"/></transform><ref id="sand"/></shape>' for side in ("-", ""))
    assert said(scene_of(tmp_path, NARROW, ("</scene>", f"{quays}</scene>"))) == []
    target = '<shape type="point_target" id="buoy"><point name="position" x="5" y="0" z="-12"/></shape>'
    assert said(scene_of(tmp_path, ("</scene>", f"{target}</scene>"), range=15)) == []


def test_render_says_it_in_one_line(tmp_path, capfd):
    (tmp_path / "scene.xml").write_text(spoilt())
    assert main(["render", str(tmp_path / "scene.xml"), "-D", "range=15", "-o", str(tmp_path / "out.exr")]) == 0
    assert capfd.readouterr().err.count("ends above the seabed") == 1
