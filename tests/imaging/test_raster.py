"""Fans of beams as pictures in metres: where things lie, how levels are averaged, what is refused."""
import time

import numpy as np
import pytest
from synthetic_fan import BOXES, fan, head

import mitsonar
from mitsonar.imaging.maps.raster import sweeps
from mitsonar.imaging.maps.raster_map import fan_grid, fan_map, in_order


def extent(picture, shown):
    """Edges of what is shown in a picture (y, x) [m]: left, right, near, far."""
    x, y = np.meshgrid(picture["x"].values, picture["y"].values)
    half = 0.5 * picture.attrs["cell"]
    return x[shown].min() - half, x[shown].max() + half, y[shown].min() - half, y[shown].max() + half


@pytest.mark.parametrize("step", ["angle", "sine"])
@pytest.mark.parametrize("cell", [0.05, 0.08])
def test_boxes_lie_at_their_places_to_an_element(step, cell):
    picture = mitsonar.imaging.cartesian(fan(step=step, beams=512, bins=900), cell=cell)
    assert picture["level"].dims == ("ping", "y", "x")
    assert np.diff(picture["x"]) == pytest.approx(cell) and np.diff(picture["y"]) == pytest.approx(-cell)
    for number, (x, y, size) in enumerate(BOXES.values(), 2):
        edges = extent(picture, picture["label"].values[0] == number)
        # a beam is 8 cm wide at 20 m
        expected = x - size / 2, x + size / 2, y - size / 2, y + size / 2
        assert edges == pytest.approx(expected, abs=cell + 0.05)


def test_a_turning_head_makes_a_picture_of_every_turn_without_a_seam():
    record = head(turns=2)
    picture = mitsonar.imaging.cartesian(record, cell=0.05)
    assert picture.sizes["ping"] == 2 and picture["turn"].values.tolist() == [0, 1]
    x, y, size = BOXES["box.1"]
    edges = extent(picture, picture["label"].values[1] == 2)
    assert edges == pytest.approx((x - size / 2, x + size / 2, y - size / 2, y + size / 2), abs=0.15)
    away = np.hypot(picture["x"], picture["y"]).values.T
    assert np.isfinite(picture["level"].values[0][(away > 1.1) & (away < 19.9)]).all()
    assert np.isnan(picture["level"].values[0][(away < 0.9) | (away > 20.1)]).all()


def test_a_sector_that_looks_astern_hangs_together():
    order, rising, closed = in_order(np.deg2rad([-170, 170, 180, -160]))
    assert order.tolist() == [1, 2, 0, 3] and not closed and np.diff(np.rad2deg(rising)) == pytest.approx(10)
    record = head()
    astern = np.cos(record["bearing"].values) < -0.5
    picture = mitsonar.imaging.cartesian(record.isel(ping=astern), cell=0.1)
    middle = picture["level"].sel(x=0.05, method="nearest").sel(y=slice(-1.1, -19.9)).values
    assert picture["y"].max() < 0 and np.isfinite(middle).all()


def test_coarse_elements_average_powers_and_fine_ones_interpolate():
    record = fan({}, bed=0.0, beams=300, bins=1500)
    power = np.random.default_rng(2).exponential(size=record["level"].shape)
    record["level"].values[:] = 10 * np.log10(power)
    coarse = mitsonar.imaging.cartesian(record, cell=0.4, names="level")["level"].values
    coarse = coarse[np.isfinite(coarse)]
    assert (10 ** (coarse / 10)).mean() == pytest.approx(1, abs=0.01)
    assert 0.3 < coarse.std() < 1.1                           # 5.6 dB of a single bin; 33 and more are averaged here
    ramp = fan({}, near=5.0, far=6.0, beams=41, bins=11, width=0.4)
    ramp["level"].values[:] = 10 * np.log10(np.linspace(1, 2, 41)[:, None] + 3 * np.linspace(0, 1, 11))
    fine = mitsonar.imaging.cartesian(ramp, cell=0.01, names=["level"])
    x, y = np.meshgrid(fine["x"], fine["y"])
    away, angle = np.hypot(x, y), np.arctan2(x, y)
    inner = (away > 5.05) & (away < 5.95) & (np.abs(angle) < 0.19)
    expected = 1.5 + angle / 0.4 + 3 * (away - 5)
    assert 10 ** (fine["level"].values[0][inner] / 10) == pytest.approx(expected[inner], abs=1e-3)


def test_powers_keep_their_mean_near_the_sonar_where_an_element_covers_many_beams():
    bearing, slant_range = np.linspace(-1, 1, 512), np.linspace(0.2, 5, 300)
    grid = fan_grid(bearing, slant_range, 0.1)
    found = fan_map(bearing, slant_range, grid)
    assert found.weights.sum(1) == pytest.approx(1, abs=1e-5) and found.weights.min() >= 0
    near = found.levels(10 * np.log10(np.random.default_rng(3).exponential(size=(512, 300))))
    away = np.hypot(grid.x, grid.y[:, None])
    assert np.nanstd(near[away < 0.5]) < 0.5 < np.nanstd(near[away > 4])


