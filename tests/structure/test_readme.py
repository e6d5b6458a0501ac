"""README.md says what the plugins say: its scene renders, and its tables name every attribute and preset, no others.

That its Python and its commands run is the business of `test_documentation`.
"""
import re
from pathlib import Path

import numpy as np
import pytest

import mitsonar
from mitsonar.sonar import presets

README = Path(__file__).resolve().parents[2] / "README.md"
SCENES = README.parent / "scenes"
NAMED_BY_MITSUBA = {"to_world"}        # every shape has it, whether it reads it by itself or not


def tables():
    """The tables of attributes: (plugins of the heading, names in the first column)."""
    from mitsonar.plugins import reference as attributes

    return [(plugins, {name for names, *_ in rows for name in names}) for plugins, rows in attributes.tables()]


def known(plugin):
    """The attributes a plugin asks for, in any of its ways."""
    from mitsonar.plugins import reference as attributes

    return {one.name for one in attributes.attributes(plugin)}


@pytest.mark.parametrize("plugins, names", [pytest.param(*table, id=" ".join(table[0])) for table in tables()])
def test_tables_name_every_attribute_and_no_other(variant, plugins, names):
    assert names | NAMED_BY_MITSUBA == set().union(*map(known, plugins)) | NAMED_BY_MITSUBA


@pytest.mark.parametrize("plugin", ["sidescan", "seabed", "sonar_path", "array_sonar"])
def test_an_error_knows_the_same_attributes(variant, plugin):
    """What a plugin says that it knows is what its table has, but for arrays that are not points."""
    import mitsuba as mi

    from mitsonar.plugins.reference import WAYS
    from mitsonar.scene.errors import plain

    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": plugin, "surely_unknown": 1, **WAYS.get(plugin, [{}])[0]})
    listed = set(plain(caught.value).partition("Known: ")[2].rstrip(".").split(", "))
    assert listed <= known(plugin) and len(listed) > 5
    assert plugin == "array_sonar" or listed == known(plugin)


def test_defaults_that_are_numbers_are_those_of_the_plugins(variant):
    """Of 80 and more; words such as "as the range allows" cannot be compared."""
    from mitsonar.plugins import reference as attributes
    from mitsonar.plugins.attributes import declared

    compared = 0
    for plugin in attributes.plugins():
        for one in attributes.attributes(plugin):
            taken = declared[plugin][one.name].default
            if isinstance(taken, (bool, int, float)) and re.fullmatch(r"-?[\d.]+|true|false", one.default):
                compared += 1
                wanted = str(taken).lower() if isinstance(taken, bool) else f"{taken:g}"
                assert one.default == wanted, f"{plugin}: {one.name}"
    assert compared > 80


def test_presets_are_those_of_the_table():
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+), ([\d.]+) \| ([\d.]+) \|$",
                      README.read_text(encoding="utf-8"), re.M)
    columns = ("frequency_khz", "source_level_db", "pulse_ms", "beam_width_deg", "vertical_beam_width_deg",
               "depression_deg")
    assert {name: dict(zip(columns, map(float, numbers))) for name, *numbers in rows} == presets()


def test_the_command_under_the_picture_of_the_fan_takes_in_all_that_is_in_the_picture():
    """Box, pipe and buoy of the scene lie within the ranges and angles that the command draws, and the cells suit."""
    from mitsonar.survey.signals import LEAD

    text = (SCENES / "README.md").read_text(encoding="utf-8")
    command = re.search(r"render forward_looking(.*?) -o fan.exr --preview fan.png", text)[1]
    scene = mitsonar.load_file(SCENES / "forward_looking.xml", **dict(re.findall(r"-D (\w+)=(\S+)", command)))
    sensor = scene.sensors()[0]
    survey = scene.integrator().array_survey(scene, sensor, LEAD)
    nearest, farthest = (0.5 * survey.sound_speed(0) * survey.time[k] for k in (survey.lead, -1))
    seen = [shape for shape in scene.shapes() if shape.id() != "seabed"]
    assert {shape.id() for shape in seen} == {"box", "pipe", "buoy"}
    for shape in seen:
        corners = np.array([[shape.bbox().corner(k)[axis] for axis in range(3)] for k in range(8)])
        away = (corners - survey.track.position[0]) @ survey.track.rotation()[0]
        assert (np.linalg.norm(away, axis=1) < farthest - 1).all() and (np.linalg.norm(away, axis=1) > nearest).all()
        assert (np.abs(np.arctan2(away[:, 1], away[:, 0])) < sensor.fan_width / 2).all()
    assert survey.cell_size < survey.sound_speed(0) / (2 * survey.pulse.bandwidth)                 # its resolution


def test_it_names_every_plugin_and_no_other():
    from mitsonar.plugins import reference

    table = README.read_text(encoding="utf-8").partition("| plugin |")[2].partition("\n\n")[0]
    named = [name for cell in re.findall(r"^\| (`.+?) \|", table, re.M) for name in re.findall(r"`(\w+)`", cell)]
    assert sorted(named) == sorted(reference.plugins())


def test_its_scene_renders_and_shows_what_is_in_it(tmp_path):
    text = re.search(r"^```xml\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)[1]
    (tmp_path / "pipe.xml").write_text(text, encoding="utf-8")
    image = mitsonar.render(mitsonar.load_file(tmp_path / "pipe.xml", pings=2))
    number = {name: int(number) for number, name in image.attrs["labels"].items()}
    assert set(number) == {"seabed", "pipe"}
    assert (image["label"] == number["pipe"]).any() and (image["object_shadow"] == number["pipe"]).any()
