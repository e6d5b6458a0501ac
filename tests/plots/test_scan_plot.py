"""Turns of a rotating head as pictures: which steps they have, and where these lie."""
import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

from mitsonar import plots
from mitsonar.plots.fans.fans import is_scan, turn_of

STEPS, BINS = 36, 50


def scan(turns=2, mount="down", bright_deg=90.0):
    """Turns all around, 10 degrees a step; of each the step at one bearing is bright from 5 to 8 m, and an object."""
    bearing = np.tile(np.deg2rad(np.arange(-180, 180, 360 / STEPS)), turns)
    pings = len(bearing)
    level, label = np.full((pings, BINS), 60.0, np.float32), np.ones((pings, BINS), np.uint32)
    slant_range = (np.arange(BINS) + 0.5) * 0.2
    bright = np.isclose(bearing, np.deg2rad(bright_deg))[:, None] & (slant_range > 5) & (slant_range < 8)
    level[bright], label[bright] = 120.0, 2
    dims = ("ping", "range")
    share = np.stack([label == 1, label == 2]).astype(np.float32)
    return xr.Dataset(
        {"level": (dims, level), "label": (dims, label), "share": (("shape", *dims), share),
         "object_shadow": (dims, np.zeros_like(label))},
        {"ping": np.arange(pings), "bearing": ("ping", bearing), "turn": ("ping", np.repeat(np.arange(turns), STEPS)),
         "ping_time": ("ping", 0.03 * np.arange(pings)), "altitude": ("ping", np.linspace(2, 4, pings)),
         "range": slant_range, "shape": ["seabed", "crate.1"]},
        {"sonar": "sector_scan", "mount": mount, "frequency": 750e3, "labels": {"1": "seabed", "2": "crate.1"},
         "objects": {"2": {"class": "crate"}}})


def test_a_turn_is_a_fan_of_its_steps():
    fan = turn_of(scan(turns=3), ping=40)
    assert fan["level"].dims == ("ping", "beam", "range") and fan.sizes["ping"] == 1
    assert fan["turn"].item() == 1 and fan["ping"].item() == STEPS and fan["ping_time"].item() == pytest.approx(1.08)
    np.testing.assert_allclose(fan["beam"], np.deg2rad(np.arange(-180, 180, 10)))
    assert fan["altitude"].item() == pytest.approx(np.linspace(2, 4, 108)[36:72].mean())
    np.testing.assert_array_equal(fan["level"].values[0], scan(3)["level"].values[36:72])


def test_a_scan_is_told_from_other_records():
    assert is_scan(scan())
    assert not is_scan(scan().drop_vars("bearing"))
    assert not is_scan(turn_of(scan()))
    assert not is_scan(scan().isel(ping=[0]))            # drawn as the row that it is


@pytest.mark.parametrize("ping, pings, words", [(72, 72, "there is no ping 72; there are 72"),
                                                (36, 37, "no other ping")])
def test_turns_that_there_are_not_are_refused(ping, pings, words):
    with pytest.raises(ValueError, match=words):
        turn_of(scan().isel(ping=slice(0, pings)), ping)


@pytest.mark.parametrize("bright_deg, right, up", [(90.0, 1, 0), (0.0, 0, 1), (-90.0, -1, 0), (-180.0, 0, -1)])
def test_bearings_lie_clockwise_from_straight_up(tmp_path, bright_deg, right, up):
    """The brightest colour lies 6.5 of 10 m from the middle; axes and legend are not that bright in all colours."""
    plots.plot(scan(bright_deg=bright_deg), "waterfall", tmp_path / "turn.png", tvg=None, colours="grey")
    picture = imread(tmp_path / "turn.png")[..., :3].mean(-1)
    fan = picture[86:986, 84:984]
    rows, columns = np.nonzero(fan > 0.97)
    assert (columns.mean() - 450) / 450 == pytest.approx(0.65 * right, abs=0.03)
    assert (450 - rows.mean()) / 450 == pytest.approx(0.65 * up, abs=0.03)


@pytest.mark.parametrize("what", ["labels", "objects"])
def test_labels_and_objects_of_a_turn_are_drawn(tmp_path, what):
    plots.plot(scan(mount="forward"), what, tmp_path / "turn.png", ping=50)
    picture = imread(tmp_path / "turn.png")[..., :3]
    at = picture[86 + 450 - 8:86 + 450 + 8, 84 + 450 + 280:84 + 450 + 305].reshape(-1, 3)
    before = picture[86 + 450 - 8:86 + 450 + 8, 84 + 450 + 100:84 + 450 + 125].reshape(-1, 3)
    assert np.abs(at.mean(0) - before.mean(0)).max() > 0.1
