"""Labels of a record whose highlights and shadows are known: bins, pictures, polygons, tiles, and the files."""
import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as arrays
from labelled_sidescan import labelled
from PIL import Image
from rasterio.features import rasterize

from mitsonar.dataset.labels import Labels, write
from mitsonar.imaging.objects import object_bins
from mitsonar.io.records import exr
from mitsonar.labels.annotations import Annotation, annotations, clipped, is_invisible, standing_out
from mitsonar.labels.frames import Tile, frames, tiles
from mitsonar.labels.pictures import greys
from mitsonar.labels.polygons import joined, polygons


def filled(rings, shape):
    """Polygons as a mask, by a library that knows nothing of ours."""
    closed = [[*map(tuple, np.reshape(ring, (-1, 2)).tolist())] for ring in rings]
    outlines = [{"type": "Polygon", "coordinates": [[*ring, ring[0]]]} for ring in closed]
    return rasterize(outlines, out_shape=shape).astype(bool) if rings else np.zeros(shape, bool)


def area(ring):
    x, y = ring.T
    return abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2


MASKS = arrays.arrays(bool, st.tuples(st.integers(1, 12), st.integers(1, 12)))


@settings(max_examples=150, deadline=None)
@given(MASKS)
def test_polygons_fill_to_the_mask_and_joined_ones_too(mask):
    rings = polygons(mask)
    assert (filled(rings, mask.shape) == mask).all()
    assert sum(map(area, rings)) == mask.sum()
    if rings:
        assert area(joined(rings)) == mask.sum()
        assert (filled([joined(rings)], mask.shape) == mask).all()


def test_rings_within_rings_are_cut_open():
    mask = np.ones((41, 41), bool)
    for edge in (4, 12):
        mask[edge:-edge, edge:-edge] ^= True
        mask[edge + 4:-edge - 4, edge + 4:-edge - 4] ^= True
    assert (filled(polygons(mask), mask.shape) == mask).all()


def test_a_highlight_is_what_the_object_brings_most_of():
    record = labelled()
    seen = {each.name: each for each in object_bins(record)}
    assert list(seen) == ["box.1", "wreck", "box.2"]
    assert [each.class_name for each in seen.values()] == ["box", "wreck", "box"]
    expected = np.zeros(record["level"].shape, bool)
    expected[20:30, 1, 40:45] = True
    assert (seen["box.1"].highlight == expected).all() and not seen["box.2"].highlight.any()
    assert not any(each.highlight.any() for each in object_bins(record, threshold=0.85))


def test_an_echo_weaker_than_the_noise_is_no_highlight():
    record = labelled()
    record["mean_level"][20:25, 1] = 51.0
    assert next(object_bins(record)).highlight.sum() == 25
    assert next(object_bins(record, above_noise_db=-2.0)).highlight.sum() == 50
    record.attrs["noise_db"] = None
    assert next(object_bins(record)).highlight.sum() == 50


def test_a_bin_that_an_object_fills_is_no_shadow():
    # the upper edge of a box is as far as bed that the box hides
    both = [("shadow", "box.1", 1, 20, 30, 43, 60), ("highlight", "box.1", 1, 20, 30, 40, 45)]
    box = next(object_bins(labelled(rectangles=both)))
    assert not (box.highlight & box.shadow).any() and box.shadow[20, 1, 45:60].all() and not box.shadow[20, 1, 43]


def test_what_is_dark_in_a_shadow_is_no_highlight():
    # the bed is at 80 dB; the dark side of the box is all that is heard in its shadow, and far weaker
    record = labelled()
    record["share"].values[:, 20:30, 1, 50:55] = (np.arange(4) == 1)[:, None, None]
    for level, bins in ((69.0, 50), (71.0, 100)):
        record["mean_level"].values[20:30, 1, 50:55] = level
        box = next(object_bins(record))
        assert box.highlight.sum() == bins and not (box.highlight & box.shadow).any()
        assert (box.highlight | box.shadow)[20:30, 1, 40:60].all()
    record["hidden"].values[:] = 0                                             # a weak object on a stronger bed
    record["mean_level"].values[20:30, 1, 50:55] = 69.0
    assert next(object_bins(record)).highlight.sum() == 100


