"""The command `published`: what it prints, the files it writes, and what it refuses in one sentence."""
import csv

import pytest

from mitsonar.cli import main as cli
from mitsonar.scenes.published import RESULTS


def test_says_the_result_without_a_file(folder, capfd):
    assert cli.main(["published", "figure_3"]) == 0
    out, err = capfd.readouterr()
    assert "3 vertically" in out and " 27 " in out and err == ""
    assert [path.name for path in folder.iterdir()] == ["scene.xml"]


def test_numbers_and_figure(folder, capfd):
    assert cli.main(["published", "figure_3", "-o", "f.csv"]) == 0
    assert cli.main(["published", "figure_3", "-o", "f.png"]) == 0
    assert capfd.readouterr().out.splitlines() == ["f.csv", "f.png"]
    with open("f.csv", encoding="utf-8", newline="") as file:
        header, *records = csv.reader(file)
    assert header[:4] == ["arrangement", "launch_angle_deg", "tx", "rx"] and len(records) == 3 + 27 + 27 + 27
    assert (folder / "f.png").read_bytes().startswith(b"\x89PNG")


def test_results_have_what_the_command_needs():
    for result in RESULTS.values():
        assert all(callable(getattr(result, verb)) for verb in ("compute", "table", "rows", "plot"))


@pytest.mark.parametrize("arguments, says", [
    (("figure_9",), "'figure_9' (did you mean \"figure_3\"?); give one of"),
    (("figure_3", "-o", "f.jpg"), "f.jpg: its name must end in .csv"),
    (("figure_9", "-o", "f.png"), "figure_9"),
    (("figure_3", "-o", "nowhere/f.png"), "nowhere does not exist"),
    ((), "RESULT"),
])
def test_refusals(refusal, arguments, says):
    assert says in refusal("published", *arguments)
