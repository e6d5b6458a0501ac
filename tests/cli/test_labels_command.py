"""The command `labels`: a folder of training data, whole or not at all, and one sentence about what is wrong."""
import errno
import json
import os
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from labelled_sidescan import labelled
from PIL import Image

from mitsonar.cli import main as cli
from mitsonar.io.records import exr


@pytest.fixture
def images(folder):
    """Two images of one seabed in the current folder."""
    for name in ("a", "b"):
        exr.write(labelled(), folder / f"{name}.exr")
    return folder


def unlabelled(path):
    """An image as versions without labels made it."""
    image = labelled().drop_vars(["share", "object_shadow"])
    del image.attrs["objects"]
    exr.write(image, path)


def test_all_formats_of_one_image_beside_it(images, capfd):
    assert cli.main(["labels", "a.exr", "--coco", "--yolo", "--masks"]) == 0
    said = capfd.readouterr()
    assert said.out == "a_labels\n" and said.err == (
        "mitsonar: val of data.yaml is train.txt: training images cannot validate; split the images "
        "(--split train=0.8,val=0.2).\n1 picture, 2 highlights, 2 shadows\n")
    assert sorted(str(path.relative_to("a_labels")) for path in Path("a_labels").rglob("*.*")) == [
        "annotations.json", "data.yaml", "images/a.png", "labels/a.txt", "masks/bed_shadow/a.png", "masks/class/a.png",
        "masks/classes.json",
        "masks/instance/a.png", "masks/shadow/a.png", "train.txt"]
    assert sorted(os.listdir()) == ["a.exr", "a_labels", "b.exr", "scene.xml"]


def test_empty_tiles_are_left_out_and_counted(images, capfd):
    assert cli.main(["labels", "a.exr", "--coco", "--tile", "20x50", "--drop-empty"]) == 0
    said = capfd.readouterr().err
    kept = len(list(Path("a_labels/images").iterdir()))
    assert 0 < kept < 12 and said.startswith(f"{kept} pictures, ") and f"; {12 - kept} empty picture" in said


def test_the_same_images_give_the_same_bytes(images):
    for output in ("one", "two"):
        (images / output).mkdir()                                              # an empty folder may be there
        assert cli.main(["labels", "a.exr", "b.exr", "-o", output, "--coco", "--yolo=polygons", "--masks",
                         "--tile", "32x64", "--overlap", "0.5", "--window=60,90"]) == 0
    files = [sorted(path for path in Path(output).rglob("*.*")) for output in ("one", "two")]
    assert len(files[0]) > 100 and len(files[0]) == len(files[1])
    assert all(one.read_bytes() == two.read_bytes() for one, two in zip(*files, strict=True))
    image = json.loads(Path("one/annotations.json").read_text())["images"][0]
    assert image["window_db"] == [60, 90] and image["grey"].startswith("level + 30 log R") and image["height"] == 32


def test_classes_are_numbered_as_they_are_given_also_those_that_no_image_has(images):
    assert cli.main(["labels", "a.exr", "--coco", "--yolo", "--classes", "wreck, tyre, box"]) == 0
    document = json.loads(Path("a_labels/annotations.json").read_text())
    names = {each["id"]: each["name"] for each in document["categories"]}
    assert list(names.values()) == ["wreck", "tyre", "box", "wreck shadow", "tyre shadow", "box shadow"]
    assert {each["instance"]: names[each["category_id"]] for each in document["annotations"]
            if each["category_id"] <= 3} == {"box.1": "box", "wreck": "wreck"}
    assert sorted(line[0] for line in Path("a_labels/labels/a.txt").read_text().splitlines()) == ["0", "2", "3", "5"]