def test_a_shadow_goes_on_where_there_is_no_echo_to_hide():
    # ripples within the shadow leave lees that no ray reaches: dark between two parts of it, but not behind it
    record = labelled()
    record["object_shadow"].values[20:30, 1, 50:53] = 0
    record["shadow"].values[:] = 0
    record["shadow"].values[20:25, 1, 45:70] = 1
    shadow = next(object_bins(record)).shadow[20:30, 1]
    assert shadow[:5, 45:60].all() and not shadow[:, 60:].any()
    assert not shadow[5:, 50:53].any() and shadow[5:, 53:60].all()


def test_the_picture_is_the_exr_s_newest_ping_on_top_and_masks_lie_on_it(tmp_path):
    record = labelled()
    exr.write(record, tmp_path / "a.exr")
    write(tmp_path / "a.exr", tmp_path / "out", Labels(masks=True, coco=True, tvg=None, window=(40.0, 95.0)))
    picture = np.array(Image.open(tmp_path / "out/images/a.png"))
    level = exr.OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels(0)["Y"].pixels[::-1]
    assert (picture == np.clip(np.rint((level - 40) / 55 * 255), 0, 255)).all()
    masks = {kind: np.array(Image.open(tmp_path / f"out/masks/{kind}/a.png"))
             for kind in ("instance", "class", "shadow")}
    assert all(mask.dtype == np.uint16 and mask.shape == picture.shape for mask in masks.values())
    # port is mirrored: its bin 70 is column 29, and the newest of 60 pings on top: ping 20 is row 39; every bright bin
    # is an instance, every dark one of the bed a shadow
    assert masks["instance"][39, 140] == 2 and masks["instance"][49, 29] == 3 and masks["shadow"][39, 145] == 2
    assert ((masks["instance"] > 0) == (picture == 255)).all()
    assert ((masks["shadow"] > 0) == ((picture == 0) & (level > -199))).all()
    names = json.loads((tmp_path / "out/masks/classes.json").read_text())
    assert names[str(masks["class"][39, 140])] == "box" and names[str(masks["class"][49, 29])] == "wreck"


def test_coco_says_what_the_masks_say(tmp_path):
    rng = np.random.default_rng(3)
    spots = [("highlight", "wreck", 0, p, p + 3, b, b + 4) for p, b in rng.integers(20, 50, (30, 2)).tolist()]
    exr.write(labelled(rectangles=[*spots, ("shadow", "box.2", 1, 5, 60, 50, 100)]), tmp_path / "a.exr")
    write(tmp_path / "a.exr", tmp_path / "out", Labels(masks=True, coco=True))
    told = json.loads((tmp_path / "out/annotations.json").read_text())
    assert set(told) == {"info", "licenses", "images", "annotations", "categories"}
    names = {entry["id"]: entry["name"] for entry in told["categories"]}
    assert names == {1: "box", 2: "wreck", 3: "box shadow", 4: "wreck shadow"}
    image, = told["images"]
    shape = image["height"], image["width"]
    masks = [np.array(Image.open(tmp_path / f"out/masks/{kind}/a.png")) for kind in ("instance", "shadow")]
    wreck, shadow = told["annotations"]
    assert (wreck["instance"], wreck["category_id"], wreck["truncated"]) == ("wreck", 2, False)
    assert (shadow["instance"], shadow["category_id"], shadow["truncated"]) == ("box.2", 3, True)
    for entry, mask, label in ((wreck, masks[0], 3), (shadow, masks[1], 4)):
        assert (filled(entry["segmentation"], shape) == (mask == label)).all()
        rows, columns = np.nonzero(mask == label)
        assert entry["bbox"] == [columns.min(), rows.min(), np.ptp(columns) + 1, np.ptp(rows) + 1]
        assert entry["area"] == rows.size and entry["iscrowd"] == 0 and entry["image_id"] == image["id"]


