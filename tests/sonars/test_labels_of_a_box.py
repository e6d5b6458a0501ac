"""Labels of a rendered box against geometry: a box on a level bed in uniform water, passed on a straight track.

The sonar is H above the bed, the box h high, from x0 to x1 abeam and from -y1 to y1 along the track. At slant range R

    highlight       hypot(x0, H - h) .. hypot(x1, H - h)          face and top
    shadow          hypot(x1, H - h) .. hypot(x1 H / (H - h), H)

in the pings from -y1 to y1. Bins are 5 cm, pings 25 cm apart, as wide as the beam is there: one of either may be cut.
"""
import json

import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render
from PIL import Image

import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.dataset.labels import Labels, write
from mitsonar.io.records import exr
from mitsonar.validation.scenes import bed, lambert, sidescan

H, HEIGHT, NEAR, FAR, HALF_LENGTH = 10.0, 1.0, 28.0, 30.0, 3.0
BIN, STEP, BINS, PINGS = 0.05, 0.25, 800, 41


@pytest.fixture(scope="module", params=(1, -1), ids=("starboard", "port"))
def labelled(request, tmp_path_factory):
    """The folder of labels of a box on that side, and the record."""
    mitsonar.scene.loading.prepare()
    to_world = mi.ScalarTransform4f().translate([request.param * 0.5 * (NEAR + FAR), 0, -20 + HEIGHT / 2])
    to_world = to_world.scale([0.5 * (FAR - NEAR), HALF_LENGTH, HEIGHT / 2])
    box = {"type": "cube", "id": "box.1", "bsdf": lambert(-20.0), "to_world": to_world}
    scene = sidescan({"seabed": bed(20), "box": box}, rays=100_000, film={"range": BINS * BIN, "bins": BINS},
                     sensor={"start": [0, -(PINGS // 2) * STEP, -H], "beam_width_deg": 0.5, "pulse_ms": 0.05,
                             "pings": PINGS, "ping_rate_hz": 4.0, "speed_knots": 3600 / 1852})
    image = render(scene)[0]
    folder = tmp_path_factory.mktemp("labels")
    exr.write(image, folder / "box.exr")
    with pytest.warns(UserWarning, match="training images cannot validate"):
        write(folder / "box.exr", folder / "out", Labels(coco=True, yolo="boxes", masks=True))
    return folder / "out", image, request.param


def test_boxes_lie_where_geometry_puts_them(labelled):
    folder, image, side = labelled
    np.testing.assert_allclose(np.diff(image["y"].values), STEP, rtol=1e-6)
    told = json.loads((folder / "annotations.json").read_text())
    top = np.hypot(NEAR, H - HEIGHT), np.hypot(FAR, H - HEIGHT)
    end = np.hypot(FAR * H / (H - HEIGHT), H)
    along = np.array([-HALF_LENGTH, HALF_LENGTH]) / STEP + PINGS / 2
    assert [(entry["category_id"], entry["side"], entry["truncated"]) for entry in told["annotations"]] == [
        (number, "starboard" if side > 0 else "port", False) for number in (1, 2)]
    for entry, (near, far) in zip(told["annotations"], (top, (top[1], end)), strict=True):
        left, upper, width, height = entry["bbox"]
        across = BINS + side * np.array([near, far]) / BIN
        np.testing.assert_allclose([left, left + width], np.sort(across), atol=1.01)
        np.testing.assert_allclose([upper, upper + height], along, atol=1.01)
        # a rectangle seen from the side is one here, but for its rim
        assert entry["area"] >= 0.9 * width * height and len(entry["segmentation"]) == 1


def test_the_masks_cover_what_is_bright_and_dark_in_the_picture(labelled):
    folder, *_ = labelled
    picture, instance, shadow = (np.array(Image.open(folder / name)).astype(int) for name in (
        "images/box.png", "masks/instance/box.png", "masks/shadow/box.png"))
    # at the ranges of the box the bed beside it is grey
    columns = np.flatnonzero(shadow.any(0))
    bed = picture[:8, columns].mean()
    assert (picture[instance > 0] > bed).mean() > 0.95 and (picture[shadow > 0] < bed - 20).mean() > 0.95
    assert not (instance.astype(bool) & shadow.astype(bool)).any()
