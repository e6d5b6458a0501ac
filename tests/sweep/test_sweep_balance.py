"""Class balance: what a plan may ask for, what is counted of runs, resumed ones and merges, and what is said of it."""
import hashlib
import json
from concurrent.futures import Future
from pathlib import Path

import pytest
from small_scene import TEXT

from mitsonar.labels.tally import Tally, checked
from mitsonar.sweep import execute, load_plan, merging, run
from mitsonar.sweep.balance import missed_said, tally_said, verdicts
from mitsonar.sweep.parts import Part

HEAD = """
scene = "scene.xml"
output = "{index:03}.tar"
classes = ["mine", "diver"]
samples = 12
"""
PLAN = HEAD + """
[draw]
rays = { integer = [1000, 3000], stratified = true }
[labels]
negatives = ["rock"]
[balance]
images = { mine = 6, diver = 0.5, rock = 1 }
boxes = { mine = 12 }
empty = 0.25
negative = 2
"""


class Pool:
    """Answers as a worker would whose pictures are by turns empty, with a mine and a rock, and with a rock alone."""

    capacity = 2

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def submit(self, job):
        future, answer = Future(), {"seconds": 0.1, "warnings": []}
        if job["output"] is not None:
            tally, number = Tally(), int(job["output"][:3])
            tally.picture({"mine": int(number % 3 == 1), "diver": 0, "mine shadow": 1}, {"rock": number % 3})
            content = job["output"].encode()
            Path(job["folder"], job["output"]).write_bytes(content)
            answer |= {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest(),
                       "instruction_set": "AVX", "labelled": tally.record()}
        future.set_result(answer)
        return future


