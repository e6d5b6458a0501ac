"""README.md is short and true: its scene renders and shows what is in it, its list of plugins is whole.

That its Python and its commands run is the business of `test_documentation`.
"""
import re
from pathlib import Path

import numpy as np
from manual import links

import mitsonar

README = Path(__file__).resolve().parents[2] / "README.md"
SCENES = README.parent / "scenes"
LONGEST = 13_000                   # bytes: what is read before the first picture is made


def test_it_is_short():
    assert README.stat().st_size <= LONGEST


def test_its_links_work_on_the_page_of_a_package_index():
    """There are no files beside it: links lead to headings of its own, or to addresses."""
    text = README.read_text(encoding="utf-8")
    assert [link for link in links(text) if not link.startswith(("https://", "#"))] == []
    assert "](" in text


def test_the_command_under_the_picture_of_the_fan_takes_in_all_that_is_in_the_picture():
    """Box, pipe and buoy of the scene lie within the ranges and angles that the command draws, and the cells suit."""
    from mitsonar.survey.pressure.signals import LEAD

    text = (SCENES / "manual" / "forward_looking.md").read_text(encoding="utf-8")
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
