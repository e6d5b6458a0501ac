"""A sweep as data: by number, stacked, lazily as one dataset, split, and for a PyTorch that is here a few lines."""
import pickle
import sys

import numpy as np
import pytest
from labelled_sidescan import labelled

import mitsonar
from mitsonar.io.records import exr
from mitsonar.labels.frames import frames


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Four images of two seabeds; the last has other classes."""
    folder = tmp_path_factory.mktemp("images")
    for number in range(4):
        other = {"objects": {"seabed": "seabed", "anchor": "anchor"}, "rectangles": []} if number == 3 else {}
        image = labelled(seabed="aabb"[number], parameters={"range": str(30 + number), "preset": "towed"}, **other)
        image.attrs["seed"] = number
        image["level"][:] += number
        exr.write(image, folder / f"i{number}.exr")
    return sorted(folder.glob("*.exr"))


def test_images_by_number_with_what_is_known_of_them(files):
    images = mitsonar.dataset.open(files)
    assert len(images) == 4 and list(images.names) == ["i0", "i1", "i2", "i3"]
    assert images[2].identical(exr.read(files[2])) and images[-1].identical(exr.read(files[3]))
    assert images.parameters["range"].tolist() == [30, 31, 32, 33]
    assert images.parameters["preset"].tolist() == ["towed"] * 4
    assert images.seeds.tolist() == [0, 1, 2, 3] and images.seabeds.tolist() == list("aabb")
    assert images.classes == ("anchor", "box", "seabed", "wreck")
    assert images.object_classes == ("anchor", "box", "wreck")
    assert list(images[1:3].names) == ["i1", "i2"] and len(list(images)) == 4
    with pytest.raises(IndexError):
        images[4]


def test_stacked_in_memory_and_lazily_they_are_the_same(files):
    images = mitsonar.dataset.open(files)
    stacked = images.stack(["level", "label", "x"])
    assert stacked["level"].shape == (4, 60, 2, 100) and stacked["label"].dtype == np.uint32
    whole = images.xarray()
    assert whole["level"].dims == ("image", "ping", "side", "range") and "share" not in whole
    assert (whole["level"].values == stacked["level"]).all() and (whole["x"].values == stacked["x"]).all()
    assert whole["parameter_range"].values.tolist() == [30, 31, 32, 33]
    assert whole["slant_range"].dims == ("image", "range") and list(whole["side"].values) == ["port", "starboard"]
    with pytest.raises(ValueError, match="has no variable depht; it has level"):
        images.stack("depht")


def test_without_dask_a_lazy_stack_names_the_extra(files, monkeypatch):
    monkeypatch.setitem(sys.modules, "dask.array", None)
    with pytest.raises(ValueError, match=r"is not installed; run pip install 'mitsonar\[cluster\]'"):
        mitsonar.dataset.open(files).xarray()


def test_what_differs_in_shape_is_not_stacked(files, tmp_path):
    exr.write(labelled(pings=50), tmp_path / "short.exr")
    images = mitsonar.dataset.open([*files, tmp_path / "short.exr"])
    with pytest.raises(ValueError, match=r"short.exr has the shape \(50, 2, 100\), not \(60, 2, 100\)"):
        images.stack()
    with pytest.raises(ValueError, match="has the shape"):
        images.xarray(["level"]).load()


def test_subsets_share_no_seabed_and_keep_the_classes(files):
    subsets = mitsonar.dataset.open(files).split({"train": 0.5, "val": 0.5}, seed=3)
    assert sorted(map(tuple, (subset.names for subset in subsets.values()))) == [("i0", "i1"), ("i2", "i3")]
    assert {subset.classes for subset in subsets.values()} == {("anchor", "box", "seabed", "wreck")}
    with pytest.raises(ValueError, match="2 different seabeds"):
        mitsonar.dataset.open(files).split("train=0.4,val=0.3,test=0.3")


def test_without_pytorch_one_sentence(files, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "mitsonar.dataset.torch_images", raising=False)
    with pytest.raises(ImportError, match="PyTorch is not installed here; run pip install 'mitsonar.torch.', or use"):
        mitsonar.dataset.open(files).torch()


def test_pytorch_gets_pictures_with_classes_of_the_whole_set(files, torch):
    images = mitsonar.dataset.open(files)
    pairs = images.torch()
    assert isinstance(pairs, torch.utils.data.Dataset) and len(pairs) == 4
    picture, classes = pairs[0]
    assert picture.dtype == np.float32 and picture.shape == (1, 60, 200) and classes.dtype == np.int64
    frame, = frames(images[0])
    assert (picture[0] == frame.lay(images[0]["level"].values)).all()
    # by the classes of all images: anchor 1, box 2, seabed 3, wreck 4
    assert classes[0, 39, 140] == 2 and classes[0, 49, 29] == 4 and classes[0, 0, 150] == 3 and classes[0, 0, 100] == 0
    assert pairs[3][1].max() == 3
    alone = images.torch(target=None, image="mean_level", transform=np.negative)[0]
    assert (alone[0] == -frame.lay(images[0]["mean_level"].values)).all()
    own = images.torch(image=lambda image: 1, target=lambda image: image.attrs["seed"], transform=lambda *pair: pair)
    assert own[2] == (1, 2)
    with pytest.raises(ValueError, match="no variable shar over ping, side, range"):
        images.torch(image="shar")[0]


def test_pytorch_gets_boxes_as_torchvision_wants_them(files, torch):
    target = mitsonar.dataset.open(files).torch(target="boxes")[0][1]
    assert target["boxes"].tolist() == [[140, 30, 145, 40], [20, 10, 30, 50]]
    assert target["labels"].tolist() == [2, 3] and target["masks"].shape == (2, 60, 200)
    assert target["masks"].sum((1, 2)).tolist() == [50, 400] and target["image_id"] == 0
    empty = mitsonar.dataset.open(files).torch(target="boxes")[3][1]
    assert empty["boxes"].shape == (0, 4) and empty["masks"].shape == (0, 60, 200)


def test_workers_get_it_pickled(files, torch):
    pairs = mitsonar.dataset.open(files).torch()
    again = pickle.loads(pickle.dumps(pairs))
    assert all((one == other).all() for one, other in zip(pairs[1], again[1], strict=True))
