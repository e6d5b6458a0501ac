"""Beamformers as a room: labels in, labels out, plain words where something is missing; and the picture of a pattern.

The echo of the pattern is a plane wave on half a wavelength's line, whose beams are known in closed form; levels of
beams are tested elsewhere.
"""
import subprocess
import sys

import matplotlib.image
import numpy as np
import pytest
import xarray as xr

from mitsonar import plots
from mitsonar.plots.sheets import beams as beams_plot
from mitsonar.signal import beamforming
from mitsonar.sonar import beam_pattern, line_array

SOUND_SPEED, FREQUENCY, SAMPLING_RATE = 1500.0, 100e3, 20e3
WAVELENGTH = SOUND_SPEED / FREQUENCY
LOOK = beamforming.directions([-0.2, 0.0, 0.4])


def recording(position, *, pings=1, transmitters=1, samples=64, seed=1):
    """Make element signals of noise, at positions (E, 3)."""
    rng = np.random.default_rng(seed)
    shape = (pings, transmitters, len(position), samples)
    return xr.DataArray(
        rng.standard_normal(shape) + 1j * rng.standard_normal(shape), dims=("ping", "tx", "rx", "sample"), name="heard",
        coords={"time": ("sample", 0.01 + np.arange(samples) / SAMPLING_RATE), "ping": 10 + np.arange(pings),
                "heading": ("ping", 0.1 * np.arange(pings)),
                **{f"rx_{axis}": ("rx", column) for axis, column in zip("xyz", np.transpose(position), strict=True)}},
        attrs={"frequency": FREQUENCY, "sound_speed": SOUND_SPEED, "units": "µPa"})


def line(elements=8, pitch=0.5 * WAVELENGTH):
    return line_array(elements, pitch).position


FORMERS = {"delay_and_sum": lambda signals: beamforming.delay_and_sum(signals, LOOK),
           "fft_beams": lambda signals: beamforming.fft_beams(signals, "forward"),
           "fan_beams": lambda signals: beamforming.fan_beams(signals, "forward", beams=5),
           "mvdr": lambda signals: beamforming.mvdr(signals, LOOK)}


@pytest.mark.parametrize("form", FORMERS)
def test_beams_carry_their_labels(form):
    signals = recording(line(), pings=2)
    before = signals.copy(deep=True)
    beams = FORMERS[form](signals)
    assert beams.dims == ("ping", "beam", "sample") and beams.dtype == np.complex64
    assert beams.sizes["ping"] == 2 and beams.sizes["sample"] == 64
    np.testing.assert_array_equal(beams["time"], signals["time"])
    np.testing.assert_array_equal(beams["ping"], [10, 11])
    np.testing.assert_array_equal(beams["heading"], [0, 0.1])
    towards = beamforming.directions(beams["azimuth"], beams["elevation"])
    np.testing.assert_allclose(towards, np.column_stack([beams[f"beam_{axis}"] for axis in "xyz"]), atol=1e-12)
    assert beams.attrs == {**signals.attrs, "beamformer": form} and beams.name == "heard"
    assert signals.identical(before)


@pytest.mark.parametrize("form", FORMERS)
def test_order_of_dimensions_and_missing_ones_change_nothing(form):
    signals = recording(line())
    expected = FORMERS[form](signals)
    turned = FORMERS[form](signals.transpose("sample", "rx", "ping", "tx"))
    bare = FORMERS[form](signals.isel(ping=0, tx=0, drop=True))
    for other in (turned, bare):
        assert other.dims == expected.dims
        np.testing.assert_array_equal(other.values, expected.values)


def test_a_single_transmitter_counts_where_it_stands():
    signals = recording(line())
    place = {"tx_x": ("tx", [0.0]), "tx_y": ("tx", [0.5]), "tx_z": ("tx", [0.0])}
    for form in FORMERS.values():
        here, there = form(signals), form(signals.assign_coords(place))
        assert np.abs(here.values - there.values).max() > 0.01


def test_looking_at_one_ping_is_looking_at_it_among_others():
    signals = recording(line(), pings=3)
    for form in FORMERS.values():
        np.testing.assert_array_equal(form(signals).values[1:2], form(signals.isel(ping=[1])).values)


