"""Pictures of all kinds of sonar have the same truth and coordinates, each with unit and meaning, and true depths.

The bed is level, `BED` below the surface. Two boxes on it, with their tops at `TOP`, are 6 m ahead of the sonar and
5.5 m to starboard. Pictures are small and coarse, since only names and places count. The depth of a bin is a mean, to
which faces of a box belong: it lies between top and bed, to 5 cm for sums in float32, and is the bed's where only the
bed is seen.
"""
import functools

import mitsuba as mi
import numpy as np
import pytest
import sonar_scenes as scenes

import mitsonar
import mitsonar.scene.loading
from mitsonar.inversion.images.scene_fit import image_intensities
from mitsonar.survey.kinds import KINDS

HEAD, BED, TOP = 6.0, 12.0, 11.0
BINS = {"label": "1", "class": "1", "share": "1", "hidden": "1", "object_shadow": "1", "layover": "1", "seabed_x": "m",
        "seabed_y": "m", "seabed_depth": "m", "depth": "m", "shadow": "1"}
PINGS = {"ping": "1", "ping_time": "s", "x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "heading": "rad",
         "altitude": "m", "range": "m", "time": "s"}
ATTRIBUTES = {"sonar", "sound_speed", "seed", "frequency", "source_level_db", "bin_width", "labels", "classes",
              "objects"}
# what instruments measure, by names that no truth has; places also have the word before their names
MEASURED = {"level", "recorded", "mean_level", "image", "phase", "coherence", "angle", "valid", "uncertainty", "error",
            "target_strength", "volume_strength"}
COARSE = {"frequency_khz": 100.0, "noise": False}
AHEAD = {**COARSE, "receive_elements": 16, "beams": 31}
LINE = {**COARSE, "receive": "line", "receive_elements": 16, "receive_normal": "forward", "receive_baffle": "hard",
        "transmit_normal": "forward", "transmit_baffle": "hard", "beams": 31, "fan_deg": 90.0}
MADE = {
    "sidescan": lambda shapes: scenes.sidescan(shapes, depth=HEAD, rays=50_000, film={"range": 16.0, "bins": 160}),
    "array": lambda shapes: scenes.array_sonar(shapes, depth=HEAD, sensor=LINE, film={"range": 16.0}),
    "forward_looking": lambda shapes: scenes.forward_looking(shapes, depth=HEAD, sensor=AHEAD, film={"range": 16.0}),
    "sector_scan": lambda shapes: scenes.sector_scan(
        shapes, depth=HEAD, sensor={**COARSE, "pings": 5, "sector_deg": 40.0, "step_deg": 10.0},
        film={"range": 16.0, "bins": 160}),
    "multibeam": lambda shapes: scenes.multibeam(
        shapes, depth=HEAD, sensor={"beams": 31, "noise": False, "receive_beam_width_deg": 4.0}, film={"range": 16.0}),
    "interferometric": lambda shapes: scenes.interferometric(shapes, depth=HEAD, sensor={"noise": False},
                                                             film={"range": 16.0, "bins": 160}),
    "echo_sounder": lambda shapes: scenes.echo_sounder(
        shapes, depth=HEAD, sensor={"noise": False, "beam_width_deg": 80.0, "split_beam": False},
        film={"range": 16.0, "bins": 160}),
    "synthetic_aperture": lambda shapes: scenes.synthetic_aperture(shapes, depth=HEAD, film={
        "range_min": 7.0, "range": 9.0}, integrator={"cell": 0.1})}
ONE_BEAM = ("echo_sounder",)        # straight down on a level bed, which fills the shadows of objects beside it
ROWS = [kind for kind in KINDS if kind != "synthetic_aperture"]        # a focused image has no rows along time


def box(x, y):
    """A box of 3 m by 2 m on the bed."""
    place = mi.ScalarTransform4f().translate([x, y, -0.5 * (BED + TOP)]).scale([1.5, 1.0, 0.5 * (BED - TOP)])
    return {"type": "cube", "to_world": place, "bsdf": scenes.lambert(-15.0)}


@functools.cache
def picture(kind):
    """The picture of a kind, over the bed with a box ahead and a box to starboard."""
    mitsonar.scene.loading.prepare()
    boxes = {"ahead": box(0.0, 7.0), "aside": box(7.0, 0.0)}
    shapes = {"seabed": scenes.bed(BED, scenes.lambert(-25.0), size=60.0), **boxes}
    return mitsonar.render(MADE[kind](shapes), 1)