def test_yolo_s_lines_are_the_boxes_and_polygons(tmp_path):
    exr.write(labelled(), tmp_path / "a.exr")
    for form in ("boxes", "polygons"):
        with pytest.warns(UserWarning, match="val of data.yaml is train.txt"):
            write(tmp_path / "a.exr", tmp_path / form, Labels(yolo=form))
    size = np.array([200, 60])
    boxes, rings = ([[float(word) for word in line.split()] for line in
                     (tmp_path / form / "labels/a.txt").read_text().splitlines()] for form in ("boxes", "polygons"))
    assert boxes[0] == pytest.approx([0, 142.5 / 200, 35 / 60, 5 / 200, 10 / 60], abs=1e-6)
    assert [int(box[0]) for box in boxes] == [0, 2, 1, 3]
    for box, ring in zip(boxes, rings, strict=True):
        corners = np.reshape(ring[1:], (-1, 2))
        assert corners.min(0) * size == pytest.approx((np.array(box[1:3]) - np.array(box[3:]) / 2) * size, abs=1e-3)
    note, *lines = (tmp_path / "boxes/data.yaml").read_text().splitlines()
    assert note.startswith("# val of data.yaml is train.txt: ") and lines[:4] == [
        "train: train.txt", "val: train.txt", "names:", '  0: "box"']
    assert (tmp_path / "boxes/train.txt").read_text() == "./images/a.png\n"


def test_yolo_says_which_of_its_lists_a_split_lacks(tmp_path):
    for name in "ab":
        exr.write(labelled(seabed=name), tmp_path / f"{name}.exr")
    both = [tmp_path / f"{name}.exr" for name in "ab"]
    for shares, note in (({"train": 0.5, "test": 0.5}, "val of data.yaml is train.txt"),
                         ({"val": 0.5, "test": 0.5}, "train of data.yaml is val.txt")):
        with pytest.warns(UserWarning, match=note):
            write(both, tmp_path / note[:4], Labels(yolo="boxes", split=shares))
        assert (tmp_path / note[:4] / "data.yaml").read_text().startswith(f"# {note}")
    with warnings.catch_warnings(action="error"):
        write(both, tmp_path / "whole", Labels(yolo="boxes", split={"train": 0.5, "val": 0.5}))
        write(both, tmp_path / "coco", Labels(coco=True))
    assert (tmp_path / "whole/data.yaml").read_text().startswith("train: train.txt\nval: val.txt\nnames:")


def test_pictures_without_annotations_are_left_out_where_that_is_wanted(tmp_path):
    exr.write(labelled(), tmp_path / "a.exr")
    exr.write(labelled(rectangles=[], seabed="d"), tmp_path / "bare.exr")
    rules = {"coco": True, "masks": True, "yolo": "boxes", "tile": (20, 50)}
    with pytest.warns(UserWarning, match="val of data.yaml"):
        all_, some = (write(tmp_path / "a.exr", tmp_path / name, Labels(drop_empty=drop, **rules))
                      for name, drop in (("all", False), ("some", True)))
    assert all_["pictures"] == 12 and all_["empty"] == 0 and some["empty"] == 12 - some["pictures"] > 0
    assert {kind: some[kind] for kind in ("highlights", "shadows")} == {
        kind: all_[kind] for kind in ("highlights", "shadows")}
    told = {name: json.loads((tmp_path / name / "annotations.json").read_text()) for name in ("all", "some")}
    full = {entry["image_id"] for entry in told["all"]["annotations"]}
    kept = {image["file_name"] for image in told["all"]["images"] if image["id"] in full}
    assert kept == {image["file_name"] for image in told["some"]["images"]}
    for kind in ("images", "masks/instance", "masks/class", "masks/shadow"):
        assert {path.name for path in (tmp_path / "some" / kind).iterdir()} == kept
    assert {path.stem for path in (tmp_path / "some/labels").iterdir()} == {name[:-4] for name in kept}
    assert len((tmp_path / "some/train.txt").read_text().split()) == len(kept)
    with pytest.raises(ValueError, match="no picture has an annotation, and empty ones are to be left out"):
        write(tmp_path / "bare.exr", tmp_path / "none", Labels(coco=True, drop_empty=True))
    shares = {"train": 0.5, "val": 0.5}
    with pytest.raises(ValueError, match="no picture of the subset (train|val) has an annotation"):
        write([tmp_path / "a.exr", tmp_path / "bare.exr"], tmp_path / "none",
              Labels(coco=True, drop_empty=True, split=shares))
    assert not (tmp_path / "none").exists()


def test_an_object_that_both_sides_hear_makes_two_annotations():
    both = [("highlight", "box.1", side, 20, 30, 10, 15) for side in (0, 1)]
    record = labelled(rectangles=both)
    found = annotations(record, frames(record))[0]
    assert [(each.side, each.box, each.truncated) for each in found] == [
        ("port", (85, 30, 5, 10), False), ("starboard", (110, 30, 5, 10), False)]


