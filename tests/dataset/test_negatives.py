"""Negatives, objects that a detector must not find: annotated nowhere or as one class, counted in either case."""
import io
import json
import tarfile

import numpy as np
import pytest
from labelled_sidescan import labelled
from PIL import Image

from mitsonar.dataset.labels.writing import write
from mitsonar.io.records import exr
from mitsonar.labels.rules import Labels
from mitsonar.labels.samples import SampleRules, write_sample

STONES = {"seabed": "seabed", "box.1": "box", "stone.1": "stone", "stone.2": "stone"}
RECTANGLES = [("highlight", "box.1", 1, 20, 30, 40, 45), ("shadow", "box.1", 1, 20, 30, 45, 60),
              ("highlight", "stone.1", 0, 10, 50, 70, 80), ("shadow", "stone.1", 0, 12, 48, 80, 100)]


def record(rectangles=RECTANGLES):
    return labelled(objects=STONES, rectangles=rectangles)


def sample(rectangles=RECTANGLES, **rules):
    """The tally of a sample, the JSON of its picture and its masks of classes and instances."""
    held = io.BytesIO()
    tally = write_sample(record(rectangles), held, "a", SampleRules(labels=Labels(
        masks=True, coco=True, yolo="boxes", classes=["box"], negatives=["stone"], **rules)))
    held.seek(0)
    with tarfile.open(fileobj=held) as tar:
        files = {member.name: tar.extractfile(member).read() for member in tar}
    masks = [np.array(Image.open(io.BytesIO(files[f"a.{kind}.png"]))) for kind in ("class", "instance", "shadow")]
    return tally.record(), json.loads(files["a.json"]), masks, files["a.txt"].decode()


def test_negatives_are_in_no_annotation_and_no_mask_but_counted():
    tally, about, (classes, instances, shadows), yolo = sample()
    assert [entry["category"] for entry in about["annotations"]] == ["box", "box shadow"]
    assert about["counts"] == {"box": 1, "box shadow": 1} and about["negatives"] == {"stone": 1}
    assert set(np.unique(classes)) == {0, 1} and np.unique(instances).size == np.unique(shadows).size == 2
    assert len(yolo.splitlines()) == 2
    assert tally == {"pictures": 1, "empty": 0, "negative": 0, "images": {"box": 1, "stone": 1},
                     "boxes": {"box": 1, "stone": 1}}


def test_negatives_are_a_class_of_their_own():
    tally, about, (classes, _, _), _ = sample(negative_class="clutter")
    assert about["counts"] == {"box": 1, "clutter": 1, "box shadow": 1, "clutter shadow": 1}
    assert about["negatives"] == {"stone": 1} and about["negative_class"] == "clutter"
    assert {entry["instance"]: entry["category_id"] for entry in about["annotations"]
            if "shadow" not in entry["category"]} == {"box.1": 1, "stone.1": 2}
    assert set(np.unique(classes)) == {0, 1, 2}
    assert tally["boxes"] == {"box": 1, "clutter": 1, "stone": 1} and tally["negative"] == 0


@pytest.mark.parametrize("rules", [{}, {"negative_class": "clutter"}, {"drop_empty": True}])
def test_a_picture_of_negatives_alone_is_no_empty_one(rules):
    tally = sample(RECTANGLES[2:], **rules)[0]
    assert (tally["pictures"], tally["empty"], tally["negative"]) == (1, 0, 1)
    assert sample([])[0]["empty"] == 1


def test_labels_of_images_leave_them_out_too(tmp_path):
    exr.write(record(), tmp_path / "a.exr")
    for negative_class, names in ((None, ["box", "box shadow"]),
                                  ("other", ["box", "other", "box shadow", "other shadow"])):
        folder = tmp_path / str(negative_class)
        rules = Labels(coco=True, negatives=["stone"], negative_class=negative_class)
        counts = write(tmp_path / "a.exr", folder, rules)
        document = json.loads((folder / "annotations.json").read_text(encoding="utf-8"))
        assert [category["name"] for category in document["categories"]] == names and counts["negatives"] == 1
        assert len(document["annotations"]) == len(names)
        assert document["info"]["negatives"] == ["stone"]


def test_a_class_that_the_plan_lacks_is_refused_with_both_remedies():
    rules = SampleRules(labels=Labels(masks=True, classes=["box"]))
    with pytest.raises(ValueError, match="stone, which the classes of the plan lack; add them to `classes`, or to "
                                         r"`negatives` under \[labels\]"):
        write_sample(record(), io.BytesIO(), "a", rules)


def test_negatives_are_not_mixed_with_others(tmp_path):
    with pytest.raises(ValueError, match="of the class 'box', which other objects have"):
        sample(negative_class="box")
    exr.write(record(), tmp_path / "a.exr")
    with pytest.raises(ValueError, match="of the class 'box', which other objects have"):
        write(tmp_path / "a.exr", tmp_path / "out", Labels(coco=True, negatives=["stone"], negative_class="box"))
