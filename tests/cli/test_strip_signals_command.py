"""The command `signals` of a synthetic aperture: streamed, taken up again, refused in one sentence."""
import os

import pytest
from small_strip import TEXT

from mitsonar.cli import main as cli

SIGNALS = ("signals", "strip.xml", "-o", "raw.nc")


@pytest.fixture
def folder(folder):
    (folder / "strip.xml").write_text(TEXT, encoding="utf-8")
    return folder


def test_the_file_holds_what_python_gives_and_an_interrupted_one_goes_on(variant, folder, capfd, monkeypatch):
    import mitsonar
    from mitsonar.cli import progress
    from mitsonar.io.records import raw_echoes

    assert cli.main([*SIGNALS, "--seed", "5"]) == 0
    assert capfd.readouterr() == ("raw.nc\n", "")
    there, here = mitsonar.read("raw.nc"), mitsonar.raw_echoes(mitsonar.load_file("strip.xml"), seed=5)
    assert there["signal"].values.tobytes() == here["signal"].values.tobytes() and there.sizes["ping"] == 4
    assert there["target_name"].values.tolist() == ["ball"] and there.attrs["seed"] == 5
    whole = (folder / "raw.nc").read_bytes()
    os.remove("raw.nc")

    def interrupt(self, done, total, failed=0):
        if done == 2:
            raise KeyboardInterrupt

    with monkeypatch.context() as context:
        context.setattr(progress.Progress, "__call__", interrupt)
        assert cli.main([*SIGNALS, "--seed", "5"]) == 130
    left = folder / "raw.nc.part"
    assert capfd.readouterr() == ("", f"mitsonar: interrupted; {left} is left, and the same command goes on with it\n")
    assert raw_echoes.written("raw.nc") == 2
    assert cli.main([*SIGNALS, "--seed", "6"]) == 2
    assert f"{left} was begun with another seed (5, and here 6); remove it" in capfd.readouterr().err
    assert cli.main([*SIGNALS, "--seed", "5"]) == 0
    assert capfd.readouterr() == ("raw.nc\n", "mitsonar: 2 of 4 pings were already in the file\n")
    assert (folder / "raw.nc").read_bytes() == whole and not left.exists()


def test_scatterers_are_written_beside_and_longer_work_is_told(variant, folder, capfd, monkeypatch):
    import mitsonar
    from mitsonar.cli import progress

    monkeypatch.setattr(progress, "WORTH_SAYING", 0.0)
    assert cli.main([*SIGNALS, "-D", "pings=2", "--scatterers", "points.nc"]) == 0
    out, err = capfd.readouterr()
    assert out == "points.nc\nraw.nc\n" and err.startswith("mitsonar: 2 pings of 4 receivers x ")
    found = mitsonar.read("points.nc")
    assert found["amplitude"].dtype.kind == "c" and found.sizes["scatterer"] > 10
    assert abs(float((abs(found["amplitude"]) ** 2).mean()) - 1) < 5 / found.sizes["scatterer"] ** 0.5


@pytest.mark.parametrize("options, words", [
    (("--scatterers", "raw.nc"), "raw.nc is the name of two outputs"),
    (("--scatterers", "a.csv"), "cannot write a.csv: its name must end in .nc"),
    (("--response",), "--response is for other arrays"), (("--ping", "1"), "--ping is for other arrays"),
    (("--kernel", "nearest"), "--kernel is for other arrays"), (("--path", "b"), "--path is for other arrays"),
    (("-o", "raw.h5"), "its name must end in .nc")])
def test_options_of_other_arrays_are_refused(variant, refusal, options, words):
    assert words in refusal(*SIGNALS, *options)