@pytest.mark.parametrize("arguments, words", [
    (["a.exr"], "Choose at least one output: --coco, --yolo or --masks."),
    (["a.exr", "--coco", "--threshold", "2"], "the threshold is 2; give a share of at least 0 and below 1"),
    (["a.exr", "--coco", "--threshold", "nan"], "the threshold is nan"),
    (["a.exr", "--coco", "--threshold", "much"], "invalid float value"),
    (["a.exr", "--coco", "--above-noise", "nan"], "nan dB above the noise"),
    (["a.exr", "--coco", "--smallest", "0"], "has 0 bins"),
    (["a.exr", "--coco", "--classes", "box,box"], "the classes are 'box', 'box'; give each name once"),
    (["a.exr", "--coco", "--classes", "box, "], "the classes are 'box', ''; give each name once"),
    (["a.exr", "--coco", "--classes", "box, tyre"], "give all classes, or name those as negatives"),
    (["a.exr", "--coco", "--tile", "512"], "'512' is no size of a tile; give PINGSxBINS"),
    (["a.exr", "--coco", "--tile", "1x1"], "a tile is 1 pings by 1 bins"),
    (["a.exr", "--coco", "--overlap", "0.5"], "but no tiles"),
    (["a.exr", "--coco", "--tile", "32x32", "--overlap", "1"], "from 0 to 0.9"),
    (["a.exr", "--coco", "--window=90,60"], "white above black"),
    (["a.exr", "--coco", "--window=90,inf"], "give two numbers"),
    (["a.exr", "--coco", "--window=dark"], "is no pair of levels"),
    (["a.exr", "--yolo", "stars"], "choose boxes or polygons"),
    (["a.exr", "--coco", "--split", "train=0.8,valid=0.2"], "the split has 'valid=0.2'; give each of train, val, test"),
    (["a.exr", "--coco", "--split", "train=0.8"], "add up to 0.8"),
    (["a.exr", "--coco", "--split", "train=nan"], "a share above 0"),
    (["a.exr", "b.exr", "-o", "out", "--coco", "--split", "train=0.5,val=0.5"], "2 images with 1 different seabed,"),
    (["a.exr", "b.exr", "-o", "out", "--coco", "--split", "train=0.5,val=0.5", "--split-by", "depth"],
     "a.exr has no scene parameter depth; it was given note, pings, speckle"),
    (["a.exr", "--coco", "--split-by", "depth"], "but no split"),
    (["a.exr", "b.exr", "--coco"], "name the folder for their labels by -o"),
    (["a.exr", "./a.exr", "--coco", "-o", "out"], "a.exr is given twice"),
    (["a.exr", "sub/a_b.exr", "sub/a/b.exr", "--coco", "-o", "out"], "there is no such file"),
    (["a.exr", "--coco", "-o", "full"], "the folder full exists and is not empty"),
    (["a.exr", "--coco", "-o", "scene.xml"], "cannot make the folder scene.xml: there is a file of that name"),
    (["a.exr", "--coco", "-o", "no/where"], "does not exist; make it first"),
    (["c.exr", "--coco"], "cannot read c.exr: there is no such file"),
    (["scene.xml", "--coco"], "it is not an OpenEXR file"),
    (["other.exr", "--coco"], "has no attribute mitsonar:config"),
    (["old.exr", "--coco"], "old.exr has no share, no object_shadow, no attribute objects"),
    (["odd.exr", "--coco"], "has levels over ping, elevation, range"),
    (["shady.exr", "--coco"], "the class 'box shadow' would be taken for a shadow"),
    (["0001.tar", "--coco"], "0001.tar is a sample, whose pictures are labelled already; gather samples by"),
    (["empty", "--coco"], "holds no manifest.jsonl, so it is no sweep"),
    (["torn", "--coco"], "no finished image yet"),
])
def test_what_is_wrong_is_said_in_one_sentence(images, refusal, arguments, words):
    for name in ("full/x", "empty", "torn"):
        (images / name).mkdir(parents=True)
    (images / "torn/manifest.jsonl").write_text('{"output": "a.exr", "sta', encoding="utf-8")
    unlabelled(images / "old.exr")
    exr.write(labelled().rename(side="elevation").drop_vars("elevation"), images / "odd.exr")
    exr.write(labelled(objects={"seabed": "seabed", "box shadow": "box shadow"}, rectangles=[]), images / "shady.exr")
    header = {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION}
    OpenEXR.File(header, {"Y": np.zeros((4, 4), np.float32)}).write(str(images / "other.exr"))
    assert words in refusal("labels", *arguments)


@pytest.mark.parametrize("there", [False, True])
def test_a_failure_half_way_leaves_nothing(images, refusal, there):
    unlabelled(images / "old.exr")
    if there:
        (images / "out").mkdir()
    assert "old.exr has no share" in refusal("labels", "a.exr", "old.exr", "-o", "out", "--coco")


def test_a_full_disk_leaves_nothing(images, refusal, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Image.Image, "save", full)
    assert "cannot write" in refusal("labels", "a.exr", "-o", "out", "--coco")


def test_ctrl_c_leaves_nothing(images, monkeypatch, capfd):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(Image.Image, "save", stop)
    assert cli.main(["labels", "a.exr", "--coco"]) == 130
    assert "interrupted" in capfd.readouterr().err and sorted(os.listdir()) == ["a.exr", "b.exr", "scene.xml"]
