"""The fan seen from above: a bright echo is drawn where it lies, and what is no fan is refused."""
import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_rgb
from synthetic_fan import fan

from mitsonar import plots
from mitsonar.plots.fans import fan_sheet, fans as room
from mitsonar.plots.images.truth import BRIGHT, SHADOW_COLOUR


def beams(azimuth, sample=300, beam=None, samples=600):
    """A fan with one bright echo."""
    azimuth = np.deg2rad(azimuth)
    values = np.full((1, len(azimuth), samples), 1.0, np.complex64)
    values[0, len(azimuth) // 2 if beam is None else beam, sample] = 1e4
    return xr.DataArray(values, dims=("ping", "beam", "sample"), attrs={"sound_speed": 1500.0},
                        coords={"time": ("sample", 0.01 + np.arange(samples) / 3e4), "azimuth": ("beam", azimuth)})


@pytest.mark.parametrize("falling", [False, True])
@pytest.mark.parametrize("beam", [10, 30])
def test_an_echo_lies_where_its_beam_and_time_say(beam, falling):
    data = beams(np.linspace(-50, 50, 41)[::-1] if falling else np.linspace(-50, 50, 41), beam=beam)
    azimuth, slant_range, level, *sides = room._levels(data, 0)
    view = fan_sheet.view_of(azimuth, slant_range, *sides)
    image = view.map.levels(level)
    row, column = np.argwhere(image > np.nanmax(image) - 3).mean(0)           # the middle of the beam's patch
    left, right, bottom, top = view.extent
    step = (right - left) / image.shape[1]
    assert step == pytest.approx((top - bottom) / image.shape[0])             # metres are square
    x, y = left + (column + 0.5) * step, top - (row + 0.5) * step
    angle, distance = float(data["azimuth"][beam]), 750 * float(data["time"][300])
    assert np.hypot(x, y) == pytest.approx(distance, abs=0.05)
    assert np.degrees(np.arctan2(x, y) - angle) == pytest.approx(0, abs=1.3)     # half a beam


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_it_is_drawn(tmp_path, suffix):
    plots.fan(beams(np.linspace(-60, 60, 31)), tmp_path / f"a.{suffix}", title="a title")
    assert (tmp_path / f"a.{suffix}").stat().st_size > 5000


@pytest.mark.parametrize("axis, right", [("x", "forward"), ("y", "starboard")])
def test_a_fan_that_looks_down_is_drawn_by_its_angles_from_below(tmp_path, axis, right):
    angle = np.deg2rad(np.linspace(-60, 60, 31))
    aside, other = np.sin(angle), "xy".replace(axis, "")
    data = beams(np.where(aside < 0, -90, 90)).assign_coords(
        {f"beam_{axis}": ("beam", aside), f"beam_{other}": ("beam", 0 * aside), "beam_z": ("beam", np.cos(angle))})
    drawn, _, _, *sides = room._levels(data, 0)
    assert drawn == pytest.approx(angle) and sides == ["down", right]
    plots.fan(data, tmp_path / "a.png")


def labelled_fan(looks=(1, 0, 0)):
    """Two pings of 31 beams by 60 ranges: an object with its shadow in the second, none in the first."""
    angle = np.deg2rad(np.linspace(-60, 60, 31))
    direction = np.cos(angle)[:, None] * looks + np.sin(angle)[:, None] * [0, 1, 0]
    dims, shape = ("ping", "beam", "range"), (2, 31, 60)
    share, shadow = np.zeros((2, *shape), np.float32), np.zeros(shape, np.uint32)
    share[1] = 1
    share[:, 1, 20:24, 30:34] = np.array([0.8, 0.2])[:, None, None]
    shadow[1, 20:24, 34:50] = 1
    level = np.where(shadow > 0, 20.0, np.where(share[0] > 0.5, 90.0, 60.0)).astype(np.float32)
    return xr.Dataset(
        {"level": (dims, level), "share": (("shape", *dims), share), "object_shadow": (dims, shadow)},
        {"ping": [0, 1], "beam": angle, "range": 5 + 0.25 * np.arange(60), "shape": ["mine", "bed"],
         **{f"beam_{axis}": ("beam", column) for axis, column in zip("xyz", direction.T)}},
        {"frequency": 3e5, "sonar": "array_sonar", "objects": {"1": {"class": "mine"}}})


def near(image, colour):
    """Where a picture has a colour."""
    return np.abs(image[..., :3] - colour).max(-1) < 0.02


@pytest.mark.parametrize("looks", [(1, 0, 0), (0, 0, 1)])
def test_objects_and_shadows_are_outlined_on_the_fan_of_a_ping(tmp_path, looks):
    fan = labelled_fan(looks)
    for ping, outlined in ((0, False), (1, True)):
        plots.plot(fan, "objects", tmp_path / "a.png", ping=ping, tvg=None)
        image = matplotlib.image.imread(tmp_path / "a.png")
        fan_only = image[fan_sheet.OVER:-fan_sheet.UNDER, fan_sheet.BEFORE:fan_sheet.BEFORE + fan_sheet.SIZE]
        highlight, shadow = (near(fan_only, to_rgb(colour)) for colour in (BRIGHT[0], SHADOW_COLOUR))
        assert highlight.any() == shadow.any() == outlined
    rows, columns = np.nonzero(highlight)
    assert 100 < rows.size < 3000 and np.ptp(rows) > 20 and columns.min() > fan_sheet.SIZE / 2          # to starboard
    # behind the object, which is above it in a fan that looks ahead, below it in one that looks down
    assert (np.nonzero(shadow)[0].mean() < rows.mean()) == (looks[2] == 0)
    assert near(fan_only[rows.min():rows.max(), columns.min():columns.max()], 1.0).any()           # it stays to be seen


def speckled(beams, ranges):
    """A fan of 120 degrees with the speckle of an even bed of level 0 dB, 1 to 31 m away."""
    angle = np.deg2rad(np.linspace(-60, 60, beams))
    power = np.random.default_rng(0).exponential(size=(1, beams, ranges))
    return xr.Dataset(
        {"level": (("ping", "beam", "range"), 10 * np.log10(power).astype(np.float32))},
        {"ping": [0], "beam": angle, "range": 1 + 30 * np.arange(ranges) / ranges, "beam_x": ("beam", np.cos(angle)),
         "beam_y": ("beam", np.sin(angle)), "beam_z": ("beam", 0 * angle)}, {"frequency": 3e5, "sonar": "array_sonar"})


def drawn_power(fan):
    view = room.fan_view(fan)
    return 10 ** (view.map.levels(room.fan_levels(fan, 0, None)[0]) / 10)


def test_fine_ranges_are_averaged_as_powers_and_leave_no_pepper():
    """Some 17 ranges an element: speckle's coefficient of variation falls to 1/4, its mean power stays."""
    power = drawn_power(speckled(300, 9000))
    assert np.nanmean(power) == pytest.approx(1, abs=0.02) and np.nanstd(power) < 0.35
    assert (power[np.isfinite(power)] < 0.1).mean() < 1e-3                        # one in ten bins is that dark


def test_few_beams_have_no_steps_in_the_picture():
    """Between 9 beams an element's power lies between its neighbours': no jump is larger than a share of theirs."""
    fan = speckled(9, 60)
    power = drawn_power(fan)[fan_sheet.SIZE // 4]
    jumps = np.abs(np.diff(power[np.isfinite(power)]))
    assert jumps.max() < 0.1 * np.ptp(10 ** (fan["level"].values / 10))


def test_colours_show_the_bed_whatever_shines_or_is_dark():
    """Neither targets 50 dB above the speckle of 20 looks nor a dark half of the picture take its contrast."""
    bed = 10 * np.log10(np.random.default_rng(0).gamma(20, 1 / 20, (100, 100)))
    alone = room.fan_window(bed)
    bright, dark = bed.copy(), bed.copy()
    bright[:3] += 50
    dark[:, :60] -= 60
    for picture in (bright, dark):
        low, high = room.fan_window(picture)
        assert high - low < 32 and low <= alone[0] + 2 and high >= alone[1] - 2
    assert room.fan_window(np.full((3, 3), np.nan)) == (0, 1) and np.diff(room.fan_window(np.zeros((3, 3)))) > 0


@pytest.mark.parametrize("noise_db, heard", [(-200.0, None), (-40.0, 14.0), (10.0, None)])
def test_the_gain_is_held_from_where_noise_hides_the_bed(noise_db, heard):
    """An even bed falls with 30 log R + 0.4 R, to noise of -40 dB at 14 m. Without bed or noise the gain rises on."""
    fan = speckled(60, 600).assign_attrs(absorption_db=0.2)
    bed = fan["level"] - 30 * np.log10(fan["range"]) - 0.4 * fan["range"]
    fan = fan.assign(level=10 * np.log10(10 ** (bed / 10) + 10 ** (noise_db / 10)))
    level, words = room.fan_levels(fan, 0, "seabed")
    gain = (level - fan["level"].values[0])[0]
    if heard is None:
        assert words == " + 30 log R + 2αR" and gain[-1] > gain[-2]
    else:
        held = fan["range"].values[np.flatnonzero(np.diff(gain) == 0)[0]]
        assert held == pytest.approx(heard, rel=0.25) and words.endswith(f"2αR to {held:.2g} m")
    assert room.fan_levels(fan, 0, None)[1] == ""


@pytest.mark.parametrize("looks", [(1, 0, 0), (0, 0, 1)])
def test_labels_are_drawn_the_same_way_up(tmp_path, looks):
    fan = labelled_fan(looks)
    label = np.where(fan["share"].sel(shape="mine") > 0.5, 1, 2).astype(np.uint32)
    fan = fan.assign(label=(fan["level"].dims, label)).assign_attrs(labels={"1": "mine", "2": "bed"})
    plots.plot(fan, "labels", tmp_path / "labels.png", ping=1)
    plots.plot(fan, "waterfall", tmp_path / "levels.png", ping=1, tvg=None, colours="grey")
    box = np.s_[fan_sheet.OVER:-fan_sheet.UNDER, fan_sheet.BEFORE:fan_sheet.BEFORE + fan_sheet.SIZE]
    labels, levels = (matplotlib.image.imread(tmp_path / f"{name}.png")[box] for name in ("labels", "levels"))
    mine = near(labels, to_rgb("#1f77b4"))
    assert 300 < mine.sum() < 6000 and labels.shape == levels.shape
    assert np.all(levels[mine].max(-1) > 0.5) and near(levels, 1.0)[mine].mean() > 0.6  # bright
    with pytest.raises(ValueError, match="needs the variable 'label'"):
        plots.plot(labelled_fan(), "labels", tmp_path / "a.png")


def test_colours_are_those_of_a_waterfall(tmp_path):
    with pytest.raises(ValueError, match="no colours 'green'; choose one of copper, grey"):
        plots.plot(labelled_fan(), "waterfall", tmp_path / "a.png", colours="green")
    with pytest.raises(ValueError, match="the plot is 'objects'; leave them out"):
        plots.plot(labelled_fan(), "objects", tmp_path / "a.png", colours="grey")


def test_what_cannot_be_outlined_is_refused(tmp_path):
    fan = labelled_fan()
    for spoilt, what, sentence in ((fan.isel(beam=[3]), "objects", "a single beam"),
                                   (fan.drop_vars("share"), "objects", "no share"), (fan, "depth", "and objects")):
        with pytest.raises(ValueError, match=sentence):
            plots.plot(spoilt, what, tmp_path / "a.png")
    with pytest.raises(ValueError, match="there is no ping 2"):
        plots.plot(fan, "objects", tmp_path / "a.png", ping=2)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("vector, name", [([1, 0, 0.3], "forward"), ([-1, 0, 0], "aft"), ([0, 0.9, 0.5], "starboard"),
                                          ([0, -1, 0], "port"), ([0.2, 0, 1], "down"), ([0, 0, -1], "up")])
def test_the_sides_of_a_picture_are_named_by_the_body(vector, name):
    assert room._way(np.array(vector)) == name
    assert room._way(np.array([0.6, 0.6, 0.52]), beside="forward") == "starboard"


@pytest.mark.parametrize("spoil, sentence", [
    (lambda data: data.isel(beam=[0]), "two or more beams"),
    (lambda data: data.drop_vars("azimuth"), "no azimuth"),
    (lambda data: data.rename(sample="range"), "two or more beams"),
    (lambda data: data.assign_coords(azimuth=("beam", np.full(31, np.pi / 2))), "one azimuth, 90 degrees"),
])
def test_what_is_no_fan_is_refused(tmp_path, spoil, sentence):
    with pytest.raises(ValueError, match=sentence):
        plots.fan(spoil(beams(np.linspace(-60, 60, 31))), tmp_path / "a.png")
    with pytest.raises(ValueError, match="there is no ping 3"):
        plots.fan(beams(np.linspace(-60, 60, 31)), tmp_path / "a.png", ping=3)
    assert not list(tmp_path.iterdir())


def test_fans_that_lack_something_are_refused_in_a_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"the attribute frequency is \[\], not a number \[Hz\]"):
        plots.preview(fan().assign_attrs(frequency=[]), tmp_path / "a.png")
    with pytest.raises(ValueError, match="the record has no beam_x, the direction of its beams"):
        plots.preview(fan().drop_vars("beam_x"), tmp_path / "a.png")
    assert not list(tmp_path.iterdir())
