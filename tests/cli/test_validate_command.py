"""The command `validate`: what it says, the folder it writes, its exit code, and what it refuses in one sentence."""
import pytest

from mitsonar.cli import main as cli
from mitsonar.validation import CASES, Case, Compared, Curve, Panel, Table


def test_says_its_numbers_and_writes_a_report(folder, capfd):
    assert cli.main(["validate", "--quick", "--only", "water", "-o", "report"]) == 0
    out, err = capfd.readouterr()
    assert "sound speed, teos-10" in out and "all 13 within" in out and err == ""
    assert out.splitlines()[-1] == "report/report.md"
    assert {path.name for path in (folder / "report").iterdir()} == {"report.md", "water.png"}


def test_writes_nothing_without_a_folder(folder, capfd):
    assert cli.main(["validate", "--quick", "--only", "water", "beams"]) == 0
    assert "line: first side lobe" in capfd.readouterr().out
    assert [path.name for path in folder.iterdir()] == ["scene.xml"]


def test_an_error_beyond_what_is_allowed_is_exit_code_1(folder, capfd, monkeypatch):
    table = Table((Compared("one", 2.0, 1.0, 0.1, "m"),), (Panel("", "", "", (Curve("", [1], [1]),)),))
    monkeypatch.setitem(CASES, "water", Case(title="t", text="t.", run=lambda quick: table))
    assert cli.main(["validate", "--only", "water", "-o", "report"]) == 1
    assert "1 of 1 beyond what is allowed" in capfd.readouterr().out
    assert "**beyond**" in (folder / "report" / "report.md").read_text()


@pytest.mark.parametrize("arguments, says", [
    (("--only", "watre"), "there is no comparison 'watre' (did you mean \"water\"?); give some of water, rays"),
    (("--only",), "expected at least one argument"),
    (("-o", "scene.xml"), "scene.xml: it is a file; give the name of a folder"),
    (("-o", "."), "the folder holds scene.xml, which is no part of a report"),
    (("-o", "nowhere/report"), "nowhere does not exist"),
    (("-o", ""), "it names no folder"),
    (("water",), "unrecognized arguments: water"),
])
def test_refusals(refusal, arguments, says):
    assert says in refusal("validate", *arguments)
