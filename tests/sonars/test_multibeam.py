"""Soundings of multibeam echo sounders against the bed that is there.

On a level bed H below the arrays, in water of one sound speed, a beam at θ from the vertical is right where
c t cos θ / 2 = H. Detection by phase is unbiased; its spread grows towards the outer beams (Lurton 2010, ch. 8). The
sounder moves as a launch does, so arrays, times and attitudes of both legs differ from each other.
"""
import functools
import warnings

import numpy as np
import pytest
from sonar_scenes import bed, multibeam, sediment

import mitsonar
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.hydrography.reduction.smile import smile_of_head, smile_of_profile
from mitsonar.verbs.images import sounded_pings
from mitsonar.water import SoundSpeedProfile

H, SONAR = 30.0, 2.0
LAUNCH = {"motion": "hull", "speed_knots": 6.0, "pings": 8, "ping_rate_hz": 4.0}
WIDE = {"beams": 128, "swath_deg": 130.0, "receive_beam_width_deg": 1.5, "transmit_beam_width_deg": 1.5}
FEW = {"beams": 32, "receive_beam_width_deg": 4.0}
THREE = {"preset": "shallow_300khz_three_sectors", "pulse_ms": "0.2, 0.15, 0.2", **WIDE}


def sounded(shapes=None, *, sensor=None, water=None, film=None, profile=None, **more):
    """The soundings of a scene on the move."""
    scene = multibeam(shapes or {"seabed": bed(SONAR + H, sediment("medium sand"))}, depth=SONAR, water=water,
                      sensor={"noise": True, **LAUNCH, **(sensor or {})}, film={"range": 85.0, **(film or {})})
    return mitsonar.soundings(scene, profile=profile, **more)


@functools.cache
def level(preset):
    return sounded(sensor=THREE if "three" in preset else {"preset": preset, "bandwidth_khz": 10.0, **WIDE})


def by_angle(line, name, step=20.0):
    """A variable's valid values in sectors of the angle [degrees]: (middle, values) each."""
    angle, valid = np.rad2deg(line["angle"].values), line["valid"].values
    values = line[name].values
    for low in np.arange(-70.0, 70.0, step):
        some = valid & (angle >= low) & (angle < low + step)
        if some.sum() > 30:
            yield low + 0.5 * step, values[some]


@pytest.mark.parametrize("preset", ["shallow_300khz_three_sectors", "shallow_350khz"])
def test_soundings_of_a_level_bed_are_right_across_the_swath(preset):
    """To a ten-thousandth of the depth, 3 mm, and what hundreds of soundings leave of their spread; asked is 0.1 %."""
    line = level(preset)
    assert line["valid"].values.mean() > 0.99
    for angle, off in by_angle(line, "error_detection"):
        allowed = 1e-4 * H + 4 * off.std() / np.sqrt(len(off) / 4)             # neighbours share a footprint
        assert abs(off.mean()) < allowed, angle
        assert off.std() < 1e-3 * H


def test_errors_by_cause_add_up_to_the_error():
    line = level("shallow_300khz_three_sectors")
    total = sum(line[f"error_{cause}"] for cause in ("detection", "refraction", "motion"))
    np.testing.assert_allclose(total, line["error"], atol=1e-9)
    np.testing.assert_allclose(line["depth"] - line["true_depth"], line["error"], atol=1e-9)
    np.testing.assert_allclose(line["true_depth"].values[line["valid"].values], SONAR + H, atol=1e-4)


def test_the_spread_is_what_the_quality_says():
    """Within a third, by sectors of the angle: a spread of 60 correlated soundings is itself known to a tenth."""
    line = level("shallow_300khz_three_sectors")
    said = (line["travel_time"] * 10.0 ** -line["quality"] * 750.0 * np.cos(line["angle"])).values
    line = line.assign(said=(("ping", "beam"), said))
    for (angle, off), (_, expected) in zip(by_angle(line, "error_detection"), by_angle(line, "said")):
        assert off.std() < 1.33 * np.sqrt(np.mean(expected ** 2)), angle


