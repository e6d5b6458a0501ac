"""Labels and data sets of focused images: the way up, masks, places on the map, complex channels."""
import json

import numpy as np
import pytest
from focused_image import focused_image
from labelled_focus import RECTANGLES, labelled_focus
from PIL import Image

import mitsonar
from mitsonar.cli.main import main as cli
from mitsonar.dataset.labels import Labels, write
from mitsonar.imaging.objects import object_bins
from mitsonar.io import reading
from mitsonar.io.records import exr
from mitsonar.labels.annotations import annotations
from mitsonar.labels.frames import frames

ROWS, COLUMNS = 50, 90


def written(image, folder, *, name="a.exr", **rules):
    """Pictures and COCO's file of an image."""
    reading.write(image, folder / name)
    write(folder / name, folder / "out", Labels(coco=True, masks=True, **rules))
    return json.loads((folder / "out/annotations.json").read_text())


def masks_of(folder, name):
    return {kind: np.array(Image.open(folder / f"out/masks/{kind}/{name}.png"))
            for kind in ("instance", "class", "shadow", "bed_shadow")}


@pytest.mark.parametrize("port", [False, True])
def test_the_farthest_ahead_is_on_top_and_the_track_s_side_is_that_of_the_near_columns(tmp_path, port):
    told = written(labelled_focus(port=port), tmp_path)
    image, = told["images"]
    assert (image["height"], image["width"], image["file_name"]) == (ROWS, COLUMNS, "a.png")
    boxes = {(each["instance"], each["category_id"]): each["bbox"] for each in told["annotations"]}
    for kind, name, first, last, near, far in RECTANGLES:
        category = ["box", "wreck"].index(name.partition(".")[0]) + 1 + 2 * (kind == "shadow")
        left = COLUMNS - far if port else near
        assert boxes[name, category] == [left, ROWS - last, far - near, last - first]
    masks, picture = masks_of(tmp_path, "a"), np.array(Image.open(tmp_path / "out/images/a.png"))
    assert picture[masks["instance"] > 0].mean() > 2 * picture[masks["shadow"] > 0].mean()
    assert set(np.unique(masks["instance"])) == {0, 2, 3} == set(np.unique(masks["shadow"]))
    cut = {each["instance"]: each["truncated"] for each in told["annotations"] if each["category_id"] > 2}
    assert cut == {"box.1": False, "wreck": True}                              # by the far end
    assert image["grey"] == "level [dB re 1 m²]"


def test_the_near_end_of_a_grid_cuts_too():
    image = labelled_focus(rectangles=[("highlight", "box.1", 10, 16, 0, 6), ("highlight", "wreck", 20, 26, 10, 16)])
    found = annotations(image, frames(image))[0]
    assert [each.truncated for each in found] == [True, False]


@pytest.mark.parametrize("port", [False, True])
@pytest.mark.parametrize("heading", [0.3, -2.0])
def test_a_tile_says_where_its_points_lie(tmp_path, heading, port):
    """The point in the middle of an element, by the six numbers, is the record's own to a nanometre of rounding."""
    record = labelled_focus(heading=heading, port=port, local_origin=[500000.0, 6000000.0], crs="EPSG:32632")
    frame, = frames(record)
    x, y, along, across = (frame.lay(values) for values in (
        record["x"].values, record["y"].values, *np.broadcast_arrays(record["along_track"].values[:, None],
                                                                     record["across_track"].values)))
    told = written(record, tmp_path, tile=(20, 40), overlap=0.25)
    assert len(told["images"]) == 9
    for image in told["images"]:
        row, column = np.mgrid[:image["height"], :image["width"]] + 0.5
        own = np.s_[image["row"]:image["row"] + image["height"], image["column"]:image["column"] + image["width"]]
        assert np.allclose(image["x"] + row * image["x_row"] + column * image["x_column"], x[own], rtol=0, atol=1e-6)
        assert np.allclose(image["y"] + row * image["y_row"] + column * image["y_column"], y[own], rtol=0, atol=1e-6)
        assert np.allclose(image["left"] + column * image["cell_x"], across[own], rtol=0, atol=1e-6)
        assert np.allclose(image["top"] + row * image["cell_y"], along[own], rtol=0, atol=1e-6)
        assert (image["crs"], image["local_origin"]) == ("EPSG:32632", [500000.0, 6000000.0])
    assert x[0, -1] != x[-1, 0] and np.diff(along[:, 0]).max() < 0 < np.diff(across[0]).min()