@pytest.mark.parametrize("side, pings, bins, cut", [
    (1, (0, 5), (40, 45), True), (1, (55, 60), (40, 45), True), (1, (5, 9), (95, 100), True),
    (0, (5, 9), (95, 100), True), (0, (5, 9), (0, 5), False), (1, (5, 9), (0, 5), False), (1, (5, 9), (5, 9), False)])
def test_what_the_record_s_edge_cuts_is_truncated_and_the_track_is_no_edge(side, pings, bins, cut):
    record = labelled(rectangles=[("highlight", "box.1", side, *pings, *bins)])
    assert annotations(record, frames(record))[0][0].truncated == cut
    record = record.assign_coords(range=record["range"] + 30.0)                # a window that begins at 30 m
    assert annotations(record, frames(record))[0][0].truncated == (cut or bins[0] == 0)


@settings(max_examples=60, deadline=None)
@given(st.integers(8, 70), st.integers(8, 250), st.floats(0, 0.9))
def test_tiles_cover_the_picture_and_carry_what_lies_in_them(height, width, overlap):
    record = labelled()
    frame, = frames(record)
    found = annotations(record, [frame])[0]
    whole = np.zeros((4, frame.height, frame.width), bool)
    seen = np.zeros((frame.height, frame.width), int)
    for tile in tiles(frame, (height, width), overlap):
        assert (tile.height, tile.width) == (min(height, 60), min(width, 200))
        seen[tile.row:tile.row + tile.height, tile.column:tile.column + tile.width] += 1
        for mask, each in zip(whole, found, strict=True):
            piece = clipped(each, tile)
            if piece is None:
                continue
            x, y, w, h = piece.box
            assert 0 <= x <= x + w <= tile.width and 0 <= y <= y + h <= tile.height
            assert piece.truncated == (each.truncated or piece.bins < each.bins)
            assert piece.visible == pytest.approx(piece.bins / each.bins)
            mask[tile.row + y:tile.row + y + h, tile.column + x:tile.column + x + w] |= piece.mask
    assert seen.min() == 1 or overlap > 0 or height < 60 or width < 200
    assert (seen > 0).all()
    for mask, each in zip(whole, found, strict=True):
        x, y, w, h = each.box
        assert (mask[y:y + h, x:x + w] == each.mask).all() and mask.sum() == each.bins


def test_too_small_a_piece_is_left_out():
    record = labelled()
    record["share"].values[:, 5, 0, 50] = (np.arange(4) == 1)[:, None].T           # a speck to port
    each = annotations(record, frames(record), smallest=4)[0][0]
    assert [found.side for found in annotations(record, frames(record))[0] if found.name == "box.1"] == [
        "port", "starboard", "starboard"]
    assert (each.side, each.bins) == ("starboard", 50)
    assert annotations(record, frames(record), smallest=51)[0][0].name == "box.1"      # its shadow
    assert clipped(each, Tile(row=0, column=0, height=31, width=143), smallest=4) is None
    assert clipped(each, Tile(row=0, column=0, height=31, width=144), smallest=4).bins == 4


def test_a_stray_piece_does_not_stretch_a_box():
    for bins, kept in ((8, False), (10, True)):                                # the largest has 200
        strays = [("shadow", "box.1", 1, 20, 40, 50, 60), ("shadow", "box.1", 1, 2, 3, 80, 80 + bins)]
        record = labelled(rectangles=strays)
        assert next(object_bins(record, smallest=8)).shadow[2].any() == kept
        assert next(object_bins(record)).shadow[2].any()


def test_what_the_picture_shows_as_black_all_around_is_left_out(tmp_path):
    record = labelled()
    exr.write(record, tmp_path / "a.exr")
    rules = {"coco": True, "masks": True, "smallest": 1}
    assert write(tmp_path / "a.exr", tmp_path / "seen", Labels(**rules)) == {
        "pictures": 1, "highlights": 2, "shadows": 2, "invisible": 0, "empty": 0}
    assert write(tmp_path / "a.exr", tmp_path / "black", Labels(window=(300, 310), **rules)) == {
        "pictures": 1, "highlights": 0, "shadows": 0, "invisible": 4, "empty": 0}
    assert not np.asarray(Image.open(tmp_path / "black" / "masks" / "instance" / "a.png")).any()
    # an object in black water, and the shadow it throws on grey, stay
    highlight, shadow = (each for each in annotations(record, frames(record))[0] if each.name == "box.1")
    for each, inside, around, black in ((highlight, 200, 0, False), (shadow, 0, 90, False), (highlight, 0, 0, True)):
        picture = np.full((60, 200), around, np.uint8)
        picture[each.row:each.row + each.mask.shape[0], each.column:each.column + each.mask.shape[1]] = inside
        assert is_invisible(each, picture) == black
    # at the edge of the picture
    picture = np.zeros((10, 5), np.uint8)
    at_edge = clipped(highlight, Tile(row=highlight.row, column=highlight.column, height=10, width=5))
    assert is_invisible(at_edge, picture) and not is_invisible(at_edge, picture + 1)