@pytest.fixture
def place(tmp_path, monkeypatch):
    (tmp_path / "scene.xml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    monkeypatch.setattr(execute, "Local", lambda *_: Pool())
    return tmp_path


def expected(**numbers):
    return {"pictures": 12, "empty": 4, "negative": 4, "images": {"mine": 4, "rock": 8},
            "boxes": {"mine": 4, "rock": 12}, **numbers}


def test_pictures_are_counted_however_a_sweep_came_about(place):
    plan = place / "plan.toml"
    assert run(plan, place / "one").labelled.record() == expected()
    for path in ("001.tar", "005.tar"):
        (place / "one" / path).unlink()
    assert run(plan, place / "one").labelled.record() == expected()
    halves = [run(plan, place / "parts", part=Part(number=number, count=2)).labelled for number in (1, 2)]
    assert [half.pictures for half in halves] == [6, 6] and halves[0].boxes["rock"] == 6
    assert merging.merge(plan, [place / "parts"], place / "whole").labelled.record() == expected()
    line = json.loads((place / "whole" / "manifest.jsonl").read_text(encoding="utf-8").splitlines()[2])
    assert line["labelled"] == {"pictures": 1, "empty": 0, "negative": 1, "images": {"rock": 1}, "boxes": {"rock": 2}}
    assert line["balance"] == load_plan(plan).balance


def test_wishes_are_compared_with_what_came_of_them(place):
    outcome, plan = run(place / "plan.toml", place / "one"), load_plan(place / "plan.toml")
    found = {verdict.what: (verdict.got, verdict.met) for verdict in verdicts(plan.balance, outcome.labelled)}
    assert found == {"pictures with mine": (4, False), "pictures with diver": (0, False), "boxes of mine": (4, False),
                     "pictures without objects": (4, True), "pictures of negatives alone": (4, True),
                     "pictures with rock": (8, True)}
    said = [missed_said(verdict, 12, len(plan)) for verdict in verdicts(plan.balance, outcome.labelled)
            if not verdict.met]
    assert said[0] == ("pictures with mine: 4; asked for 6. At this rate a plan of 18 renders would have them, instead "
                       "of 12; or let it draw them more often.")
    assert said[1].startswith("pictures with diver: 0 of 12, 0.0%; asked for 50.0%. More samples do not change")
    assert said[1].endswith("or let the sonar see more of the area where they lie.")           # drawn, but out of range
    assert tally_said(outcome.labelled) == ("12 pictures, 4 without objects, 4 with negatives alone; boxes in "
                                            "pictures: mine 4 in 4, rock 12 in 8")
    half = [verdict.met for verdict in verdicts({"boxes": {"rock": 20}}, outcome.labelled, finished=0.5)]
    assert half == [True]                              # 12 by half of the plan


def test_another_wish_renders_nothing_anew(place):
    run(place / "plan.toml", place / "one")
    (place / "plan.toml").write_text(PLAN.replace("mine = 6", "mine = 7"), encoding="utf-8")
    assert run(place / "plan.toml", place / "one").done == 0
    lines = (place / "one" / "manifest.jsonl").read_text(encoding="utf-8").splitlines()
    run(place / "plan.toml", place / "one")            # writes no line
    assert lines == (place / "one" / "manifest.jsonl").read_text(encoding="utf-8").splitlines() and len(lines) == 13
    assert json.loads(lines[-1])["index"] == 11 and json.loads(lines[-1])["balance"]["images"]["mine"] == 7
    merging.merge(place / "plan.toml", [place / "one"], place / "whole")
    joined = (place / "whole" / "manifest.jsonl").read_text(encoding="utf-8").splitlines()
    assert {json.loads(line)["balance"]["images"]["mine"] for line in joined} == {7}


@pytest.mark.parametrize("wish, said", [
    ("images = { tank = 5 }", r"balance\.images has the class 'tank'; the plan has mine, diver, rock"),
    ("boxes = { mine = 0 }", r"balance\.boxes\.mine is 0; give a whole number of at least 1, or a share below 1"),
    ("boxes = { mine = 1.5 }", r"balance\.boxes\.mine is 1\.5; give a whole"),
    ("boxes = 5", r"balance\.boxes is 5; give"),
    ("empty = true", r"balance\.empty is True; give a number"), ("full = 1", r"balance\.full is unknown"),
    ("empty = 5000000000", r"balance\.empty is 5000000000; give")])
def test_wishes_that_nothing_could_meet_are_refused(place, wish, said):
    (place / "plan.toml").write_text(HEAD + '[draw]\nrays = { integer = [1, 9] }\n[labels]\nnegatives = ["rock"]\n'
                                     f"[balance]\n{wish}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        load_plan(place / "plan.toml")


@pytest.mark.parametrize("rules, said", [
    ('negatives = "rock"', r"labels\.negatives is 'rock'; give a list of classes"),
    ('negatives = ["mine"]', "mine is among the classes and the negatives"),
    ('negative_class = "clutter"', "negatives are to be of the class 'clutter'"),
    ('negatives = ["rock"]\nnegative_class = 5', r"labels\.negative_class is 5; give the name")])
def test_negatives_of_another_kind_are_refused(place, rules, said):
    (place / "plan.toml").write_text(f"{HEAD}\n[draw]\nrays = {{ integer = [1, 9] }}\n[labels]\n{rules}\n",
                                     encoding="utf-8")
    with pytest.raises(ValueError, match=said):
        load_plan(place / "plan.toml")


def test_images_without_labels_have_no_balance(place):
    (place / "plan.toml").write_text('scene = "scene.xml"\n[balance]\nempty = 1\n', encoding="utf-8")
    with pytest.raises(ValueError, match="counts labelled pictures, and output does not name samples"):
        load_plan(place / "plan.toml")


@pytest.mark.parametrize("lie", [5, {}, {"pictures": 1}, {**expected(), "empty": -1}, {**expected(), "images": []},
                                 {**expected(), "boxes": {"a": "b"}}, {**expected(), "negative": True}])
def test_numbers_that_a_manifest_cannot_have_are_refused(lie):
    with pytest.raises(ValueError, match="are not whole"):
        checked(lie)
    assert checked({**expected(), "more": 1}) == expected()
