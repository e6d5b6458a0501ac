"""The command soundings of a scene that is ended on its way goes on, and the file has the same bytes."""
import os

import pytest

from mitsonar.cli import main as cli

SCENE = """<scene version="3.0.0"><default name="depth" value="6"/>
    <integrator type="sonar_path"/>
    <sensor type="multibeam" id="sonar">
        <string name="preset" value="narrow_600khz"/><float name="swath_deg" value="80"/>
        <integer name="beams" value="24"/><integer name="pings" value="3"/><point name="start" x="0" y="0" z="-1"/>
        <float name="speed_knots" value="4"/><float name="ping_rate_hz" value="5"/>
        <medium type="seawater"/><film type="sonar_film"><float name="range" value="10"/></film>
    </sensor>
    <shape type="seabed" id="seabed"><float name="depth" value="$depth"/><float name="length" value="30"/>
        <float name="width" value="30"/><float name="spacing" value="1"/>
        <bsdf type="lambert"><float name="mu_db" value="-20"/></bsdf></shape>
</scene>"""


@pytest.fixture
def scene(folder):
    """A small line of soundings in the current folder."""
    (folder / "scene.xml").write_text(SCENE, encoding="utf-8")
    return folder


LINE = "soundings", "scene.xml", "--seed", "5"


def run(*options):
    return cli.main([*LINE, *options])


def files(folder):
    return sorted(path.name for path in folder.iterdir() if path.name != "scene.xml")


def test_the_same_command_goes_on_and_the_bytes_are_those_of_one_run(variant, scene, capfd, interrupted):
    name, options = "line.nc", ("-o", "line.nc", "--column")
    assert run(*options) == 0
    assert "already in the file" not in capfd.readouterr().err and files(scene) == [name]
    whole = (scene / name).read_bytes()
    os.remove(name)
    interrupted(*LINE, *options)
    left = scene / f"{name}.part"
    assert f"interrupted; {left} is left, and the same command goes on with it" in capfd.readouterr().err
    assert files(scene) == [left.name]
    # what a program that was killed while it wrote leaves; no process has so high a number
    (scene / ".line.7fffffff-0123abcd.nc").write_bytes(b"half")
    assert run(*options) == 0
    assert "2 pings were already in the file" in capfd.readouterr().err
    assert (scene / name).read_bytes() == whole and files(scene) == [name]


def test_soundings_of_another_scene_or_of_other_options_are_refused(variant, scene, capfd, interrupted):
    interrupted(*LINE, "-o", "line.nc")
    capfd.readouterr()
    for options, words in ((("-D", "depth=7"), "begun with other parameters (none, and here depth=7)"),
                           (("--snippets", "8"), "begun with another scene")):
        assert run("-o", "line.nc", *options) == 2
        assert words in capfd.readouterr().err
    assert files(scene) == ["line.nc.part"]


def test_options_that_do_not_fit_are_refused_before_the_first_ping(variant, scene, capfd):
    for options, words in ((("--place", "91", "0"), "place is 91"), (("--start", "1900-01-01"), "1970 and 2106")):
        assert run("-o", "line.nc", *options) == 2
        assert words in capfd.readouterr().err
    assert files(scene) == []


def test_hidden_files_of_running_programs_stay(tmp_path):
    from mitsonar.device.files import clear_left, replacing

    with replacing(tmp_path / "a.nc") as temporary:
        clear_left(tmp_path / "a.nc")
        assert temporary.exists()
        temporary.write_bytes(b"whole")
    assert files(tmp_path) == ["a.nc"]