@pytest.mark.parametrize("down", [False, True])
def test_pings_of_an_array_are_pictures_of_their_own_far_on_top_as_their_fans(tmp_path, down):
    """Bins 40 to 44 of 100: from the top rows 55 to 59 of a fan that looks ahead, 40 to 44 of one that looks down."""
    record = labelled()
    beams = record.rename(side="beam").drop_vars("beam").transpose("ping", "beam", ...).isel(ping=slice(20, 23))
    ahead = [[0.8, 0.8], [-0.5, 0.5], [0.0, 0.0]]
    beams = beams.assign_coords({f"beam_{axis}": ("beam", way)
                                 for axis, way in zip("xyz", ahead[::-1] if down else ahead)})
    exr.write(beams, tmp_path / "fan.exr")
    write(tmp_path / "fan.exr", tmp_path / "out", Labels(coco=True, tvg=None, smallest=1))
    told = json.loads((tmp_path / "out/annotations.json").read_text())
    assert [(image["file_name"], image["height"], image["width"]) for image in told["images"]] == [
        (f"fan_ping000{ping}.png", 100, 2) for ping in range(3)]
    assert [entry["bbox"] for entry in told["annotations"] if entry["category_id"] == 1] == [
        [1, 40 if down else 55, 1, 5]] * 3
    assert all(entry["truncated"] for entry in told["annotations"])                        # by the last beam


def test_a_sidescan_without_mean_levels_is_labelled_by_its_levels():
    """As interferometers give it: what is dark in a shadow is no highlight, and noise of the water column is no bed."""
    record = labelled()
    record["share"].values[:, 20:30, 1, 50:55] = (np.arange(4) == 1)[:, None, None]
    expected = next(object_bins(record))
    level = record["level"].values
    level[level < 0] = 30.0                                                    # the water column: 12 m of 25
    depth = (record["level"].dims, np.where(level > 35, 20.0, np.nan))
    bare = record.drop_vars("mean_level").assign(seabed_depth=depth)
    box = next(object_bins(bare))
    assert (box.highlight == expected.highlight).all() and (box.shadow == expected.shadow).all()
    bare["level"].values[:, :, :80] = 30.0                                     # deep water: most of a ping is noise
    bare["seabed_depth"].values[:, :, :80] = np.nan
    low, high = greys(bare, frames(bare), tvg=None).window
    assert low > 50 and high < 120


def test_an_object_with_its_shadow_is_one_more_annotation_on_demand(tmp_path):
    exr.write(labelled(), tmp_path / "a.exr")
    write(tmp_path / "a.exr", tmp_path / "out", Labels(coco=True, yolo="boxes", masks=True, whole=True))
    told = json.loads((tmp_path / "out/annotations.json").read_text())
    kinds = {entry["id"]: (entry["name"], entry["supercategory"]) for entry in told["categories"]}
    assert kinds[3] == ("box shadow", "shadow") and kinds[5] == ("box with shadow", "whole") and len(kinds) == 6
    of_box = {entry["category_id"]: entry for entry in told["annotations"] if entry["instance"] == "box.1"}
    assert set(of_box) == {1, 3, 5}
    left, top, width, height = of_box[5]["bbox"]
    assert (width, height) == (of_box[1]["bbox"][2] + of_box[3]["bbox"][2], 10)
    assert of_box[5]["area"] == of_box[1]["area"] + of_box[3]["area"]
    assert len((tmp_path / "out/labels/a.txt").read_text().splitlines()) == len(told["annotations"]) == 6
    assert json.loads((tmp_path / "out/masks/classes.json").read_text()) == {"1": "box", "2": "wreck"}


