"""Labels of fans of beams and rotating heads, polar and in metres: boxes and outlines at true places, right way up."""
import json

import numpy as np
import pytest
from labelled_sidescan import labelled
from PIL import Image
from rasterio.features import rasterize
from synthetic_fan import BOXES, fan, head

from mitsonar.cli import main as cli
from mitsonar.dataset.labels import Labels, write
from mitsonar.io.records import exr
from mitsonar.labels.annotations import annotations
from mitsonar.labels.frames import frames
from mitsonar.labels.pictures import greys

CELL = 0.05


def written(record, folder, **rules):
    """Pictures and COCO's entries of a record."""
    exr.write(record, folder / "fan.exr")
    write(folder / "fan.exr", folder / "out", Labels(coco=True, masks=True, **rules))
    return json.loads((folder / "out/annotations.json").read_text())


def in_metres(image, points):
    """Points (n, 2) of a Cartesian picture, x and y [m]."""
    return points * [image["cell_x"], image["cell_y"]] + [image["left"], image["top"]]


@pytest.mark.parametrize("step", ["angle", "sine"])
def test_boxes_lie_at_their_true_places_to_an_element(tmp_path, step):
    told = written(fan(step=step, beams=768, bins=900, pings=2), tmp_path, form="cartesian", cell=CELL)
    assert [image["file_name"] for image in told["images"]] == ["fan_ping0000.png", "fan_ping0001.png"]
    names = {category["id"]: category["name"] for category in told["categories"]}
    highlights = [each for each in told["annotations"] if names[each["category_id"]] == "box"]
    assert [(each["image_id"], each["instance"]) for each in highlights] == [
        (1, "box.1"), (1, "box.2"), (2, "box.1"), (2, "box.2")]
    for each in highlights:
        image = told["images"][each["image_id"] - 1]
        left, upper, width, height = each["bbox"]
        corners = in_metres(image, np.array([[left, upper], [left + width, upper + height]]))
        x, y, size = BOXES[each["instance"]]
        y -= 0.5 * image["ping"]                                               # the second ping is half a metre on
        # beams are 5 cm apart at 20 m, as elements are
        assert corners == pytest.approx(np.array([[x - size / 2, y + size / 2], [x + size / 2, y - size / 2]]),
                                        abs=1.5 * CELL)
        outline = in_metres(image, np.array(each["segmentation"][0]).reshape(-1, 2))
        assert outline.min(0) == pytest.approx(corners.min(0)) and outline.max(0) == pytest.approx(corners.max(0))
        assert not each["truncated"]


def test_pings_of_a_fan_are_a_video_in_which_objects_keep_their_tracks(tmp_path):
    told = written(fan(beams=256, bins=300, pings=3), tmp_path, form="cartesian", cell=CELL)
    assert told["videos"] == [{"id": 1, "name": "fan"}]
    assert [(image["video_id"], image["frame_id"]) for image in told["images"]] == [(1, 0), (1, 1), (1, 2)]
    objects = {}
    for each in told["annotations"]:
        objects.setdefault(each["track_id"], []).append((each["category_id"], each["instance"], each["image_id"]))
    # box.1, box.2 and their shadows: one annotation a frame, always of the same object and category
    assert len(objects) == 4 and all(len({row[:2] for row in rows}) == 1 for rows in objects.values())
    assert all([row[2] for row in rows] == [1, 2, 3] for rows in objects.values())


def test_a_single_ping_is_no_video(tmp_path):
    told = written(fan(beams=256, bins=300), tmp_path)
    assert "videos" not in told and not any("track_id" in each for each in told["annotations"])


def test_a_shadow_lies_behind_its_box_and_masks_and_outlines_say_the_same(tmp_path):
    told = written(fan(), tmp_path, form="cartesian", cell=CELL)
    image, = told["images"]
    picture = np.array(Image.open(tmp_path / "out/images/fan_ping0000.png"))
    instance, shadow = (np.array(Image.open(tmp_path / f"out/masks/{kind}/fan_ping0000.png"))
                        for kind in ("instance", "shadow"))
    assert picture.shape == instance.shape == (image["height"], image["width"])
    for label in (2, 3):
        # rows count from the far end
        (lit, _), (dark, _) = (np.nonzero(mask == label) for mask in (instance, shadow))
        assert dark.mean() < lit.mean() and dark.min() < lit.min()
        assert picture[instance == label].mean() > 2 * picture[shadow == label].mean()
    for each in told["annotations"]:
        ring = [tuple(corner) for corner in np.reshape(each["segmentation"][0], (-1, 2)).tolist()]
        mask = shadow if each["category_id"] > 1 else instance
        filled = rasterize([{"type": "Polygon", "coordinates": [[*ring, ring[0]]]}], out_shape=mask.shape) > 0
        assert ((mask > 0) & filled).sum() == filled.sum() and len(each["segmentation"]) >= 1
    assert (picture[0, 0], picture[-1, 0]) == (0, 0)                           # outside the fan


