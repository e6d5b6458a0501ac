"""The command show: its picture, its default name, and what it refuses."""
import pytest
from PIL import Image

from mitsonar.cli import main as cli

REFUSED = {
    "unknown suffix": (["-o", "plan.txt"], "must end in .png, .pdf or .svg"),
    "folder missing": (["-o", "no/plan.png"], "make it first"),
    "no such ping": (["--ping", "2"], "a section at ping 2 is asked for, and the scene has 2"),
    "no such sonar": (["--sensor", "x"], 'sensor "x" was asked for'),
    "no such parameter": (["-D", "ping=3"], "ping"),
}


@pytest.mark.parametrize("words, output", [([], "scene_plan.png"), (["-o", "p.png", "-D", "range=40"], "p.png")])
def test_it_writes_a_picture(folder, capfd, words, output):
    assert cli.main(["show", "scene.xml", *words]) == 0
    assert capfd.readouterr() == (f"{output}\n", "")
    with Image.open(folder / output) as picture:
        assert min(picture.size) > 400 and len(picture.convert("RGB").getcolors(10_000_000)) > 50


@pytest.mark.parametrize("words, said", REFUSED.values(), ids=REFUSED)
def test_what_it_refuses(folder, refusal, words, said):
    assert said in refusal("show", "scene.xml", *words)
