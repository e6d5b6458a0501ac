"""The command `gradient-check`: its table, the files it writes, its exit code, and what it refuses in one sentence."""
import csv

import numpy as np
import pytest
import xarray as xr
from fake_models import Fake, of_key

from mitsonar.cli import main as cli
from mitsonar.gradients.check.check import GradientCheck, PartCheck
from mitsonar.verbs import gradients as gradient_verbs

SMALL = ("gradient-check", "scene.xml", "-D", "speckle=false")


@pytest.fixture
def fake(monkeypatch):
    """Let the parameters of a scene be those of a fake model, one of them spoilt."""
    def put(spoil=lambda jacobian, key: jacobian):
        monkeypatch.setattr(gradient_verbs, "differentiable", lambda scene: list(Fake().start))
        monkeypatch.setattr(gradient_verbs, "_model", lambda *_, **__: Fake(spoil))
    return put


def test_a_scene_whose_gradients_are_right_is_exit_code_0(folder, capfd):
    assert cli.main([*SMALL, "sand.strength"]) == 0
    out, err = capfd.readouterr()
    assert out.splitlines()[1].split()[:2] == ["sand.strength", "right"] and err == ""


def test_without_keys_all_are_checked_each_alone(folder, fake, capfd):
    fake()
    assert cli.main(["gradient-check", "scene.xml"]) == 0
    out, err = capfd.readouterr()
    assert [line.split()[0] for line in out.splitlines()[1:6]] == ["depth", "bed", "unheard", "gain", "gain"]
    assert out.splitlines()[-1] == "bins in shadow: 25.0%" and err == ""


@pytest.mark.parametrize("spoil, verdict", [(lambda jacobian: 1.02 * jacobian, "off"), (np.zeros_like, "disconnected")])
def test_a_wrong_gradient_is_exit_code_1_and_a_sentence(folder, fake, capfd, spoil, verdict):
    fake(of_key("bed", spoil))
    assert cli.main(["gradient-check", "scene.xml"]) == 1
    out, err = capfd.readouterr()
    assert out.splitlines()[2].split()[:2] == ["bed", verdict]
    assert err == f"mitsonar: the gradient of bed is {verdict}: do not fit by it\n"


@pytest.mark.parametrize("options, code", [([], 1), (["--allow-undecided"], 0)])
def test_what_is_undecided_is_exit_code_1_unless_that_is_allowed(folder, fake, monkeypatch, capfd, options, code):
    row = PartCheck(key="bed", unit="m", size=3, verdict="undecided", error=0.2)
    monkeypatch.setattr(gradient_verbs, "gradient_check",
                        lambda scene, keys, **_: GradientCheck(rows=(row,), directions=3, tolerance=0.01))
    assert cli.main(["gradient-check", "scene.xml", *options]) == code
    err = capfd.readouterr().err
    assert err.startswith("mitsonar: differences could not decide on bed; take more rays") if code else err == ""


def test_the_tolerance_is_what_is_asked_for(folder, fake):
    fake(of_key("bed", lambda jacobian: 1.02 * jacobian))
    assert cli.main(["gradient-check", "scene.xml", "bed", "--tolerance", "0.03"]) == 0


def test_the_table_is_written_as_netcdf_and_csv(folder, fake, capfd):
    fake()
    for name in ("a.nc", "a.csv"):
        assert cli.main(["gradient-check", "scene.xml", "bed", "gain", "-o", name]) == 0
        assert capfd.readouterr().out.splitlines()[-1] == name
    with xr.open_dataset("a.nc") as table, open("a.csv", newline="") as file:
        rows = list(csv.DictReader(file))
        assert list(table["key"].values) == [row["key"] for row in rows] == ["bed", "gain", "gain"]
        assert float(rows[0]["error"]) == pytest.approx(float(table["error"][0]))
        assert table.attrs["directions"] == 3


@pytest.mark.parametrize("arguments, says", [
    (("bed.vertex_position",), 'no parameter \'bed.vertex_position\' that gradients could be of (did you mean'),
    (("--tolerance", "2"), "tolerance is 2; give a share between 0 and 1"),
    (("--directions", "0"), "directions is 0; give 1 or more"),
    (("--sensor", "sonnar"), "sonnar"),
    (("bed.faces",), "no parameter 'bed.faces' that gradients could be of"),
    (("--dirctions", "2"), "unrecognized arguments: --dirctions 2"),
    (("-o", "a.txt"), "cannot write a.txt: its name must end in .csv or .nc"),
    (("-o", "nowhere/a.nc"), "nowhere does not exist"),
])
def test_refusals(refusal, arguments, says):
    assert says in refusal("gradient-check", "scene.xml", *arguments)