def test_polar_pictures_have_a_column_per_beam_and_the_far_end_on_top(tmp_path):
    record = fan(pings=2)
    told = written(record, tmp_path)
    assert [(image["width"], image["height"], image["ping"]) for image in told["images"]] == [
        (256, 600, 0), (256, 600, 1)]
    assert "cell_x" not in told["images"][0]
    mask = np.array(Image.open(tmp_path / "out/masks/instance/fan_ping0001.png"))
    expected = record["label"].values[1].T[::-1]
    assert (mask == np.where(expected > 1, expected, 0)).all()


def test_every_turn_of_a_head_is_a_picture_ahead_in_the_middle():
    record = head(turns=2)
    polar, cartesian = frames(record), frames(record, form="cartesian", cell=CELL)
    assert [frame.name for frame in polar] == [frame.name for frame in cartesian] == ["turn0000", "turn0001"]
    assert [frame.ping for frame in polar] == [0, 400] and polar[0].width == 400
    for found in (annotations(record, polar), annotations(record, cartesian)):
        assert [[each.name for each in own if each.kind == "highlight"] for own in found] == [["box.1", "box.2"]] * 2
        assert not any(each.truncated for own in found for each in own if each.kind == "highlight")
    first, second = (annotations(record, polar)[0][which] for which in (0, 2))
    assert first.column + first.mask.shape[1] < 200 < second.column            # port of ahead, starboard of ahead
    x, y, size = BOXES["box.1"]
    seen = annotations(record, cartesian)[1][0]
    corners = in_metres(cartesian[1].metres(0, 0), np.array([[seen.column, seen.row]]))
    assert corners[0] == pytest.approx([x - size / 2, y + size / 2], abs=0.15)       # bearings are 0.14 m apart there


@pytest.mark.parametrize("place, cut", [((0.0, 10.0, 1.0), False), ((0.0, 19.8, 1.0), True), ((8.7, 5.0, 1.0), True),
                                        ((0.0, 2.0, 1.0), True)])
@pytest.mark.parametrize("form", ["polar", "cartesian"])
def test_what_the_fan_s_edge_cuts_is_truncated(place, cut, form):
    record = fan({"box.1": place}, bed=0.0)
    seen, = (each for each in annotations(record, frames(record, form=form))[0] if each.kind == "highlight")
    assert seen.truncated == cut


def test_what_lies_at_the_near_end_is_whole_if_the_record_begins_at_the_sonar():
    record = fan({"box.1": (0.0, 50.0, 1.0)}, near=0.005, far=6.0, bed=0.0)
    record["share"].values[:, :, 100:150, :40] = np.array([0, 1])[:, None, None, None]
    for form in ("polar", "cartesian"):
        seen, = (each for each in annotations(record, frames(record, form=form))[0] if each.kind == "highlight")
        assert not seen.truncated