def test_columns_of_other_programs_are_turned_to_starboard_and_uneven_points_have_no_place(tmp_path):
    record = labelled_focus()
    frame, = frames(record)
    turned, = frames(record.isel(across_track=slice(None, None, -1), along_track=slice(None, None, -1)))
    level = record["level"].values
    np.testing.assert_array_equal(turned.lay(level[:, ::-1, ::-1]), frame.lay(level))
    assert turned.metres(3, 5) == pytest.approx(frame.metres(3, 5)) and turned.parts == frame.parts
    bent = record.assign(x=record["x"] + 0.01 * (record["across_track"] - 10) ** 2)
    assert set(frames(bent)[0].metres(0, 0)) == {"cell_x", "cell_y", "left", "top"}


def test_the_dark_side_of_an_object_is_shadow_and_what_no_ping_sees_is_the_bed_s():
    """In the shadow only the object echoes, 26 dB below the bed: no highlight, whatever its share."""
    image = labelled_focus()
    image["share"].values[:, 10:16, 40:44] = (np.arange(3) == 1)[:, None, None]
    box = next(object_bins(image, smallest=4))
    expected = np.zeros((ROWS, COLUMNS), bool)
    expected[10:16, 30:36] = True
    np.testing.assert_array_equal(box.highlight, expected)
    assert box.shadow[10:16, 36:50].all() and box.shadow.sum() == 6 * 14


def test_side_lobes_in_the_lee_of_a_ripple_are_no_highlight():
    """No ping sees the lee: what shares say there is of side lobes, and label and shadow say that nothing is seen."""
    image = labelled_focus(rectangles=[])
    lee = np.s_[5:15, 20:30]
    image["share"].values[(slice(None), *lee)] = (np.arange(3) == 1)[:, None, None]
    assert next(object_bins(image)).highlight.sum() == 100
    image["label"].values[lee], image["class"].values[lee], image["shadow"].values[lee] = 0, 0, 1
    assert not next(object_bins(image)).highlight.any()


def test_shadows_of_the_bed_have_a_mask(tmp_path):
    image = labelled_focus()
    image["shadow"].values[2:6, 5:20] = 1
    written(image, tmp_path)
    lees = masks_of(tmp_path, "a")["bed_shadow"]
    expected = np.zeros((ROWS, COLUMNS), np.uint16)
    expected[ROWS - 6:ROWS - 2, 5:20] = 1
    np.testing.assert_array_equal(lees, expected)


def test_round_a_circle_a_highlight_is_the_label_s_and_there_are_no_shadows(tmp_path):
    image = labelled_focus().drop_vars(["share", "object_shadow", "hidden", "layover", "shape"])
    image["shadow"].values[2:6, 5:20] = 0.7
    told = written(image, tmp_path)
    assert [(each["instance"], each["category_id"]) for each in told["annotations"]] == [("box.1", 1), ("wreck", 2)]
    masks = masks_of(tmp_path, "a")
    np.testing.assert_array_equal(masks["instance"], np.where(image["label"] > 1, image["label"], 0)[::-1])
    assert masks["bed_shadow"].sum() == 4 * 15


def test_netcdf_and_exr_make_the_same_labels(tmp_path, capsys):
    image = labelled_focus()
    for name in ("a.exr", "b.nc"):
        reading.write(image, tmp_path / name)
    places = [str(tmp_path / name) for name in ("a.exr", "b.nc")]
    assert cli(["labels", *places, "-o", str(tmp_path / "out"), "--yolo", "--masks", "--window=-60,-10"]) == 0
    assert "2 pictures, 4 highlights, 4 shadows" in capsys.readouterr().err
    for kind, end in (("images", "png"), ("labels", "txt"), ("masks/instance", "png"), ("masks/shadow", "png")):
        one, other = ((tmp_path / "out" / kind / f"{name}.{end}").read_bytes() for name in "ab")
        assert one == other and one


