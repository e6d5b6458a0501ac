"""Frames of fans and rotating heads as images of a data set, as recorded or in metres."""
import pickle

import numpy as np
import pytest
from labelled_sidescan import labelled
from synthetic_fan import BOXES, fan, head

import mitsonar
from mitsonar.io.records import exr


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A record of three pings and one of one, of two seabeds."""
    folder = tmp_path_factory.mktemp("fans")
    for name, pings, seed in (("a", 3, 1), ("b", 1, 2)):
        exr.write(fan(pings=pings, beams=128, bins=300, seed=seed), folder / f"{name}.exr")
    return [folder / "a.exr", folder / "b.exr"]


def test_every_frame_is_an_image(files):
    images = mitsonar.dataset.open(files, form="polar")
    assert images.names.tolist() == ["a_frame0000", "a_frame0001", "a_frame0002", "b"] and len(images) == 4
    whole = exr.read(files[0])
    assert images[1].identical(whole.isel(ping=slice(1, 2))) and images[3].sizes["ping"] == 1
    assert images.stack("level")["level"].shape == (4, 1, 128, 300)
    assert sorted(len(subset) for subset in images.split("train=0.5,val=0.5").values()) == [1, 3]


def test_frames_in_metres_are_those_of_cartesian(files):
    images = mitsonar.dataset.open(files, form="cartesian", cell=0.1)
    assert images[2].identical(mitsonar.imaging.cartesian(exr.read(files[0]), 0.1).isel(ping=slice(2, 3)))
    whole = images[1:].xarray(["level", "label"])
    assert whole["level"].dims == ("image", "ping", "y", "x") and whole.sizes["image"] == 3
    assert np.array_equal(whole["level"][1].values, images[2]["level"].values, equal_nan=True)
    assert images[1:3].form == "cartesian" and pickle.loads(pickle.dumps(images))[0].identical(images[0])


def test_a_turn_of_a_head_is_an_image(tmp_path):
    exr.write(head(turns=2, steps=90, bins=100), tmp_path / "head.exr")
    images = mitsonar.dataset.open(tmp_path / "head.exr", form="polar")
    assert len(images) == 2 and images[1].sizes["ping"] == 90 and (images[1]["turn"] == 1).all()


def test_pytorch_gets_frames_with_boxes(files, torch):
    pairs = mitsonar.dataset.open(files, form="cartesian", cell=0.1).torch(target="boxes")
    picture, target = pairs[2]
    drawn = mitsonar.dataset.open(files, form="cartesian", cell=0.1)[2]
    assert picture.shape == drawn["level"].shape and picture.dtype == np.float32 and picture.min() == -200
    inside = np.isfinite(drawn["level"].values)
    assert (picture[inside] == drawn["level"].values[inside]).all() and (picture[~inside] == -200).all()
    assert target["masks"].shape == (2, *picture.shape[1:]) and target["labels"].tolist() == [1, 1]
    for (left, upper, right, lower), (x, y, size) in zip(target["boxes"], BOXES.values(), strict=True):
        edges = drawn["x"].values[0] + 0.1 * (np.array([left, right]) - 0.5), (
            drawn["y"].values[0] - 0.1 * (np.array([upper, lower]) - 0.5))
        # the third ping is 1 m on; beams are 0.15 m apart
        assert edges[0] == pytest.approx([x - size / 2, x + size / 2], abs=0.2)
        assert edges[1] == pytest.approx([y - 1 + size / 2, y - 1 - size / 2], abs=0.2)
    classes = mitsonar.dataset.open(files, form="cartesian", cell=0.1).torch()[0][1]
    assert classes.dtype == np.int64 and set(np.unique(classes)) == {0, 1, 2}
    hidden = mitsonar.dataset.open(files, form="cartesian", cell=0.1).torch(target="hidden")[0][1]
    assert not hidden[~inside].any()
    given = mitsonar.dataset.open(files, form="cartesian", cell=0.1).torch(
        image=lambda image: image["level"].dims, target=lambda image: image.sizes["ping"])[0]
    assert given == (("ping", "y", "x"), 1)


def test_whole_records_keep_a_channel_for_each_ping(files, torch):
    pairs = mitsonar.dataset.open(files).torch()
    assert [pairs[number][0].shape for number in range(2)] == [(3, 300, 128), (1, 300, 128)]
    with pytest.raises(ValueError, match='3 pictures.*open it with form="polar" or "cartesian"'):
        mitsonar.dataset.open(files).torch(target="boxes")[0]


def test_what_has_no_frames_is_refused(files, tmp_path):
    exr.write(labelled(), tmp_path / "side.exr")
    with pytest.raises(ValueError, match="side.exr has no frames: the levels are over ping, side, range"):
        mitsonar.dataset.open(tmp_path / "side.exr", form="polar")
    with pytest.raises(ValueError, match="'square'; choose polar, cartesian or None"):
        mitsonar.dataset.open(files, form="square")
    with pytest.raises(ValueError, match="ask for these, or leave it out"):
        mitsonar.dataset.open(files, form="polar", cell=0.1)


def test_an_outline_has_all_but_the_pixels(files):
    outline, whole = exr.outline(files[0]), exr.read(files[0])
    assert outline.sizes["ping"] == 3 and outline.attrs == whole.attrs and set(outline.data_vars) == {"level"}
    assert all(outline[name].identical(whole[name]) for name in whole.coords)
    assert outline["level"].dims == whole["level"].dims
