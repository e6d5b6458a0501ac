"""The command `signals`: the file it writes, and everything about arrays that it must refuse in one sentence."""
import re

import numpy as np
import pytest
from small_scene import spoilt

from mitsonar.cli import main as cli
from mitsonar.io.records import signals as netcdf

TEXT = """<scene version="3.0.0">
    <default name="elements" value="3"/>
    <integrator type="sonar_path"><float name="cell" value="0.5"/></integrator>
    <sensor type="array_sonar" id="sonar">
        <float name="frequency_khz" value="100"/>
        <string name="receive" value="line"/> <integer name="receive_elements" value="$elements"/>
        <point name="start" x="0" y="0" z="-10"/>
        <medium type="seawater" id="water"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="30"/></film>
    </sensor>
    <shape type="seabed" id="bed">
        <float name="depth" value="20"/> <float name="length" value="80"/> <float name="width" value="80"/>
        <float name="spacing" value="5"/> <bsdf type="lambert"/>
    </shape>
</scene>
"""
START = '<point name="start" x="0" y="0" z="-10"/>'
FILM = '<float name="range" value="30"/>'
LINE = '<string name="receive" value="line"/> <integer name="receive_elements" value="$elements"/>'
CELL = '<float name="cell" value="0.5"/>'


@pytest.fixture
def scene(folder):
    """Write the scene with some of its text replaced."""
    def write(*edits):
        (folder / "array.xml").write_text(spoilt(*edits, text=TEXT), encoding="utf-8")
    write()
    return write


def test_the_file_holds_what_python_gives(variant, folder, scene, capfd):
    import mitsonar

    assert cli.main(["signals", "array.xml", "-o", "a.nc", "-D", "elements=4", "--seed", "5"]) == 0
    assert capfd.readouterr() == ("a.nc\n", "")
    there = netcdf.read("a.nc")
    here = mitsonar.element_signals(mitsonar.load_file("array.xml", elements=4), seed=5)
    assert np.array_equal(there.values, here.values) and there.dims == here.dims
    assert there.attrs["parameters"] == {"elements": "4"} and there.attrs["source_level_db"] == 210


def test_work_of_more_than_a_moment_is_told_before_it_starts(variant, folder, scene, capfd, monkeypatch):
    from mitsonar.survey.pressure import cost as array_cost

    monkeypatch.setattr(array_cost, "WORTH_SAYING", 0.0)
    scene((START, START + '<string name="picture" value="elements"/>'))
    for command in (["signals", "-o", "a.nc"], ["signals", "-o", "a.nc", "--response"], ["render", "-o", "a.exr"]):
        assert cli.main([command[0], "array.xml", *command[1:]]) == 0
        assert re.fullmatch(r"mitsonar: 1 ping to 3 elements, \d+ cells of 50 cm within reach: under 1 s; faster: "
                            r"a shorter range, or coarser with cell 1 \(under 1 s\) "
                            r"or ensonification rays \(under 1 s\)\n",
                            capfd.readouterr().err)


def test_responses(variant, folder, scene):
    assert cli.main(["signals", "array.xml", "-o", "a.nc", "--response", "--kernel", "nearest", "--ping", "0"]) == 0
    there = netcdf.read("a.nc")
    assert there.sizes["rx"] == 3 and there.attrs["kernel"] == "nearest" and "tx_x" in there.coords


def sensor(text):
    return (START, START + text)


