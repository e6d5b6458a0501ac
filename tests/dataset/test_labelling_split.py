"""Subsets share no seabed, whatever the images are; sweeps are read from manifests in any state."""
import json
from collections import Counter

import pytest
from hypothesis import given, settings, strategies as st
from labelled_sidescan import labelled

from mitsonar.dataset import open as open_images
from mitsonar.dataset.labels import Labels, deal, find_sources, read_shares, write
from mitsonar.io.records import exr

SHARES = st.dictionaries(st.sampled_from(("train", "val", "test")), st.integers(1, 20), min_size=1).map(
    lambda parts: {name: part / sum(parts.values()) for name, part in parts.items()})


@settings(max_examples=300, deadline=None)
@given(st.lists(st.text(max_size=2), min_size=1, max_size=60), SHARES, st.integers())
def test_no_seabed_is_in_two_subsets_and_no_subset_is_empty(groups, shares, seed):
    if len(set(groups)) < len(shares):
        with pytest.raises(ValueError, match="cannot be split"):
            deal(groups, shares, seed)
        return
    homes = deal(groups, shares, seed)
    assert len({(group, home) for group, home in zip(groups, homes, strict=True)}) == len(set(groups))
    assert set(homes) == set(shares)
    assert deal(groups, shares, seed) == homes
    # the order in which images come is none of its business
    backwards = deal(groups[::-1], shares, seed)[::-1]
    assert backwards == homes


