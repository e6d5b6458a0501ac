"""Labelled pictures are read as they were written, by mitsonar and in the forms of public sets."""
import json

import numpy as np
import pytest
from labelled_sidescan import labelled
from PIL import Image

from mitsonar.dataset.labels import Labels, read, write
from mitsonar.io.records import exr


@pytest.fixture
def folder(tmp_path):
    """Two pictures of 20 x 30, the second without labels."""
    (tmp_path / "set" / "images").mkdir(parents=True)
    for name in ("a", "b"):
        Image.fromarray(np.full((20, 30), 7, np.uint8)).save(tmp_path / "set" / "images" / f"{name}.png")
    return tmp_path / "set"


def text(folder, words, place="labels/a.txt"):
    (folder / place).parent.mkdir(exist_ok=True)
    (folder / place).write_text(words)


def box(shape=(20, 30), rows=slice(5, 10), columns=slice(6, 15), number=1):
    expected = np.zeros(shape, int)
    expected[rows, columns] = number
    return expected


def test_boxes_of_yolo_are_where_they_were_drawn(folder):
    text(folder, "3 0.35 0.375 0.3 0.25\n\n")
    first, second = read(folder)
    assert first.classes == ("3",) and second.classes == () and not second.number.any()
    assert (first.number == box()).all() and first.grey.dtype == np.float32 and (first.grey == 7).all()


@pytest.mark.parametrize("place", ["images/a.txt", "images/labels/a.txt"])
def test_texts_may_stand_beside_the_pictures(folder, place):
    text(folder, "0 0.2 0.25 0.5 0.25 0.5 0.5 0.2 0.5", place)
    assert (read(folder)[0].number == box()).all()


def test_smaller_labels_lie_on_top(folder):
    text(folder, "0 0.35 0.375 0.3 0.25\n1 0.5 0.5 1 1")
    number = read(folder)[0].number
    assert (number == np.where(box(), 1, 2)).all()


def test_masks_have_an_object_for_each_patch(folder):
    mask = (box() | box(rows=slice(15, 20), columns=slice(0, 3))).astype(np.uint8) * 255
    (folder / "masks").mkdir()
    Image.fromarray(mask).save(folder / "masks" / "a.png")
    first, second = read(folder)
    assert (first.number == box() + box(rows=slice(15, 20), columns=slice(0, 3), number=2)).all()
    assert len(first.classes) == 2 and not second.number.any()


def test_boxes_of_coco_are_where_they_were_drawn(folder):
    document = {"images": [{"id": 4, "file_name": "images/a.png"}], "categories": [{"id": 2, "name": "tyre"}],
                "annotations": [{"image_id": 4, "category_id": 2, "bbox": [6, 5, 9, 5]}]}
    (folder / "annotations.json").write_text(json.dumps(document))
    first, _ = read(folder)
    assert first.classes == ("tyre",) and (first.number == box()).all()


@pytest.mark.parametrize("outputs", [{"coco": True}, {"yolo": "polygons"}])
def test_what_was_written_is_read_again(tmp_path, outputs):
    """The labels fill the same elements as the masks, which are written from the bins themselves."""
    exr.write(labelled(), tmp_path / "record.exr")
    write([tmp_path / "record.exr"], tmp_path / "set", Labels(masks=True, **outputs))
    (picture,) = read(tmp_path / "set")
    instance, shadow = (np.asarray(Image.open(next((tmp_path / "set" / "masks" / kind).iterdir())))
                        for kind in ("instance", "shadow"))
    assert ((picture.number > 0) == ((instance > 0) | (shadow > 0))).all()
    assert len(picture.classes) == len(np.unique(picture.number)) - 1 > 2


@pytest.mark.parametrize(("words", "said"), [("0 0.5 0.5", "four numbers"), ("0 a b c d", "four numbers"),
                                             (None, "no labels")])
def test_labels_that_cannot_be_read_are_refused(folder, words, said):
    if words:
        text(folder, words)
    with pytest.raises(ValueError, match=said):
        read(folder)


def test_a_folder_must_hold_pictures(tmp_path):
    with pytest.raises(FileNotFoundError, match="no folder"):
        read(tmp_path / "none")
    with pytest.raises(ValueError, match="no pictures"):
        read(tmp_path)