def test_bottom_strength_is_that_of_the_law():
    """Means of hundreds of speckled echoes: 0.2 dB of chance, and 0.5 dB are allowed in all."""
    line = level("shallow_300khz_three_sectors")
    ratio = 10 ** ((line["backscatter_db"] - line["true_backscatter_db"]) / 10)
    for angle, some in by_angle(line.assign(ratio=ratio), "ratio"):
        assert abs(10 * np.log10(np.nanmean(some))) < 0.5, angle


@functools.cache
def slope():
    return sounded({"seabed": bed(SONAR + H, sediment("medium sand"), tilt=np.deg2rad(12.0))}, sensor=THREE,
                   film={"range": 140.0}, seed=1)


def test_a_slope_is_sounded_as_it_is():
    line = slope()
    valid = line["valid"].values
    assert valid.mean() > 0.97
    fitted = np.polyfit(line["x"].values[valid], line["depth"].values[valid], 1)
    assert np.rad2deg(np.arctan(fitted[0])) == pytest.approx(12.0, abs=0.02)
    for angle, off in by_angle(line, "error_detection"):
        assert abs(off.mean()) < 2e-4 * H + 4 * off.std() / np.sqrt(len(off) / 4), angle


def test_outer_beams_of_a_slope_say_how_well_they_know_the_depth():
    """Errors over the uncertainty, rms, where the bed rises and where it falls: 130 soundings a side, of which some 60
    stand for themselves, tell it to a tenth. Without the slope it was 1.54 where the bed rises.
    """
    line = slope()
    angle, score = np.rad2deg(line["angle"].values), (line["error_detection"] / line["uncertainty"]).values
    for side in (-1, 1):
        outer = line["valid"].values & (side * angle > 55) & (side * angle < 64)
        assert 0.7 < np.sqrt(np.mean(score[outer] ** 2)) < 1.35, side


# ---- water: another profile, another sound speed of the head

WATER = {"profile": "0:1512, 8:1511, 14:1501, 20:1494, 40:1492"}
ANOTHER = SoundSpeedProfile([0, 6, 12, 20, 40], [1505, 1504, 1497, 1490, 1488])


@functools.cache
def in_wrong_water():
    """Still, but for its speed."""
    return sounded(sensor={**THREE, "motion": "none"}, water=WATER, profile=ANOTHER)


def compared(line, error, theory):
    """Medians of an error about some places across track, and what theory says there."""
    across, valid = line["across_track"].values, line["valid"].values
    places = np.array([-50, -40, -30, -20, -10, 0, 10, 20, 30, 40, 50.0])
    found = [np.median(error[valid & (np.abs(across - one) < 1.0)]) for one in places]
    expected = theory(places)
    assert np.ptp(expected) > 0.05
    np.testing.assert_allclose(found, expected, atol=0.05 * np.ptp(expected))


def test_the_wrong_profile_makes_the_smile_of_ray_theory():
    """Within 5 % of the smile's size."""
    line = in_wrong_water()
    head = float(line["head_sound_speed"].values[0])
    true = SoundSpeedProfile(line["true_cast_depth"].values, line["true_cast_sound_speed"].values)
    compared(line, line["error_refraction"].values, lambda across: smile_of_profile(
        true.with_node(SONAR, head), ANOTHER.with_node(SONAR, head), SONAR, SONAR + H, across).depth_error)


def test_angles_read_with_a_wrong_speed_of_the_head_make_the_smile_of_ray_theory():
    """Within 5 % of its size: beams of right sines, read with 4 m/s too much."""
    line = in_wrong_water()
    head = float(line["head_sound_speed"].values[0])
    used = SoundSpeedProfile(line["cast_depth"].values, line["cast_sound_speed"].values)
    anew = resounded(line, head_speed=head + 4.0)


    def expected(across):
        before, after = (used.with_node(SONAR, speed) for speed in (head, head + 4.0))
        wrong = smile_of_head(before, 4.0, SONAR, SONAR + H, across)
        node = smile_of_profile(before, after, SONAR, SONAR + H, across)
        return wrong.depth_error + node.depth_error

    compared(line, (anew["depth"] - line["depth"]).values, expected)


