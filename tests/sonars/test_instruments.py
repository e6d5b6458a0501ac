"""Presets of instruments: every figure has a source or a rule, rules hold, sonars are planned as stated.

All presets are planned; rendered is one of every kind, in a small frame. Points, boxes and shadows of every preset run
with the exhaustive tests (`test_imaging_sonars.py`).
"""
import re

import numpy as np
import pytest
import sonar_scenes as scenes
from imaging_kinds import _line_width
from scipy.optimize import brentq
from scipy.special import j1

import mitsonar
from mitsonar.sonar.preset_tables import FIGURES, TABLES, classes, instruments, left_out, presets, sources
from mitsonar.validation.scenes import bed

SPEED = 1500.0
ALL = {one.name: one for kind in TABLES for one in instruments(kind).values()}
every = pytest.mark.parametrize("name", ALL)
FIRST = {one.kind: one.name for one in reversed(ALL.values())}
SMALL = {"forward_looking": {"beams": 33, "tilt_deg": 40.0}, "multibeam": {"beams": 33},
         "sector_scan": {"sector_deg": 9.0, "tilt_deg": 40.0}}


def made(name, sensor=None, depth=2.0, **parts):
    """Load a scene of an instrument over a level bed at 18 m."""
    build = getattr(scenes, ALL[name].kind)
    return build({"bed": bed(18.0, size=300.0)}, sensor={"preset": name, **(sensor or {})}, depth=depth, **parts)


def planned(name):
    """Plan a run of an instrument to 20 m, and return the sensor and the survey."""
    scene = made(name, {"tilt_deg": 0.0} if ALL[name].kind == "forward_looking" else {}, film={"range": 20.0})
    sensor = scene.sensors()[0]
    return sensor, scene.integrator().survey(scene, sensor)


# ---- the tables

def test_there_are_more_than_twenty_instruments_with_names_of_their_own():
    every_name = [name for kind in TABLES for name in presets(kind)]
    assert len(set(every_name)) == len(every_name) and all(re.fullmatch("[a-z][a-z0-9_]+", name) for name in every_name)
    assert len({re.sub(r"(_\d+khz)$", "", name) for name in ALL}) >= 20
    assert not set(left_out()) & {one.title for one in ALL.values()} and all(map(len, left_out().values()))


@every
def test_every_figure_has_a_source_and_stands_once(name):
    one = ALL[name]
    own = {*one.attributes, *one.published}
    assert own == set(one.source) and one.like in classes(one.kind) and one.title
    assert set(one.source.values()) <= set(sources()) and set(one.published) <= set(FIGURES)
    assert any("rule" not in sources()[key] for key in one.source.values())


def test_no_source_is_idle_and_documents_can_be_found():
    used = {key for one in ALL.values() for key in one.source.values()}
    assert used == set(sources())
    for entry in sources().values():
        assert set(entry) in ({"rule"}, {"title", "date", "address"})
        assert "rule" in entry or entry["address"].startswith("http")


def test_a_figure_written_below_two_sources_is_refused():
    from mitsonar.sonar.preset_tables import _instrument

    entry = {"title": "A", "like": "towed_400khz", "one": {"frequency_khz": 1.0}, "two": {"frequency_khz": 2.0}}
    with pytest.raises(ValueError, match="frequency_khz of the instrument a stands below two sources, one and two"):
        _instrument("a", "sidescan", entry)


# ---- rules, and figures that belong together

@every
def test_what_follows_by_a_rule_follows(name):
    """To the four digits that the tables have, and the nearest whole element."""
    one = ALL[name]
    value = {**presets(one.kind)[name], **one.published}
    ruled = {field: key for field, key in one.source.items() if key.startswith("rule_")}
    for field, key in ruled.items():
        if key == "rule_aperture":
            wanted = 1.125 / np.deg2rad(value["angular_resolution_deg"]) / value["element_spacing"]
            assert value[field] == round(wanted)
        elif key == "rule_spacing":
            assert value[field] < 1 / (1 + np.sin(np.deg2rad(0.5 * value["fan_deg"])))
        else:
            wanted = {"rule_bandwidth": lambda: SPEED / 2 / value["range_resolution"] / 1000,
                      "rule_pulse": lambda: 2000 * value["range_resolution"] / SPEED,
                      "rule_band": lambda: 1 / (value["highest_frequency_khz"] - value["lowest_frequency_khz"]),
                      "rule_jitter": lambda: value["beam_width_deg"] / 10,
                      "rule_level": lambda: 170.8 + 10 * np.log10(value["max_power"]) + value["gain_db"]}[key]()
            assert value[field] == pytest.approx(wanted, rel=5e-4)


@every
def test_frequencies_ranges_and_resolutions_of_an_instrument_fit_together(name):
    one = ALL[name]
    value = {**presets(one.kind)[name], **one.published}
    frequency = np.atleast_1d(value["frequency_khz"])
    low, high = value.get("lowest_frequency_khz", 0.0), value.get("highest_frequency_khz", np.inf)
    assert (frequency >= low).all() and (frequency <= high).all()
    assert value.get("min_range", 0.0) < value.get("max_range", np.inf)
    if "max_rate_hz" in value and "min_range" in value:               # a ping's echoes end before the next one
        assert value["max_rate_hz"] < SPEED / (2 * value["min_range"])
    if one.kind == "forward_looking":                                  # a band of at most 40 % about the carrier
        assert one.attributes.get("bandwidth_khz", 0.0) <= 0.4 * value["frequency_khz"]
    if "beam_step_deg" in value:
        assert value["fan_deg"] / (value["beams"] - 1) == pytest.approx(value["beam_step_deg"], rel=0.1)