@pytest.mark.parametrize("form", ["polar", "cartesian"])
def test_noise_before_the_bed_does_not_brighten_the_picture(form):
    # side lobes and noise are heard before the first return, 40 dB below the bed
    far, near = (fan({}, bed=bed).drop_vars("altitude") for bed in (15.0, 3.0))
    windows = [greys(record, frames(record, form=form)).window for record in (far, near)]
    assert windows[0][0] == pytest.approx(windows[1][0], abs=1.0)
    assert windows[0][0] > 60 + 20                                             # of a bed at 100 dB; noise at 60
    drawn = greys(far, frames(far, form=form)).draw(frames(far, form=form)[0])
    bed = drawn[: drawn.shape[0] // 6][:, drawn.shape[1] // 2]
    assert 60 < np.median(bed) < 170


def boxes_of(record):
    """Boxes of highlights (n, 4) in polar pictures."""
    return np.array([each.box for own in annotations(record, frames(record), smallest=8) for each in own
                     if each.kind == "highlight"])


@pytest.mark.parametrize("mean_level", [False, True])
def test_side_lobes_of_an_object_are_no_highlights(mean_level):
    # all around at the box's range, where there is no bed yet, nothing else is heard: 25 dB below the box
    record = fan({"box.1": (0.0, 10.0, 1.0)}, pings=2, mean_level=mean_level, bed=16.0)
    clean = boxes_of(record)
    around = record["label"].values != 2
    around[..., :255], around[..., 262:] = False, False
    record["share"].values[1] += around
    shown = [record[name].values for name in ("level", "mean_level")[:1 + mean_level]]
    for values in shown:
        values[around] += 35                                                   # noise is 60 dB below the box
    # powers of neighbours are averaged where no mean level is known
    assert boxes_of(record) == pytest.approx(clean, abs=0 if mean_level else 2)
    for values in shown:                                                       # as strong as the box: it is part of it
        values[around] += 25
    assert boxes_of(record)[:, 2].min() > 200


@pytest.mark.parametrize("form", ["polar", "cartesian"])
def test_what_is_dark_in_a_shadow_is_no_highlight_where_only_levels_tell(form):
    record = fan({"box.1": (0.0, 10.0, 1.0), "box.2": (5.0, 12.0, 1.0)})
    inside = record["object_shadow"].values[0] == 2
    record["share"].values[:, 0, inside] = np.array([0, 0, 1])[:, None]       # box.2 is all that is heard, 40 dB down
    seen = {(each.name, each.kind): each for each in annotations(record, frames(record, form=form))[0]}
    clean = fan({"box.1": (0.0, 10.0, 1.0), "box.2": (5.0, 12.0, 1.0)})
    assert all(each.box == seen[each.name, each.kind].box for each in annotations(clean, frames(clean, form=form))[0])


def test_a_small_piece_is_kept_where_the_object_is_larger_in_another_ping():
    record = fan({"box.1": (0.0, 10.0, 3.0)}, pings=2)
    record["share"].values[:, 1] = np.array([1, 0])[:, None, None]             # gone, but for 20 bins
    record["share"].values[:, 1, 100:104, 300:305] = np.array([0, 1])[:, None, None]
    found = annotations(record, frames(record), smallest=8)
    assert [each.bins for each in found[1] if each.kind == "highlight"] == [20] and found[0][0].bins > 1000


def test_what_the_bed_hides_is_told_from_what_objects_hide(tmp_path):
    record = fan()
    record["shadow"].values[0, 200:210, 400:450] = 1                           # the lee of a ripple
    written(record, tmp_path)
    bed, shadow = (np.array(Image.open(tmp_path / f"out/masks/{kind}/fan_ping0000.png"))
                   for kind in ("bed_shadow", "shadow"))
    lee = np.zeros((256, 600), bool)
    lee[200:210, 400:450] = True
    assert ((bed > 0) == lee.T[::-1]).all()
    assert ((shadow > 0) == (record["object_shadow"].values[0] > 0).T[::-1]).all()


def test_tiles_of_a_picture_in_metres_know_where_they_are(tmp_path):
    told = written(fan(), tmp_path, form="cartesian", cell=0.1, tile=(64, 64), drop_empty=True)
    assert told["info"]["form"] == "cartesian" and told["info"]["cell"] == 0.1
    first = in_metres(told["images"][0], np.array([[0, 0]]))
    for image in told["images"][1:]:
        apart = in_metres(image, np.array([[0, 0]])) - first
        assert apart == pytest.approx(np.array([[image["column"] - told["images"][0]["column"],
                                                 -(image["row"] - told["images"][0]["row"])]]) * 0.1)


def test_the_command_writes_pictures_in_metres_and_refuses_what_makes_none(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    exr.write(fan(), "fan.exr")
    exr.write(labelled(), "side.exr")
    assert cli.main(["labels", "fan.exr", "--coco", "--cartesian", "--cell", "0.1", "-o", "metres"]) == 0
    image, = json.loads((tmp_path / "metres/annotations.json").read_text())["images"]
    assert image["cell_x"] == 0.1 and image["cell_y"] == -0.1
    capfd.readouterr()
    for options, words in ((["side.exr", "--coco", "--cartesian"], "side.exr has no Cartesian pictures: the levels are "
                            "over ping, side, range"),
                           (["fan.exr", "--coco", "--cell", "0.1"], "ask for these, or leave it out"),
                           (["fan.exr", "--coco", "--cartesian", "--cell", "0"], "length above 0")):
        assert cli.main(["labels", *options, "-o", "none"]) == 2
        said = capfd.readouterr().err
        assert words in said and said.count("\n") == 1 and not (tmp_path / "none").exists()