def test_a_head_that_steers_by_a_wrong_speed_keeps_the_slowness_of_what_it_hears():
    """Depths are wrong by the node's layer alone: far less than by angles read wrongly."""
    line = sounded(sensor={**THREE, "motion": "none", "head_speed_error": 4.0, "pings": 4}, water=WATER)
    assert float(line["head_sound_speed"].values[0]) == pytest.approx(1512 - 2 / 8 + 4, abs=1e-6)
    across, valid = line["across_track"].values, line["valid"].values
    outer = line["error_refraction"].values[valid & (np.abs(across) > 45)]
    assert np.abs(np.median(outer)) < 0.1 * np.abs(smile_of_head(
        SoundSpeedProfile([0, 8, 14, 20, 40], [1512, 1511, 1501, 1494, 1492]), 4.0, SONAR, SONAR + H,
        50.0).depth_error)


def test_a_bias_of_the_roll_sensor_tilts_the_swath():
    """A depth y tan(bias) deeper to the side thought to be lower; 2 % for the angle's own size."""
    line = sounded(sensor={**THREE, "roll_bias_deg": 0.5, "pings": 4})
    valid = line["valid"].values & (np.abs(line["across_track"].values) > 10)
    slope = line["error_motion"].values[valid] / line["across_track"].values[valid]
    assert np.median(slope) == pytest.approx(np.tan(np.deg2rad(0.5)), rel=0.02)


# ---- sectors, stabilisation, heads

SWINGING = {"motion": "none", "pings": 3, "ping_rate_hz": 0.5, "pulse_ms": "0.2", "noise": False}


def test_beams_keep_their_angles_while_the_platform_rolls():
    """Without compensation they swing with it."""
    swings = {}
    for kept in (True, False):
        line = sounded(sensor={**FEW, **SWINGING, "roll_deg": 3.0, "roll_stabilised": kept})
        swings[kept] = float(np.ptp(line["across_track"].values[:, 3]))
    assert swings[True] < 0.2 and swings[False] > 2.0


def test_transmissions_stay_under_the_platform_while_it_pitches():
    along = {}
    for kept in (True, False):
        line = sounded(sensor={**FEW, **SWINGING, "pitch_deg": 3.0, "pitch_stabilised": kept})
        along[kept] = np.ptp(line["along_track"].values[:, 16])
    assert along[True] < 0.01 and along[False] > 0.4


def test_sectors_have_their_own_frequency_time_and_absorption():
    line = level("shallow_300khz_three_sectors")
    np.testing.assert_allclose(line["sector_frequency"].values[0], [260e3, 300e3, 320e3])
    np.testing.assert_allclose(line["sector_delay"].values[0], [0.0, 2e-4, 1e-4])
    sector, angle = line["sector"].values[0], np.rad2deg(line["angle"].values[0] + line["ping_roll"].values[0])
    assert (np.diff(sector) >= 0).all() and set(sector) == {0, 1, 2}
    assert [angle[sector == 1].min(), angle[sector == 1].max()] == pytest.approx([-36, 36], abs=2)


def test_two_swaths_a_ping_lie_a_step_apart():
    line = sounded(sensor={"preset": "shelf_80khz", "beams": 40, "receive_beam_width_deg": 4.0, "swath_step_deg": 4.0,
                           "motion": "none", "pings": 2})
    along, beams = line["along_track"].values[0], 40
    middle = slice(15, 25)
    step = np.median(along[beams:][middle] - along[:beams][middle])
    assert step == pytest.approx(H * np.tan(np.deg2rad(4.0)), rel=0.1)


def test_arrays_off_the_reference_point_hear_what_bent_rays_bring_there():
    """4 m to starboard, 3 m down: within 3e-4 of the depth. By straight lines from there it is 1.5e-3."""
    line = sounded(sensor={**THREE, "motion": "none", "noise": False, "pings": 3, "receive_place": "0, 4, 3",
                           "transmit_place": "0, 0, 3"}, water=WATER)
    for angle, off in by_angle(line, "error_detection"):
        assert abs(off.mean()) < 3e-4 * H, angle