def test_directions_are_those_of_the_body():
    np.testing.assert_allclose(beamforming.directions(np.pi / 2), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(beamforming.directions(0.3, -np.pi / 2), [0, 0, 1], atol=1e-15)
    assert beamforming.directions(np.zeros((4, 1)), np.zeros(5)).shape == (4, 5, 3)


def test_fans_look_where_they_face():
    """A line to starboard that faces down: beams lie athwart, from port to starboard."""
    fan = beamforming.fan_beams(recording(line()), "down", beams=3, widest=np.radians(30))
    np.testing.assert_allclose(np.column_stack([fan[f"beam_{axis}"] for axis in "xyz"]),
                               [[0, -0.5, np.sqrt(0.75)], [0, 0, 1], [0, 0.5, np.sqrt(0.75)]], atol=1e-12)
    np.testing.assert_allclose(fan["sine"], [-0.5, 0, 0.5])
    np.testing.assert_allclose(np.degrees(fan["angle"]), [-30, 0, 30])


def test_one_beam_and_one_element_do():
    one = recording(np.zeros((1, 3)))
    beam = beamforming.delay_and_sum(one, [1, 0, 0])
    np.testing.assert_allclose(beam.values[0, 0], one.values[0, 0, 0], atol=0.01)
    assert beamforming.fan_beams(recording(line()), "forward", beams=1)["sine"].values == [0]


def test_a_focus_outside_the_record_is_silent():
    points = [[1.0, 0, 0], [1e4, 0, 0], [9.0, 0, 0]]
    values = beamforming.focus(recording(line()), points).values[0]
    assert values[0] == values[1] == 0 != values[2]


BENT, TWINS = line().copy(), line().copy()
BENT[3, 0] += 0.2 * WAVELENGTH
TWINS[4] = TWINS[3]
FANS = [lambda signals: beamforming.fft_beams(signals, "forward"),
        lambda signals: beamforming.fan_beams(signals, "forward"), FORMERS["mvdr"],
        lambda signals: beamforming.delay_and_sum(signals, LOOK, window="hann")]


@pytest.mark.parametrize("form", FANS)
@pytest.mark.parametrize(("position", "words"), [
    (BENT, r"element 3 stands .* wavelengths\) off its place: use delay_and_sum"),
    (TWINS, r"rx elements 3 and 4 coincide at .*; move or drop|rx elements 3 and 4 coincide at .*: move or drop")])
def test_a_fan_needs_a_pitch(form, position, words):
    with pytest.raises(ValueError, match=words):
        form(recording(position))


@pytest.mark.parametrize("form", [beamforming.fft_beams, beamforming.fan_beams])
def test_grating_lobes_in_a_fan_are_refused(form):
    coarse = recording(line(8, 0.8 * WAVELENGTH))
    with pytest.raises(ValueError, match=r"rx element spacing is 0.012 m = 0.8 wavelengths at 100 kHz; a grating lobe "
                                         r"enters the fan when steered past 14.5°, and beams reach 60°. Use spacing "
                                         r"<= 0.0080 m or narrow the fan."):
        form(coarse, "forward")
    assert np.degrees(np.abs(form(coarse, "forward", widest=np.radians(14.4))["angle"]).max()) <= 14.5
    with pytest.raises(ValueError, match="grating lobes stand in the fan wherever it is steered"):
        form(recording(line(8, 1.2 * WAVELENGTH)), "forward", widest=0.1)


def without(name):
    signals = recording(line())
    signals = signals.drop_vars(name, errors="ignore")
    signals.attrs.pop(name, None)
    return signals


def uneven():
    signals = recording(line())
    return signals.assign_coords(time=("sample", signals["time"].values ** 2))


def holed():
    signals = recording(line())
    signals[0, 0, 0, 3] = np.nan
    return signals


@pytest.mark.parametrize(("signals", "words"), [
    (without("frequency"), r"no attribute 'frequency'"),
    (without("sound_speed"), r"no attribute 'sound_speed'"),
    (recording(line()).assign_attrs(sound_speed=-3.0), r"'sound_speed' .* is -3.0; give a finite number > 0"),
    (without("time"), r"no coordinate 'time' over sample"),
    (without("rx_y"), r"8 rx have no coordinate rx_y; give the positions"),
    (recording(line(), transmitters=2), r"2 tx have no coordinate tx_x, tx_y, tx_z"),
    (recording(line()).rename(rx="element"), r"dimensions .*'element'"),
    (recording(line()).real, r"float64; a beamformer takes complex baseband"),
    (recording(line()).isel(sample=[0]), r"1 sample; a beamformer needs at least 2"),
    (recording(line()).isel(rx=[]), r"signals are empty"),
    (uneven(), r"'time' .* does not rise in equal steps"),
    (holed(), r"hold NaN or infinite samples"),
    (recording(line() * np.nan), r"positions rx_x, rx_y, rx_z .* not all finite"),
])
@pytest.mark.parametrize("form", [*FORMERS.values(), lambda signals: beamforming.focus(signals, LOOK),
                                  lambda signals: beamforming.backproject(signals, LOOK)])
def test_signals_that_lack_something_are_refused(form, signals, words):
    with pytest.raises(ValueError, match=words):
        form(signals)


PLAIN = recording(line())
SEVERAL = recording(line(), transmitters=2).assign_coords({f"tx_{axis}": ("tx", [0.0, 0.1]) for axis in "xyz"})
MOVED = recording(line(), pings=2).assign_coords(rx_x=(("ping", "rx"), np.arange(2.0)[:, None] + np.zeros(8)))


@pytest.mark.parametrize(("call", "words"), [
    (lambda: beamforming.delay_and_sum(PLAIN, [[0, 0, 0]]), r"direction 0 is .*; give a finite vector that is not"),
    (lambda: beamforming.delay_and_sum(PLAIN, np.zeros((0, 3))), r"shape \(0, 3\); give \(beams, 3\)"),
    (lambda: beamforming.delay_and_sum(PLAIN, LOOK, window=[1, 2]), r"weights have shape \(2,\); give 8"),
    (lambda: beamforming.delay_and_sum(PLAIN, LOOK, window=np.zeros(8)), r"add to 0, so no beam has a gain"),
    (lambda: beamforming.delay_and_sum(PLAIN, LOOK, window="box"), r'window is "box".*; give one of'),
    (lambda: beamforming.delay_and_sum(PLAIN, LOOK, interpolation="cubic"), r"choose one of linear, band_limited"),
    (lambda: beamforming.focus(PLAIN, [[1, 2]]), r"points to focus at have shape \(1, 2\)"),
    (lambda: beamforming.focus(PLAIN, [[1, 2, 3], [1, 2, np.inf]]), r"point 1 to focus at is not finite"),
    (lambda: beamforming.fan_beams(PLAIN, "ahead"), r'facing is "ahead"; give one of forward'),
    (lambda: beamforming.fan_beams(PLAIN, "starboard"), r"stands at 0° to the line .* perpendicular"),
    (lambda: beamforming.fan_beams(PLAIN, "down", beams=0), r"fan of 0 beams"),
    (lambda: beamforming.fan_beams(PLAIN, "down", widest=2.0), r"reach 114.6° from broadside"),
    (lambda: beamforming.fft_beams(PLAIN, "down", size=7), r"FFT of 7 is shorter than the line of 8"),
    (lambda: beamforming.fft_beams(SEVERAL, "down"), r"2 transmitters; a far-field fan takes one"),
    (lambda: beamforming.fan_beams(MOVED, "down"), r"change their positions from ping to ping"),
    (lambda: beamforming.mvdr(SEVERAL, LOOK), r"2 transmitters; mvdr takes one"),
    (lambda: beamforming.mvdr(PLAIN, LOOK, subarray=9), r"subarray of 9 elements .* the line has 8"),
    (lambda: beamforming.mvdr(PLAIN, LOOK, half_width=-1), r"half_width is -1 samples"),
    (lambda: beamforming.mvdr(PLAIN, LOOK, loading=0.0), r"loading is 0.0; give a number > 0"),
    (lambda: beamforming.fan_beams(recording(np.zeros((1, 3))), "down"), r"the array has 1 element"),
])
def test_arguments_that_make_no_sense_are_refused(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_beamforming_needs_no_mitsuba():
    code = ("import sys, mitsonar; from mitsonar.signal import beamforming; import numpy as np, xarray as xr\n"
            "signals = xr.DataArray(np.ones((2, 8), complex), dims=('rx', 'sample'), coords={'time': ('sample', "
            "np.arange(8) / 1e4), **{f'rx_{a}': ('rx', np.array([0, 1.0])) for a in 'xyz'}}, "
            "attrs={'frequency': 1e5, 'sound_speed': 1500.0})\n"
            "assert beamforming.delay_and_sum(signals, [1, 0, 0]).shape == (1, 1, 8)\n"
            "assert 'mitsuba' not in sys.modules")
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(filter(None, sys.path))})