def test_every_kind_is_here():
    assert set(MADE) == set(KINDS)


@pytest.mark.parametrize("kind", KINDS)
def test_bins_have_the_same_truth_with_units_and_meanings(kind):
    image = picture(kind)
    for name, units in BINS.items():
        assert image[name].attrs["units"] == units and image[name].attrs["long_name"], name
    assert image["level"].attrs["units"].startswith("dB re 1 ")
    assert image["shadow"].values.max() == (kind not in ONE_BEAM)
    assert set(np.unique(image["shadow"])) <= {0, 1}


@pytest.mark.parametrize("kind", ROWS)
def test_rows_have_the_same_coordinates_and_attributes_with_units_and_meanings(kind):
    image = picture(kind)
    for name, units in {**PINGS, "rays": "1"}.items():
        assert image[name].attrs["units"] == units and image[name].attrs["long_name"], name
    for name in ("depth", "shadow", "rays", "label"):
        assert (image[name].dims, image[name].dtype) == (image["level"].dims, {
            "depth": np.float32, "shadow": np.uint8}.get(name, np.uint32)), name
    assert ATTRIBUTES <= set(image.attrs)
    assert image.attrs["bin_width"] == pytest.approx(np.diff(image["range"].values).mean(), rel=1e-6)
    np.testing.assert_allclose(image["range"], 0.5 * image.attrs["sound_speed"] * image["time"])


@pytest.mark.parametrize("kind", KINDS)
def test_names_say_what_is_true_and_what_is_measured(kind):
    grid = {"x", "y", "grid_depth"} if kind == "synthetic_aperture" else set()
    others = {str(name) for name in picture(kind).data_vars} - set(BINS) - MEASURED - {"rays"} - grid
    assert all(name.startswith("measured_") for name in others), others


@pytest.mark.parametrize("kind", KINDS)
def test_depth_is_that_of_what_was_hit(kind):
    image = picture(kind)
    label = image["label"].values
    depth = image["depth"].values[label > 0]
    # beams in the beam domain count the echoes of the beams beside them, and have only depths of their own; an echo
    # sounder's echoes last for a pulse, longer than bins
    depth = depth[np.isfinite(depth)]
    assert depth.size > (0.4 if "beam" in image.dims else 0.9 if kind in ONE_BEAM else 0.99) * np.sum(label > 0)
    assert np.mean((depth > TOP - 0.05) & (depth < BED + 0.05)) > 0.99
    bed = (image["share"].values[list(image["shape"].values).index("seabed")] > 0.999) & (label > 0)
    assert np.nanmedian(np.abs(image["depth"].values[bed] - BED)) < 0.02


@pytest.mark.parametrize("kind", KINDS)
def test_a_shadow_has_no_label_and_begins_behind_the_first_return(kind):
    image = picture(kind)
    dark, label = image["shadow"].values > 0, image["label"].values
    assert not label[dark].any()
    if kind in ROWS:
        assert (np.argmax(dark, -1)[dark.any(-1)] > np.argmax(label > 0, -1)[dark.any(-1)]).all()
    assert (dark & (image["object_shadow"].values > 0)).any() or kind in ONE_BEAM


@pytest.mark.parametrize("kind", ["sidescan", "array", "forward_looking"])
def test_a_fit_takes_the_picture_of_the_scene_s_own_kind_and_no_other(kind):
    image = picture(kind)
    assert image_intensities(image, kind, image["level"].shape).shape == image["level"].shape
    with pytest.raises(ValueError, match="of a sonar of the kind"):
        image_intensities(image, "multibeam", image["level"].shape)


def test_a_level_bed_has_no_shadow_in_beams_that_are_closer_than_wide():
    """Beams of 4 elements are far wider than the steps between 61 of them: few scatterers are nearest to one beam."""
    mitsonar.scene.loading.prepare()
    scene = scenes.forward_looking({"seabed": scenes.bed(BED, size=60.0)}, depth=HEAD, film={"range": 16.0}, sensor={
        **COARSE, "receive_elements": 4, "beams": 61})
    image = mitsonar.render(scene, 1)
    assert image.attrs["picture"] == "beams" and image["rays"].values.mean() < 2
    assert image["shadow"].values.mean() < 1e-3