@pytest.mark.parametrize("more, words", [
    (["--cartesian"], "a.exr has no Cartesian pictures: a focused image has no fans"),
    (["--tvg", "target"], "the gain 'target' applies to echoes")])
def test_what_does_not_fit_a_focused_image_is_told_in_a_sentence(tmp_path, more, words, capsys):
    reading.write(labelled_focus(), tmp_path / "a.exr")
    assert cli(["labels", str(tmp_path / "a.exr"), "--coco", "-o", str(tmp_path / "out"), *more]) == 2
    assert words in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_what_was_focused_of_raw_echoes_alone_has_no_labels(tmp_path, capsys):
    reading.write(focused_image().drop_vars("label"), tmp_path / "a.exr")
    assert cli(["labels", str(tmp_path / "a.exr"), "--coco", "-o", str(tmp_path / "out")]) == 2
    assert "has no label, no attribute objects" in capsys.readouterr().err


def test_raster_refuses_a_focused_image(tmp_path, capsys):
    reading.write(labelled_focus(), tmp_path / "a.exr")
    assert cli(["raster", str(tmp_path / "a.exr"), "-o", str(tmp_path / "b.exr")]) == 2
    assert "a focused image has no fans: its points already form a grid in metres" in capsys.readouterr().err


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("focused")
    for number in range(4):
        image = labelled_focus(seabed="aabb"[number], seed=number, parameters={"pings": str(number)})
        image = image.assign_coords(across_track=image["across_track"] + 0.001 * number)
        exr.write(image, folder / f"i{number}.exr") if number else reading.write(image, folder / "i0.nc")
    return sorted(folder.iterdir())


def test_focused_images_stack_and_split(files):
    images = mitsonar.dataset.open(files)
    assert list(images.names) == ["i0", "i1", "i2", "i3"] and images.object_classes == ("box", "wreck")
    stacked = images.stack(["image", "label", "across_track"])
    assert stacked["image"].shape == (4, 2, ROWS, COLUMNS) and stacked["image"].dtype == np.complex64
    whole = images.xarray()
    assert {"complex_image", "level", "label", "class", "x", "object_shadow"} <= set(whole.data_vars)
    assert "share" not in whole
    np.testing.assert_array_equal(whole["complex_image"].values, stacked["image"])
    assert whole["across_track_distance"].dims == ("image", "across_track")
    np.testing.assert_array_equal(whole["across_track_distance"].values, stacked["across_track"])
    subsets = images.split("train=0.5,val=0.5")
    assert sorted(tuple(part.names) for part in subsets.values()) == [("i0", "i1"), ("i2", "i3")]
    with pytest.raises(ValueError, match="i0.nc has no frames: a focused image"):
        mitsonar.dataset.open(files, form="cartesian")


def test_networks_get_real_and_imaginary_parts_of_every_bank_the_way_up_of_the_pictures(files, torch):
    images = mitsonar.dataset.open(files)
    parts, classes = images.torch(image="image")[1]
    record = images[1]
    expected = record["image"].values[:, ::-1]
    assert parts.dtype == np.float32 and parts.shape == (4, ROWS, COLUMNS)
    np.testing.assert_array_equal(parts, [expected[0].real, expected[0].imag, expected[1].real, expected[1].imag])
    assert classes.shape == (1, ROWS, COLUMNS)
    np.testing.assert_array_equal(classes[0], record["class"].values[::-1])
    level, target = images.torch(target="boxes")[0]
    np.testing.assert_array_equal(level, images[0]["level"].values[:, ::-1])
    assert target["boxes"].tolist() == [[30, 34, 36, 40], [60, 10, 75, 22]] and target["labels"].tolist() == [1, 2]
    silent = record.assign(level=record["level"].where(record["label"] != 2, -np.inf))
    pairs = images.torch(target=None)
    pairs.images = type("Own", (), {"__len__": lambda self: 1, "sources": images.sources,
                                    "pictures": lambda self, number: (silent, frames(silent))})()
    assert pairs[0].min() == -200