def test_labels_are_never_mixed_and_nothing_is_drawn_outside():
    record = fan()
    picture = mitsonar.imaging.cartesian(record, cell=0.3)
    for name in ("label", "class", "object_shadow", "shadow", "share", "hidden"):
        drawn, known = picture[name].values, np.unique(record[name].values)
        assert picture[name].dtype == record[name].dtype
        assert np.isin(drawn[np.isfinite(drawn)], known).all()
    outside = np.isnan(picture["level"].values)
    assert outside.any() and not picture["label"].values[outside].any()
    assert np.isnan(picture["hidden"].values[outside]).all() and np.isnan(picture["share"].values[:, outside]).all()


def test_a_fan_that_looks_down_is_drawn_downwards():
    record = fan()
    record = record.assign_coords(beam_x=("beam", 0 * record["beam"].values), beam_z=record["beam_x"])
    picture = mitsonar.imaging.cartesian(record, cell=0.2)
    assert (np.diff(picture["y"]) > 0).all() and picture["y"].attrs["long_name"] == "below"


@pytest.mark.parametrize("suffix", ["exr", "nc"])
def test_pictures_go_through_files(tmp_path, suffix):
    picture = mitsonar.imaging.cartesian(fan(pings=2), cell=0.2)
    mitsonar.write(picture, tmp_path / f"a.{suffix}")
    assert mitsonar.read(tmp_path / f"a.{suffix}").identical(picture)
    assert picture["sonar_x"].dims == ("ping",)


def test_all_frames_of_an_array_share_one_map():
    first, *others = sweeps(fan(pings=3), 0.2)
    assert all(each.map is first.map for each in others) and [each.pings.start for each in others] == [1, 2]


def test_without_a_size_the_element_is_a_bin_or_what_fits():
    assert mitsonar.imaging.cartesian(fan(bins=101)).attrs["cell"] == pytest.approx(0.18)
    large = mitsonar.imaging.cartesian(fan(bins=4000), names=["label"])
    assert max(large.sizes["x"], large.sizes["y"]) in (1024, 1025, 1026)


def test_a_frame_of_512_beams_is_drawn_in_a_tenth_of_a_second():
    # not a time of its own, which another load would spoil, but no more work than ten times that of the powers
    bearing, slant_range = np.linspace(-1.1, 1.1, 512), np.linspace(2, 60, 3000)
    found = fan_map(bearing, slant_range, fan_grid(bearing, slant_range, 0.11))
    level = np.random.default_rng(1).normal(size=(512, 3000)).astype(np.float32)
    drawing, powers = (min(_seconds(work) for _ in range(3)) for work in (
        lambda: found.levels(level), lambda: 10.0 ** (0.1 * level.astype(float))))
    assert drawing < 10 * powers


def _seconds(work):
    start = time.process_time()
    work()
    return time.process_time() - start


def test_what_makes_no_picture_is_refused_in_a_sentence():
    record = fan(beams=8, bins=20)
    single = record.isel(beam=0, drop=True)
    for wrong, words in ((record.isel(beam=[0]), "single beam"), (single, "a bearing for each"),
                         (record.drop_vars("level"), "no level"), (record.isel(range=[0, 1, 5]), "uneven steps"),
                         (record.isel(beam=[2, 2]), "all beams have the bearing")):
        with pytest.raises(ValueError, match=words):
            mitsonar.imaging.cartesian(wrong)
    with pytest.raises(ValueError, match="more than 16,777,216 of them; take elements of 0.0071 m or more"):
        mitsonar.imaging.cartesian(record, cell=1e-4)
    with pytest.raises(ValueError, match="take 17.*GB, more than 4.3"):
        mitsonar.imaging.cartesian(record.isel(ping=[0] * 40), cell=0.008)
    for cell in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="length above 0"):
            mitsonar.imaging.cartesian(record, cell=cell)
    with pytest.raises(ValueError, match="no variable 'depth' to draw"):
        mitsonar.imaging.cartesian(record, names=["depth"])


def test_a_map_is_kept_for_the_next_image_of_the_same_fan_alone():
    bearing, slant_range = np.linspace(-0.5, 0.5, 12), np.linspace(1, 4, 30)
    grid = fan_grid(bearing, slant_range, 0.1)
    first = fan_map(bearing, slant_range, grid)
    assert fan_map(bearing.copy(), slant_range.copy(), fan_grid(bearing, slant_range, 0.1)) is first
    farther = fan_map(bearing, slant_range + 0.5, grid)
    assert farther.nearest.size != first.nearest.size
