"""Bins or a sampling rate of the film that do not fit the pulse of an array: refused by attribute, file and line."""
import pytest
from small_scene import spoilt

import mitsonar

SIDESCAN = '<sensor type="sidescan" id="sonar">', '        <boolean name="speckle" value="$speckle"/>\n'


def scene_of(tmp_path, kind, *edits):
    path = tmp_path / "scene.xml"
    path.write_text(spoilt((SIDESCAN[0], f'<sensor type="{kind}" id="sonar">'), (SIDESCAN[1], ""), *edits))
    return path


@pytest.mark.parametrize("kind", ["forward_looking", "multibeam", "synthetic_aperture", "array_sonar"])
def test_bins_of_a_sidescan_are_refused_by_attribute_file_and_line_before_any_estimate(tmp_path, kind):
    path, said = scene_of(tmp_path, kind), []
    with pytest.raises(ValueError, match="bins is 50, which sample 60 m of range at 0.625 kHz") as caught:
        mitsonar.render(path, say=said.append)
    assert str(caught.value).startswith(f"{path}, line 10: ") and "Remove bins" in str(caught.value)
    assert said == []


def test_without_a_file_the_kind_of_sonar_stands_in_its_place(tmp_path):
    import mitsuba as mi

    scene = mi.load_file(str(scene_of(tmp_path, "forward_looking")), optimize=False)
    with pytest.raises(ValueError, match="^forward_looking: bins is 50, .* give at least"):
        mitsonar.render(scene)


def test_a_class_of_2_1_mhz_is_sampled_as_its_instruments_are(tmp_path):
    """703 samples over 2 m are 260 kHz, below the 268 kHz of its pulse and above nine tenths of them."""
    preset = '<string name="preset" value="multibeam_2100khz"/> <integer name="beams" value="8"/>'
    path = scene_of(tmp_path, f'forward_looking" id="sonar">{preset}<point name="start" x="0" y="0" z="-29"/><!--',
                    ('"range" value="60"', '"range" value="2"'), ('"pings" value="2"', '"pings" value="1"'),
                    ('name="bins" value="50"', 'name="bins" value="703"'))
    path.write_text(path.read_text().replace('<!--" id="sonar">', ""))
    assert dict(mitsonar.render(path).sizes)["range"] == 703