def test_shares_are_kept_as_far_as_groups_allow():
    groups = [str(number // 5) for number in range(1000)]
    shares = {"train": 0.8, "val": 0.1, "test": 0.1}
    assert Counter(deal(groups, shares)) == {"train": 800, "val": 100, "test": 100}
    assert deal(groups, shares) != deal(groups, shares, seed=1)


@settings(max_examples=200, deadline=None)
@given(st.text("trainvles=,.0189 -:", max_size=30))
def test_text_is_shares_or_one_sentence(text):
    try:
        assert sum(read_shares(text).values()) == pytest.approx(1)
    except ValueError as error:
        assert "split" in str(error) and "\n" not in str(error)


def sweep(folder, lines, images=("a", "b", "c", "d")):
    """A finished sweep: images a and b of one seabed, c and d of another, and a manifest of these lines."""
    for name in images:
        folder.joinpath(f"{name}.exr").parent.mkdir(parents=True, exist_ok=True)
        exr.write(labelled(12, 60, seabed="one" if name in "ab" else "two", rectangles=[],
                           parameters={"range": 30 + ord(name)}), folder / f"{name}.exr")
    text = "".join(line if isinstance(line, str) else json.dumps(line) + "\n" for line in lines)
    (folder / "manifest.jsonl").write_text(text, encoding="utf-8")
    return folder


def done(name, status="ok"):
    return {"output": f"{name}.exr", "status": status, "parameters": {}, "seed": 1, "inputs": "", "versions": {},
            "seconds": 1.0, "bytes": 1, "index": 0}


def test_finished_images_of_a_sweep_are_taken(tmp_path):
    lines = [done("b"), done("a", "failed"), done("c"), done("a"), done("d", "failed")]
    folder = sweep(tmp_path / "s", ["{damaged\n", *lines, '{"outp'])
    assert [source.name for source in find_sources(folder)] == ["a", "b", "c"]
    assert [source.seabed for source in find_sources([folder])] == ["one", "one", "two"]
    # what a second sweep calls the same gets its folder's name
    other = sweep(tmp_path / "t", [done("a")])
    assert [source.name for source in find_sources([folder, other])] == ["s_a", "b", "c", "t_a"]


def test_a_plan_s_classes_number_those_of_every_batch(tmp_path):
    """Alone, an image without a wreck would number the box 1; the plan's order holds whatever the images hold."""
    order = {"classes": ["wreck", "tyre", "box"]}
    folder = sweep(tmp_path / "s", [{**done("a"), **order}])
    write(folder, tmp_path / "out", Labels(coco=True))
    told = json.loads((tmp_path / "out/annotations.json").read_text())["categories"]
    assert [entry["name"] for entry in told][:3] == ["wreck", "tyre", "box"]
    other = sweep(tmp_path / "t", [{**done("a"), "classes": ["box", "wreck"]}])
    with pytest.raises(ValueError, match="number classes in different ways"):
        write([folder, other], tmp_path / "both", Labels(coco=True))
    short = sweep(tmp_path / "u", [{**done("a"), "classes": ["box"]}])
    with pytest.raises(ValueError, match=r"wreck, which the classes of their plan \(box\) lack"):
        write(short, tmp_path / "lacks", Labels(coco=True))


@pytest.mark.parametrize("lines, words", [
    ([done("e")], "e.exr, which is not there"), ([done("../e")], "outside its folder"),
    ([done("a", "failed")], "no finished image"), ([], "no finished image")])
def test_a_manifest_that_cannot_be_trusted_is_refused(tmp_path, lines, words):
    with pytest.raises((ValueError, FileNotFoundError), match=words):
        find_sources(sweep(tmp_path / "s", lines, images="ab"))


def test_the_split_on_disk_holds_for_every_format(tmp_path):
    folder = sweep(tmp_path / "s", [done(name) for name in "abcd"])
    write(folder, tmp_path / "out", Labels(coco=True, yolo="boxes", split={"train": 0.5, "val": 0.5}))
    split = json.loads((tmp_path / "out/split.json").read_text())
    assert sorted(map(tuple, split["images"].values())) == [("a.png", "b.png"), ("c.png", "d.png")]
    assert sorted(map(tuple, split["groups"].values())) == [("one",), ("two",)]
    for subset, names in split["images"].items():
        told = json.loads((tmp_path / f"out/annotations_{subset}.json").read_text())
        assert [image["file_name"] for image in told["images"]] == names
        assert (tmp_path / f"out/{subset}.txt").read_text().split() == [f"./images/{name}" for name in names]
    write(folder, tmp_path / "by", Labels(coco=True, split={"train": 0.25, "val": 0.75}, split_by="range"))
    assert len(json.loads((tmp_path / "by/split.json").read_text())["images"]["val"]) == 3


def test_the_split_of_a_plan_is_taken_where_images_have_one(tmp_path):
    homes = {"a": "val", "b": "val", "c": "train", "d": "train"}
    folder = sweep(tmp_path / "s", [{**done(name), "split": home} for name, home in homes.items()])
    write(folder, tmp_path / "out", Labels(coco=True, yolo="boxes"))
    split = json.loads((tmp_path / "out/split.json").read_text())
    assert (split["by"], split["shares"]) == ("plan", {"train": 0.5, "val": 0.5})
    assert split["images"] == {"train": ["c.png", "d.png"], "val": ["a.png", "b.png"]}
    assert split["groups"] == {"train": ["two"], "val": ["one"]}
    assert sorted(path.name for path in (tmp_path / "out").glob("annotations*")) == ["annotations_train.json",
                                                                                   "annotations_val.json"]
    subsets = open_images(folder).split()
    assert {name: list(subset.names) for name, subset in subsets.items()} == {"train": ["c", "d"], "val": ["a", "b"]}
    own = open_images(folder).split("train=0.5,test=0.5")                  # one's own shares come first
    assert set(own) == {"train", "test"}


def test_images_of_which_only_some_have_a_planned_subset_are_refused(tmp_path):
    folder = sweep(tmp_path / "s", [done("a"), {**done("b"), "split": "val"}, done("c"), done("d")])
    with pytest.raises(ValueError, match="1 of 4 images have a subset from the split of their plan"):
        write(folder, tmp_path / "out", Labels(coco=True))
    with pytest.raises(ValueError, match="has no \\[split\\]; give shares"):
        open_images(sweep(tmp_path / "t", [done("a")])).split()
    strange = sweep(tmp_path / "u", [done("a"), {**done("b"), "split": "../x"}])
    assert [source.name for source in find_sources(strange)] == ["a"]      # a damaged line


def test_a_seabed_in_two_planned_subsets_is_told(tmp_path):
    folder = sweep(tmp_path / "s", [{**done("a"), "split": "val"}, {**done("b"), "split": "train"}])
    with pytest.warns(UserWarning, match="1 seabed is in several subsets of the plan; let group"):
        open_images(folder).split()