def test_a_head_that_looks_to_port_sounds_there():
    """Turned by 35 degrees, its beams about its own middle."""
    line = sounded(sensor={**THREE, "mounting_deg": "35, 0, 0", "swath_middle_deg": -35.0, "swath_deg": 60.0,
                           "sector_edges_deg": "-50, -20", **FEW, "pings": 3})
    valid, across = line["valid"].values, line["across_track"].values
    assert valid.mean() > 0.95 and abs(np.median(line["error_detection"].values[valid])) < 0.01
    ends = H * np.tan(np.deg2rad([-65, -5]))
    np.testing.assert_allclose([across[valid].min(), across[valid].max()], ends, atol=1.0)
    assert np.abs(np.rad2deg(line["angle"].values)).max() < 36                 # about the head's own middle


# ---- the record

def test_the_water_column_and_snippets_are_kept_where_they_are_asked_for():
    line = sounded(sensor={**THREE, "pings": 2}, column=True, snippets=16)
    assert line["column_level_db"].dims == ("ping", "column_beam", "column_sample")
    assert line.sizes["column_beam"] == 128 and line.sizes["snippet_sample"] == 16
    sample = (line["travel_time"].values[0] - line["column_start"].values[0]) * line["column_rate"].values[0]
    level_db, valid = line["column_level_db"].values[0], line["valid"].values[0]
    near = [level_db[beam, int(at) - 40:int(at) + 40].max() for beam, at in enumerate(sample) if valid[beam]]
    assert np.median(near) > np.median(level_db) + 20
    assert "column_level_db" not in level("shallow_300khz_three_sectors")


def test_a_ring_of_side_lobes_lies_at_the_first_return():
    """30 to 45 dB below it, as instruments have it; deeper where the elements are without flaws."""
    below = {}
    for flaws in (0.1, 0.0):
        line = sounded(sensor={**WIDE, "pulse_ms": "0.1", "motion": "none", "pings": 1, "receive_flaws": flaws,
                               "noise": False}, column=True)
        levels, first = line["column_level_db"].values[0], 2 * H / 1500.0
        time = line["column_start"].values[0, 0] + np.arange(levels.shape[1]) / line["column_rate"].values[0, 0]
        at = np.abs(time - first) < 2e-4
        outer = np.r_[0:20, 108:128]
        below[flaws] = levels[:, at].max() - 10 * np.log10(np.mean(10 ** (levels[outer][:, at].max(1) / 10)))
    assert 27 < below[0.1] < 45 and below[0.0] > below[0.1] + 10


def test_same_bytes_whatever_the_threads():
    import drjit as dr

    def made():
        return sounded(sensor={**THREE, **FEW, "pings": 2}, film={"range": 60.0}, column=True, snippets=4)

    threads, whole = dr.thread_count(), made()
    try:
        dr.set_thread_count(3 - min(threads, 2))
        xr_equal = made().identical(whole)
    finally:
        dr.set_thread_count(threads)
    assert xr_equal


# ---- bad input

@pytest.mark.parametrize("attributes, words", [
    ({"frequency_khz": "300, 320"}, "sector_edges_deg is"),
    ({"sector_edges_deg": "40, -40", **{"preset": "shallow_300khz_three_sectors"}}, "sector_edges_deg is"),
    ({"pulse_ms": "0.1, 0.2"}, "pulse_ms has 2 numbers; give one"),
    ({"pulse_ms": "-1"}, "pulse_ms is"),
    ({"bandwidth_khz": "20"}, "a cw pulse has the bandwidth of its length"),
    ({"swath_deg": 175.0}, "no even distances"),
    ({"depth_gate": "30, 10"}, "depth_gate is 30 to 10 m"),
    ({"receive_shading": "cosin"}, "cosin"),
    ({"receive_beam_width_deg": 0.1, "element_spacing": 1e-4}, "the most"),
    ({"beams": 3, "preset": "shallow_300khz_three_sectors", "beam_spacing": "angle", "sector_edges_deg": "-60, -50"},
     "no beam lies in sector"),
])
def test_what_does_not_make_a_swath_is_refused_in_a_sentence(attributes, words):
    from mitsonar.scene.errors import as_exception

    with pytest.raises(Exception) as caught:
        multibeam({"seabed": bed(30.0)}, sensor=attributes)
    assert words in str(as_exception(caught.value))