WRONG = {
    "no elements": ([(LINE, '<string name="receive" value="line"/> <integer name="receive_elements" value="0"/>')],
                    "receive_elements is the integer 0; expected an integer at least 1"),
    "sampling below the bandwidth": ([(FILM, FILM + '<float name="sample_rate_khz" value="4"/>')],
                                     "sample_rate_khz is 4, and the pulse of this array has a band of"),
    "pulse longer than the record": ([sensor('<float name="pulse_ms" value="80"/>')], "longer"),
    "an array larger than the approximation allows": (
        [(LINE, '<string name="receive" value="line"/> <integer name="receive_elements" value="2"/>'
                '<float name="receive_pitch" value="30"/>'),
         ('<float name="sound_speed" value="1500"/>',
          '<spectrum name="profile" value="0:1520, 8:1520, 12:1480, 30:1478"/>')],
        "too far for the vector approximation here"),
    "cells too small": ([(CELL, '<float name="cell" value="0.00001"/>')], "larger cells"),
    "an instance": ([("</scene>", '<shape type="shapegroup" id="group"><shape type="cube"/></shape>'
                                  '<shape type="instance" id="box"><ref id="group"/></shape></scene>')],
                    'the shape "box" is of the kind instance, which has no facets'),
    "fan_count alone": ([(CELL, CELL + '<integer name="fan_count" value="3"/>')], "only counts with fans"),
    "bandwidth of a cw": ([sensor('<string name="pulse" value="cw"/><float name="bandwidth_khz" value="3"/>')],
                          "bandwidth_khz is given, but a cw pulse"),
    "unknown window": ([sensor('<string name="pulse_window" value="hat"/>')], 'window is "hat"; give one of boxcar'),
    "window out of range": ([sensor('<string name="pulse_window" value="tukey 3"/>')], 'tukey'),
    "too many cells": ([(CELL, '<float name="cell" value="0.002"/>')],
                       'larger cells, a shorter range, or ensonification "rays"'),
    "unknown ensonification": ([(CELL, '<string name="ensonification" value="moon"/>')], 'one of "scatterers", "rays"'),
    "unknown attribute": ([sensor('<float name="recieve_pitch" value="1"/>')], 'did you mean "receive_pitch"?'),
    "no seabed below": ([sensor("").__class__((START, '<point name="start" x="500" y="0" z="-10"/>'))],
                        "track outside the bathymetry"),
    "below the seabed": ([(START, '<point name="start" x="0" y="0" z="-25"/>')], "sonar below the seabed"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_scenes(variant, scene, refusal, case):
    edits, sentence = WRONG[case]
    scene(*edits)
    assert re.search(re.escape(sentence), refusal("signals", "array.xml", "-o", "a.nc")), case


@pytest.mark.parametrize("arguments,sentence", [
    (["--kernel", "round"], "kernel is 'round'; choose one of"),
    (["--return-path", "home"], "return_path is 'home'; choose one of paper, vector, eigenray"),
    (["--ping", "1"], "ping 1 was asked for, but the track has 1"),
    (["--seed", "-1"], "seed is -1"),
    (["-D", "x=1"], "x"),
])
def test_wrong_arguments(variant, scene, refusal, arguments, sentence):
    assert sentence in refusal("signals", "array.xml", "-o", "a.nc", *arguments)


def test_a_name_that_is_none_of_netcdf(variant, folder, scene, refusal):
    assert "cannot write a.txt: its name must end in .nc" in refusal("signals", "array.xml", "-o", "a.txt")


def test_the_faces_of_a_sidescan_are_elements_too(variant, folder):
    coarse = ('value="$rays"/></integrator>', 'value="$rays"/><float name="cell" value="1"/></integrator>')
    (folder / "scene.xml").write_text(spoilt(coarse), encoding="utf-8")
    assert cli.main(["signals", "scene.xml", "-o", "a.nc", "--ping", "1", "-D", "range=40"]) == 0
    there = netcdf.read("a.nc")
    assert there.sizes["rx"] == 2 and there["ping"].values.tolist() == [1]


def test_a_single_element_has_a_picture_too(variant, folder, scene):
    scene((LINE, ""), ('    <default name="elements" value="3"/>\n', ""))
    assert cli.main(["render", "array.xml", "-o", "a.exr", "--preview", "a.png"]) == 0
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")


def test_the_fan_of_an_array_is_its_picture(variant, folder, scene, refusal):
    from mitsonar.io.records import exr

    assert cli.main(["render", "array.xml", "-o", "a.exr", "--preview", "a.png", "-D", "elements=8"]) == 0
    image = exr.read("a.exr")
    assert dict(image["level"].sizes) | {"range": 0} == {"ping": 1, "beam": 121, "range": 0}
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    assert cli.main(["plot", "a.exr"]) == 0
    assert cli.main(["plot", "a.exr", "--what", "labels"]) == 0
    assert "is of a sidescan" in refusal("plot", "a.exr", "--what", "depth")
    assert "there is no ping 3" in refusal("plot", "a.exr", "--ping", "3")
