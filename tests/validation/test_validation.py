"""The comparisons of `mitsonar validate`, each by itself in its quick form, and the report made of them.

What a comparison allows, and why, stands in its case; here all must be within it.
"""
import dataclasses

import numpy as np
import pytest

from mitsonar.validation import CASES, Case, Compared, Curve, Panel, Table, report, validate
from mitsonar.validation.case import worst
from mitsonar.validation.report import draw


@pytest.mark.parametrize("name", CASES)
def test_every_comparison_is_within_what_is_allowed(variant, name):
    table = CASES[name].run(True)
    beyond = [(row.label, row.got, row.expected, row.allowed) for row in table.rows if not row.holds]
    assert table.rows and not beyond
    assert table.panels and all(line.x is not None and len(line.x) == len(line.y) > 0 for panel in table.panels
                                for line in panel.lines)
    assert "\n" not in CASES[name].title and CASES[name].text.endswith(".")


def made(got=1.0):
    """A case whose one number should be 1.0 ± 0.1."""
    panel = Panel("t", "x", "y", (Curve("a", [1.0, 2.0], [1.0, 4.0]), Curve("a", [1.0], [1.0], ".")), "xy")
    return Case(title="Made up", text="Nothing.",
                run=lambda quick: Table((Compared("one | two", got, 1.0, 0.1, "m"),), (panel,), ("A note.",)))


def test_rows_say_whether_they_hold():
    row = Compared("r", 1.2, 1.0, 0.1, "dB")
    assert row.error == pytest.approx(0.2) and row.share == pytest.approx(2) and not row.holds
    assert Compared("r", 0.95, 1.0, 0.1, "dB").holds
    assert not Compared("r", np.nan, 1.0, 0.1, "dB").holds
    assert not Table((row, Compared("r", 1.0, 1.0, 0.1, "dB")), ()).holds


def test_worst_is_told_with_its_number():
    row = worst("w", [1.0, 2.5, 3.0], [1.0, 2.0, 3.2], 1.0, "m")
    assert (row.label, row.got, row.expected) == ("w (worst of 3)", 2.5, 2.0)
    assert not worst("w", [1.0, np.nan], [9.0, 1.0], 10.0, "m").holds
    assert worst("w", 1.0, 1.0, 1.0, "m").label == "w"


@pytest.mark.parametrize("got, word", [(1.05, "within"), (1.2, "**beyond**")])
def test_report_has_every_number_and_picture(monkeypatch, tmp_path, got, word):
    monkeypatch.setattr("mitsonar.validation.CASES", {"first": made(got), "second": made()})
    said = []
    assert validate(folder=tmp_path / "r", say=said.append) == (word == "within")
    assert len(said) == 2 and "one | two" in said[0] and ("TOO MUCH" in said[0]) == (word != "within")
    text = (tmp_path / "r" / "report.md").read_text()
    assert f"| one \\| two | {got:.2f} | 1.00 | {got - 1:+.2f} | 0.1 | m | {word} |" in text
    assert "A note." in text and text.count("![Made up]") == 2
    assert {path.name for path in (tmp_path / "r").iterdir()} == {"report.md", "first.png", "second.png"}
    assert [path.name for path in tmp_path.iterdir()] == ["r"]


def test_an_older_report_is_replaced_and_nothing_else_is(monkeypatch, tmp_path):
    monkeypatch.setattr("mitsonar.validation.CASES", {"first": made(), "second": made()})
    validate(folder=tmp_path / "r", say=str)
    validate(["second"], folder=tmp_path / "r", say=str)
    assert {path.name for path in (tmp_path / "r").iterdir()} == {"report.md", "second.png"}
    (tmp_path / "r" / "thesis.tex").write_text("years")
    with pytest.raises(ValueError, match="thesis.tex, which is no part of a report"):
        validate(folder=tmp_path / "r", say=str)
    assert (tmp_path / "r" / "thesis.tex").read_text() == "years"


def test_a_failure_leaves_the_older_report(monkeypatch, tmp_path):
    monkeypatch.setattr("mitsonar.validation.CASES", {"first": made()})
    validate(folder=tmp_path / "r", say=str)
    before = (tmp_path / "r" / "report.md").read_text()
    monkeypatch.setattr(report, "_markdown", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        validate(folder=tmp_path / "r", say=str)
    assert (tmp_path / "r" / "report.md").read_text() == before
    assert [path.name for path in tmp_path.iterdir()] == ["r"]


def test_many_panels_stand_in_rows():
    case = made()
    table = case.run(True)
    figure = draw(case, dataclasses.replace(table, panels=table.panels * 4))
    assert sum(axes.get_visible() for axes in figure.axes) == 4


def test_numbers_are_said_to_a_tenth_of_what_is_allowed():
    assert report._numbers(Compared("r", 1.23456, 1.2, 0.2, "dB")) == ("1.23", "1.20", "+0.03", "0.2")
    assert report._numbers(Compared("r", 0.1234567891234, 0.1234567891, 1e-15, "s"))[3] == "1.0e-15"
