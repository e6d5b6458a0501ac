"""The command `fit`: its file, its sentences, going on after a stop, and what it refuses in one sentence."""
import numpy as np
import pytest
import xarray as xr
from closed_models import Matrix

from mitsonar.cli import main as cli
from mitsonar.inversion import Gaussian, Prior, fit, problems


@pytest.fixture
def answered(monkeypatch):
    """Let a scene's fit be one of a matrix, and keep what it was asked."""
    asked = {}

    def scene(inputs, options, progress):
        asked.update(inputs=list(inputs), **options)
        found = fit(Matrix(np.eye(3)), Gaussian(np.ones(3), 0.5), {"x": Prior(deviation=1.0)},
                    state_file=options.get("state"), progress=progress)
        return problems.Solved(dataset=found.to_dataset(), sentences=found.sentences())

    plain = problems.SCENE
    monkeypatch.setattr(problems, "SCENE", problems.Problem(asks=plain.asks, summary=plain.summary, takes=plain.takes,
                                                            solve=scene))
    return asked


def test_the_answer_is_written_and_told(folder, answered, capfd):
    assert cli.main(["fit", "scene.xml", "a.exr", "x=1", "-o", "a.nc", "--looks", "4", "--picture", "a.png"]) == 0
    out, err = capfd.readouterr()
    lines = out.splitlines()
    assert lines[-2:] == ["a.nc", "a.png"] and "fitted to its noise" in lines[0] and err == ""
    assert (folder / "a.png").read_bytes().startswith(b"\x89PNG")
    with xr.open_dataset("a.nc") as found:
        assert found["x_deviation"].shape == (3,)
    assert answered == {"inputs": ["scene.xml", "a.exr", "x=1"], "looks": 4.0}


def test_a_written_answer_is_drawn_and_nothing_else_of_it(folder, answered, refusal):
    assert cli.main(["fit", "scene.xml", "a.exr", "x=1", "-o", "a.nc"]) == 0
    assert cli.main(["plot", "a.nc"]) == 0
    assert (folder / "a_fit.png").read_bytes().startswith(b"\x89PNG")
    assert "whose only plot is fit" in refusal("plot", "a.nc", "--what", "waterfall")
    assert "the picture of a fit has no --ping, --tvg" in refusal("plot", "a.nc", "--ping", "1", "--tvg", "none")


def test_inputs_may_stand_behind_options(folder, answered):
    assert cli.main(["fit", "scene.xml", "-o", "a.nc", "--iterations", "3", "a.exr", "x=1"]) == 0
    assert answered["inputs"] == ["scene.xml", "a.exr", "x=1"] and answered["iterations"] == 3


def test_a_state_is_left_and_gone_on_with(folder, answered):
    for _ in range(2):
        assert cli.main(["fit", "scene.xml", "a.exr", "x=1", "-o", "a.nc", "--state", "s.npz"]) == 0
    assert (folder / "s.npz").exists()


def test_a_fit_that_is_stopped_leaves_its_state_and_says_so(folder, monkeypatch, capfd):
    def stopped(inputs, options, progress):
        (folder / options["state"]).write_bytes(b"state")
        raise KeyboardInterrupt

    plain = problems.SCENE
    monkeypatch.setattr(problems, "SCENE", problems.Problem(asks=plain.asks, summary=plain.summary, takes=plain.takes,
                                                            solve=stopped))
    assert cli.main(["fit", "scene.xml", "a.exr", "x=1", "-o", "a.nc", "--state", "s.npz"]) == 130
    assert capfd.readouterr().err == "mitsonar: interrupted; s.npz is left, and the same command goes on with it\n"
    assert not (folder / "a.nc").exists()


@pytest.mark.parametrize("arguments, says", [
    (["scene.xml", "a.exr", "-o", "a.nc"], "a scene, a record and one KEY=DEVIATION or more"),
    (["scene.xml", "a.exr", "bed.heights", "-o", "a.nc"], "is not KEY=DEVIATION"),
    (["scene.xml", "a.exr", "bed.heights=1:2", "-o", "a.nc"], "is not KEY=DEVIATION"),
    (["scene.xml", "a.exr", "bed.heights=nan", "-o", "a.nc"], "is not KEY=DEVIATION"),
    (["scene.xml", "a.exr", "bed.heights=1", "-o", "a.nc"], "cannot read a.exr"),
    (["scene.xml", "a.exr", "bed.heights=1", "-o", "a.csv"], "its name must end in .nc"),
    (["scene.xml", "a.exr", "bed.heights=1", "-o", "a.nc", "--picture", "a.gif"], "cannot write a.gif"),
    (["scene.xml", "a.exr", "bed.heights=1", "-o", "a.nc", "--farthest", "3"], "--farthest is not an option"),
    (["heights", "scene.xml", "-o", "a.nc"], "takes a scene, a record, and the bed's id"),
    (["heights", "scene.xml", "a.exr", "bed", "-o", "b.nc", "--noise", "3"], "--noise is not an option of the "),
    (["heights", "scene.xml", "a.exr", "bed", "-o", "b.nc"], "cannot read a.exr"),
    (["map", "scene.xml", "a.exr", "-o", "b.nc"], "takes a scene, a record, and the key of a texture"),
    (["map", "scene.xml", "a.exr", "bed.x", "-o", "b.nc", "--strength", "x"], "--strength is not an option"),
])
def test_bad_input_is_one_sentence(folder, refusal, arguments, says):
    assert says in refusal("fit", *arguments)
