"""The fan seen from above: a bright echo is drawn where it lies, and what is no fan is refused."""
import numpy as np
import pytest
import xarray as xr

from mitsonar import plots
from mitsonar.plots import fans as room


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
    azimuth, slant_range, level, *_ = room._levels(data, 0)
    (left, right, bottom, top), image = room._from_above(azimuth, slant_range, level)
    row, column = np.argwhere(image == np.nanmax(image)).mean(0)              # the middle of the beam's patch
    step = (right - left) / image.shape[1]
    x, y = left + (column + 0.5) * step, bottom + (row + 0.5) * step
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