# ------------------------------------------------------------------ the picture

def pattern(elements=16):
    """Beams of a plane wave from 20° starboard, and the closed form."""
    array = line_array(elements, 0.5 * WAVELENGTH)
    look = beamforming.directions(np.radians(np.linspace(-80, 80, 321)))
    came = beamforming.directions(np.radians(20.0))
    signals = recording(array.position)
    turned = np.exp(2j * np.pi * array.position @ came / WAVELENGTH)
    signals = signals.copy(data=np.broadcast_to(turned[None, None, :, None], signals.shape) + 0j)
    signals = signals.assign_coords(time=signals["time"] + 100)              # far off, where waves are plane
    delays = array.steered(came, SOUND_SPEED)
    return beamforming.delay_and_sum(signals, look), beam_pattern(delays, look, WAVELENGTH, SOUND_SPEED)


def test_beams_follow_the_pattern_of_the_array_record():
    beams, expected = pattern()
    found = np.abs(beams.values[0, :, 32])
    np.testing.assert_allclose(found, np.abs(expected), atol=2e-3)


def test_levels_drawn_are_those_of_the_strongest_sample_or_the_one_asked_for():
    values = np.zeros((1, 3, 4), complex)
    values[0, :, 1], values[0, :, 3] = (1, 2, 0.2), (4j, 1, 0.4)
    azimuth = np.radians([10.0, 5.0, -5.0])
    beams = xr.DataArray(values, dims=("ping", "beam", "sample"),
                         coords={"time": ("sample", np.arange(4.0)), "azimuth": ("beam", azimuth)})
    angle, level, expected = beams_plot._levels(beams, None, "azimuth", 0, None)
    np.testing.assert_allclose(angle, [-5, 5, 10])
    np.testing.assert_allclose(level, [-20, 20 * np.log10(0.25), 0])
    assert expected is None
    _, level, expected = beams_plot._levels(beams, [3, 6, 0.6], "azimuth", 0, 1.1)
    np.testing.assert_allclose(level, [-20, 0, 20 * np.log10(0.5)])
    np.testing.assert_allclose(expected, level)


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_a_pattern_is_drawn_with_its_closed_form(suffix, tmp_path):
    beams, expected = pattern()
    middle = float(beams["time"][32])
    plots.beam_pattern(beams, tmp_path / f"a.{suffix}", expected=expected, time=middle, title="16 elements")
    plots.beam_pattern(beams, tmp_path / f"b.{suffix}")
    sizes = [(tmp_path / f"{name}.{suffix}").stat().st_size for name in "ab"]
    assert min(sizes) > 3000 and sizes[0] != sizes[1]
    if suffix == "png":
        assert matplotlib.image.imread(tmp_path / "a.png").std() > 0.05


@pytest.mark.parametrize(("change", "options", "words"), [
    (lambda beams: beams.isel(ping=0), {}, r"drawn of beams \(ping, beam, sample\)"),
    (lambda beams: beams, {"along": "angle"}, r"no coordinate 'angle'; choose one of beam_x"),
    (lambda beams: beams, {"ping": 1}, r"no ping 1; there are 1"),
    (lambda beams: beams * 0, {}, r"all beams of ping 0 are silent"),
    (lambda beams: beams, {"expected": [1, 2]}, r"closed form has shape \(2,\); give 321"),
    (lambda beams: beams, {"path": "a.gif"}, r"must end in .png, .pdf or .svg"),
])
def test_patterns_that_cannot_be_drawn_are_refused(change, options, words, tmp_path):
    path = tmp_path / options.get("path", "a.png")
    with pytest.raises(ValueError, match=words):
        plots.beam_pattern(change(pattern()[0]), path, **{k: v for k, v in options.items() if k != "path"})
    assert not list(tmp_path.iterdir())