def test_published_apertures_make_the_published_beams():
    """A line of even weights is 0.886 λ / L wide: the 256 elements of 1.6 mm of a SeaBat 7125, within 2 %."""
    one = ALL["seabat_7125"]
    wide = np.rad2deg(0.886 * SPEED / 400e3 / one.published["array_length"])
    assert one.attributes["receive_beam_width_deg"] == pytest.approx(wide, rel=0.02)
    assert one.published["array_length"] == pytest.approx(one.attributes["beams"] * 1.6e-3)


def test_two_way_widths_are_those_of_the_one_way_beams():
    """sinc⁴ of a face whose sinc² is 0.8 degrees wide: 0.58; the page says 0.5, rounded to a digit, and its transmit
    face may be shorter than its receive face: within 20 %."""
    one = ALL["cerulean_os3d_450ss"]
    two, single = (brentq(lambda x, power=power: np.sinc(x) ** power - 0.5, 1e-3, 0.99) for power in (4, 2))
    found = one.attributes["beam_width_deg"] * two / single
    assert found == pytest.approx(one.published["two_way_beam_width_deg"], rel=0.2)


@pytest.mark.parametrize("name", [name for name, one in ALL.items() if one.kind == "echo_sounder"])
def test_transducers_have_the_equivalent_beam_angle_of_their_disc(name):
    """10 log 5.78 / (ka)², where 2 J1(ka sin θ)/(ka sin θ) has half power at half the width; published: 0.2 dB."""
    half = np.deg2rad(0.5 * presets("echo_sounder")[name]["beam_width_deg"])
    ka = brentq(lambda x: 2 * j1(x) / x - 0.5 ** 0.5, 1.0, 2.5) / np.sin(half)
    assert 10 * np.log10(5.78 / ka ** 2) == pytest.approx(ALL[name].published["equivalent_beam_angle_db"], abs=0.2)


# ---- what is planned of them

@every
def test_an_instrument_is_planned_as_stated(name):
    """Carrier, number of beams, and widths of what is built: lines have whole elements, so their widths step by 2 %."""
    one, (sensor, survey) = ALL[name], planned(name)
    own = presets(one.kind)[name]
    assert sensor.frequency == pytest.approx(1e3 * np.atleast_1d(own["frequency_khz"])[0])
    if one.kind == "forward_looking":
        assert sensor.beams == own["beams"] and sensor.receive.elements == own["receive_elements"]
        assert np.rad2deg(sensor.fan_width) == pytest.approx(own["fan_deg"])
        if "angular_resolution_deg" in one.published:                  # flaws of receivers are not in their weights
            assert np.rad2deg(_line_width(sensor)) == pytest.approx(one.published["angular_resolution_deg"], rel=0.02)
        if "range_resolution" in one.published:
            assert SPEED / 2 / sensor.pulse.bandwidth >= 0.999 * one.published["range_resolution"]
    elif one.kind == "multibeam":
        assert sum(len(sector.beams) for sector in sensor.sectors) == own["beams"] * own["swaths"]
        assert np.rad2deg(_line_width(sensor)) == pytest.approx(own["receive_beam_width_deg"], rel=0.02)
        reach = np.rad2deg(max(np.abs(sector.beams).max() for sector in sensor.sectors))
        assert reach == pytest.approx(0.5 * own["swath_deg"], rel=1e-6)
    elif one.kind == "sidescan":
        widths = survey.sonar.transmit.beam_widths(survey.sonar.wavelength)
        assert np.rad2deg(widths) == pytest.approx((own["beam_width_deg"], own["vertical_beam_width_deg"]), rel=1e-9)
    elif one.kind == "sector_scan":
        assert np.rad2deg(sensor.beam_widths) == pytest.approx((own["beam_width_deg"], own["vertical_beam_width_deg"]))
        assert sensor.head.sweep.pings_per_turn == round(360 / own["step_deg"])
    elif one.kind == "echo_sounder":
        assert sensor.quadrants is not None and sensor.quadrants.elements == 4
    elif one.kind == "interferometric":
        assert sensor.receive[0].elements == one.published["staves"]


@pytest.mark.parametrize("kind", FIRST)
def test_a_frame_of_an_instrument_shows_the_bed(kind):
    """The bed 16 m below, or what the sonar sees of it: finite levels, brightest no nearer than the bed is."""
    name = FIRST[kind]
    lines = kind in ("forward_looking", "multibeam")                  # beams of lines of elements
    film = {"range": 30.0, **({} if lines else {"bins": 150}), **({"range_min": 20.0} if "forward" in kind else {})}
    image = mitsonar.render(made(name, SMALL.get(kind), film=film, integrator={"rays": 2000, **(
        {"cell": 1.0} if lines else {})}))
    level, distance = image["level"], image["range"].values
    assert np.isfinite(level.values).all() and image.attrs["frequency"] == pytest.approx(
        1e3 * np.atleast_1d(presets(kind)[name]["frequency_khz"])[0])
    loudest = level.max([dim for dim in level.dims if dim != "range"]).values
    assert distance[np.argmax(loudest)] >= 15.5 and loudest[distance < 15.0].max(initial=-np.inf) < loudest.max() - 10