@pytest.mark.parametrize("sensor, film, words", [
    ({"mounting_deg": "180, 0, 0"}, {}, "aside or behind the array"),
    ({"mounting_deg": "-60, 0, 0"}, {}, "cannot be told apart"),
    ({"depth_gate": "100, 200"}, {}, "depth_gate begins at 100 m, and the record ends at 85 m"),
    ({"beams": 100_000, "ping_rate_hz": 0.1, "swath_deg": 60.0}, {"range": 5000.0}, "take fewer beams or a shorter"),
    ({"ping_rate_hz": 100.0}, {"range": 0.1}, "give the film a longer range"),
])
def test_what_no_ping_could_be_detected_in_is_refused_before_the_first(sensor, film, words):
    more = {**WIDE, "motion": "none", "speed_knots": 0.0, **sensor}
    scene = multibeam({"seabed": bed(SONAR + H, sediment("medium sand"))}, depth=SONAR, water=None,
                      sensor={**LAUNCH, **more}, film={"range": 85.0, **film})
    with pytest.raises(ValueError, match=words):
        sounded_pings(scene)


def test_a_pulse_longer_than_the_record_finds_no_bed_and_warns_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        line = sounded(sensor={**WIDE, "beams": 8, "pings": 1, "pulse_ms": "60", "ping_rate_hz": 0.1},
                       film={"range": 40.0})
    assert not line["valid"].values.any()


def test_soundings_are_asked_of_sonars_that_make_them():
    from sonar_scenes import sidescan

    with pytest.raises(ValueError, match="interferometric sidescan makes soundings, and this sensor is a sidescan"):
        mitsonar.soundings(sidescan({"seabed": bed(40.0)}))
    with pytest.raises(ValueError, match="snippets is -1"):
        sounded(snippets=-1)
    with pytest.raises(ValueError, match="has 3 transmissions"):
        mitsonar.element_signals(multibeam({"seabed": bed(30.0)}, sensor=THREE))


# ---- the elements' own signals as the truth

def test_beams_are_those_that_the_elements_signals_make():
    """Of points, on the move, steered against pitch, both lines off the body's origin.

    Delay and sum focuses at every range and the beam domain at none: phases differ by k x² (s_j² - s_b²) / 2R, 2
    degrees for lines of 0.24 m at 10 m.
    """
    from sonar_scenes import buried_bed, point_target

    from mitsonar.imaging import fan
    from mitsonar.survey.multibeam.beams import SectorBeams

    places = [[3, 0.4, -12], [-6, -0.3, -11.5], [0.5, 0.8, -13], [8, 0.2, -10.5]]
    scene = multibeam(
        {"seabed": buried_bed(14.0), **{f"point {k}": point_target(place) for k, place in enumerate(places)}},
        depth=2.0, film={"range": 18.0},
        sensor={**LAUNCH, "pings": 2, "frequency_khz": "100", "pulse_ms": "0.2", "beams": 41, "swath_deg": 120.0,
                "receive_beam_width_deg": 4.0, "transmit_beam_width_deg": 6.0, "receive_flaws": 0.0,
                "sector_tilt_deg": "3", "receive_place": "0.3, 0.1, 0.05", "transmit_place": "-0.2, 0, 0.02"})
    run = scene.integrator().survey(scene, scene.sensors()[0]).sectors[0]
    assert abs(run.transmit_sines[1]) > 0.02
    beams = SectorBeams(run, 0).halves(1, 0).whole
    array, sines = run.survey.receive, run.sines[1]
    towards = sines[:, None] * array.along[0] + np.sqrt(1 - sines ** 2)[:, None] * array.normal[0]
    middle = array.position.mean(0)
    signals = mitsonar.element_signals(scene, 1)
    signals = signals.assign_coords({f"rx_{axis}": ("rx", signals[f"rx_{axis}"].values - off)
                                     for axis, off in zip("xyz", middle)})
    formed = fan.formed(signals, run.survey.pulse, towards)[0][:, -beams.shape[1]:]
    peak = np.abs(formed).max()
    assert np.abs(np.abs(beams) - np.abs(formed)).max() < 0.02 * peak
    assert np.abs(beams - formed).max() < 0.06 * peak