def test_shadows_may_be_in_the_masks_alone(tmp_path):
    exr.write(labelled(), tmp_path / "a.exr")
    write(tmp_path / "a.exr", tmp_path / "all", Labels(masks=True))
    counts = write(tmp_path / "a.exr", tmp_path / "out", Labels(coco=True, yolo="boxes", masks=True, shadows=False))
    told = json.loads((tmp_path / "out/annotations.json").read_text())
    assert [entry["name"] for entry in told["categories"]] == ["box", "wreck"] and told["info"]["shadows"] is False
    assert len(told["annotations"]) == counts["highlights"] > 0 == counts["shadows"]
    assert len((tmp_path / "out/labels/a.txt").read_text().splitlines()) == counts["highlights"]
    for kind in ("instance", "class", "shadow"):
        one, other = (tmp_path / f"{folder}/masks/{kind}/a.png" for folder in ("out", "all"))
        assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("least, kept", [(0.0, 4), (0.3, 3), (0.5, 3), (0.6, 2)])
def test_what_is_hidden_or_cut_beyond_a_share_is_left_out(tmp_path, least, kept):
    """The wreck is exposed to 0.25 and the box to 0.5; shadows are what they are."""
    record = labelled()
    for entry, share in zip(record.attrs["objects"].values(), (0.5, 0.25, 1.0), strict=True):
        entry["exposed"] = share
    exr.write(record, tmp_path / "a.exr")
    write(tmp_path / "a.exr", tmp_path / "out", Labels(coco=True, min_visible=least))
    told = json.loads((tmp_path / "out/annotations.json").read_text())["annotations"]
    assert len(told) == kept
    assert all(entry["visible"] == 1 and entry["exposed"] in (0.5, 0.25) for entry in told)
    write(tmp_path / "a.exr", tmp_path / "tiles", Labels(coco=True, min_visible=0.9, tile=(16, 16)))
    whole = json.loads((tmp_path / "tiles/annotations.json").read_text())["annotations"]
    assert all(entry["visible"] >= 0.9 for entry in whole)


@pytest.mark.parametrize("least, kept", [
    (0.0, {("rock", "highlight"), ("rock", "shadow"), ("rock", "whole"), ("mine", "highlight"), ("mine", "whole")}),
    (1.5, {("rock", "highlight"), ("rock", "whole"), ("mine", "highlight"), ("mine", "whole")}),
    (2.5, {("rock", "highlight"), ("rock", "whole")})])
def test_annotations_that_do_not_stand_out_are_left_out(least, kept):
    """Half of the bed is 90 and half 110: 100 with a standard deviation of 10. The rock is 3 brighter and its shadow 1
    darker; the mine is 2 brighter, and what should be its shadow is brighter, too. The rock lies in the mine's way: its
    bins do not count as the mine's surroundings."""
    picture = np.where(np.indices((40, 40)).sum(0) % 2, 90, 110).astype(np.uint8)
    pieces = []
    for label, name, row, grey in ((1, "rock", 10, (130, 90)), (2, "mine", 16, (120, 101))):
        for kind, column, value in zip(("highlight", "shadow"), (10, 14), grey, strict=True):
            picture[row:row + 4, column:column + 4] = value
            pieces.append(Annotation(kind=kind, label=label, name=name, class_name=name, side="", row=row,
                                     column=column, mask=np.ones((4, 4), bool), truncated=False))
        pieces.append(replace(pieces[-2], kind="whole", mask=np.ones((4, 8), bool)))
    assert {(piece.name, piece.kind) for piece in standing_out(pieces, picture, least)} == kept
    assert standing_out(pieces[:1], np.full((40, 40), 7, np.uint8), 0.0) == pieces[:1]


def test_a_rule_of_contrast_leaves_out_and_counts(tmp_path):
    exr.write(labelled(), tmp_path / "a.exr")
    every = write(tmp_path / "a.exr", tmp_path / "all", Labels(coco=True))
    few = write(tmp_path / "a.exr", tmp_path / "few", Labels(coco=True, min_contrast=1e6))
    kinds = ("highlights", "shadows")
    assert sum(few[kind] for kind in kinds) == 0
    assert few["invisible"] == every["invisible"] + sum(every[kind] for kind in kinds)
    assert json.loads((tmp_path / "few/annotations.json").read_text())["info"]["min_contrast"] == 1e6
    with pytest.raises(ValueError, match="the least contrast is -1"):
        Labels(coco=True, min_contrast=-1)
