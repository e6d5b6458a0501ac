"""Uncertainty of planned soundings, useful swaths, cross lines and pings along the track, against sums by hand.

Geometry: a level sonar 2 m below the surface of water of one speed, over a level bed. Rays are straight, so that the
beam of angle θ meets the bed at y = h tan θ. Tolerance 1e-9, of rounding, unless a test says another.
"""
import numpy as np
import pytest

from mitsonar.hydrography.reduction.uncertainty import Accuracies
from mitsonar.hydrography.survey_orders import ORDERS
from mitsonar.planning.area import polygon
from mitsonar.planning.bed import flat_bed
from mitsonar.planning.coverage import SwathSonar
from mitsonar.planning.plan import Layout, plan
from mitsonar.planning.uncertainty.error_budget import accuracies_of, along_track, swath_budget, useful_swath
from mitsonar.water import SoundSpeedProfile

WATER = SoundSpeedProfile.constant(1500.0)
SONAR = SwathSonar(swath=np.deg2rad(120), head_depth=2.0, rate=5.0, beam_width=np.deg2rad(1.0))
SENSORS = Accuracies(time=2e-5, angle=4e-4, roll=5e-4, pitch=6e-4, heading=1e-3, heave=0.06, heave_share=0.05,
                     draught=0.03, position=0.4, latency=0.004, profile=0.7, head=0.2, tide=0.08, arms=0.02)
AREA = polygon([np.array([[0, 0], [400, 0], [400, 900], [0, 900]], float)])


def budget(depth=50.0, accuracies=SENSORS, order="1a", speed=2.5):
    return swath_budget(WATER, SONAR, depth, accuracies, ORDERS[order], speed)


def planned(layout=None, sonar=SONAR, depth=20.0, **more):
    return plan(flat_bed(depth, *AREA.bounds), WATER, sonar, layout, area=AREA, **more)


def test_a_beam_has_the_sum_of_squares_of_all_causes():
    found, h, y, slant = budget(), 48.0, 48 * np.sqrt(3), 96.0         # the last beam, of 60 degrees
    span = 0.5 * 1500 * 2e-5
    vertical = [0.5 * span, y * 4e-4, y * 5e-4, 0.06, 0.03, 0.08, 0.02, h * (1 - 3) * 0.7 / 1500]
    horizontal = [y / slant * span, h * 4e-4, h * 5e-4, h * 6e-4, y * 1e-3, 0.4, np.sqrt(2) * 0.02, 2.5 * 0.004,
                  2 * y * 0.7 / 1500]
    assert found.angle[-1] == pytest.approx(np.pi / 3)
    assert found.vertical[-1] == pytest.approx(1.96 * np.sqrt(np.sum(np.square(vertical))), rel=1e-9)
    assert found.horizontal[-1] == pytest.approx(2.448 / np.sqrt(2) * np.sqrt(np.sum(np.square(horizontal))), rel=1e-9)
    assert found.main_cause(0) == "tide"
    assert budget(accuracies=Accuracies(profile=5.0)).main_cause() == "profile"


@pytest.mark.parametrize("order, vertical, horizontal", [
    ("exclusive", np.hypot(0.15, 0.0075 * 50), 1.0), ("special", np.hypot(0.25, 0.0075 * 50), 2.0),
    ("1a", np.hypot(0.5, 0.013 * 50), 7.5), ("1b", np.hypot(0.5, 0.013 * 50), 7.5),
    ("2", np.hypot(1.0, 0.023 * 50), 25.0)])
def test_the_orders_allow_what_table_1_of_s_44_says(order, vertical, horizontal):
    found = budget(order=order)
    assert (found.allowed_vertical, found.allowed_horizontal) == pytest.approx((vertical, horizontal))


def test_features_to_detect_are_those_of_table_1_of_s_44():
    assert [ORDERS[name].least_feature(30.0) for name in ORDERS] == [0.5, 1.0, 2.0, None, None]
    assert [ORDERS[name].least_feature(60.0) for name in ORDERS] == [0.5, 1.0, 6.0, None, None]
    assert ORDERS["1a"].least_feature(40.0) == 2.0


@pytest.mark.parametrize("cause", ["time", "angle", "roll", "pitch", "heading", "heave", "draught", "position",
                                   "latency", "profile", "tide", "arms"])
def test_a_worse_sensor_never_widens_the_swath(cause):
    angles = []
    for factor in (0.0, 1.0, 3.0, 10.0):
        changed = Accuracies(**{**SENSORS.__dict__, cause: factor * getattr(SENSORS, cause)})
        found = budget(accuracies=changed, order="special")
        angles.append(found.good_angle)
        within = found.angle <= found.good_angle       # the vertical beam alone may be none
        assert np.all(found.share[within] <= 1) or found.good_angle == 0
        assert within.all() or found.share[np.argmin(within)] > 1 or found.share[0] > 1
    assert np.all(np.diff(angles) <= 0)


def test_the_useful_swath_ends_where_the_order_does_and_sets_the_spacing():
    worse = Accuracies(roll=4e-3, heave=0.0, draught=0.0, position=0.0, profile=0.0, latency=0.0, heading=0.0,
                       time=0.0, angle=0.0, pitch=0.0)
    # TVU = 1.96 * 4e-3 * h tan θ meets sqrt(0.15² + (0.0075 d)²) at one angle; linear between 65 angles
    angle = np.arctan(np.hypot(0.15, 0.0075 * 20) / (1.96 * 4e-3 * 18))
    wide, narrow = (planned(Layout(overlap=0.1, useful=useful), order=ORDERS["exclusive"], accuracies=worse)
                    for useful in (False, True))
    assert narrow.sonar.swath == pytest.approx(2 * angle, abs=np.deg2rad(0.04)) and len(narrow.lines) > len(wide.lines)
    offsets = np.sort([line.track.segment.offset for line in narrow.lines])
    assert np.diff(offsets)[0] == pytest.approx(0.9 * 2 * 18 * np.tan(narrow.sonar.swath / 2), abs=0.05)
    assert wide.sonar.swath == SONAR.swath and narrow.sonar.beams < SONAR.beams
    with pytest.raises(ValueError, match="no beam is within order exclusive: .* most by tide; use better sensors"):
        useful_swath([budget(accuracies=Accuracies(tide=1.0), order="exclusive")], ORDERS["exclusive"])


def test_cross_lines_run_across_the_others_after_them_and_count_for_no_coverage():
    plain, crossed = planned(Layout(overlap=0.1)), planned(Layout(overlap=0.1, cross=6.0))
    assert plain.cross_lines == () and crossed.lines[-1].turn is not None
    assert np.array_equal(plain.coverage.times, crossed.coverage.times)
    spacing = np.median(np.diff(np.sort([line.track.segment.offset for line in crossed.lines])))
    offsets = np.sort([line.track.segment.offset for line in crossed.cross_lines])
    assert np.diff(offsets) == pytest.approx(6 * spacing) and offsets.size == int(np.ceil(900 / (6 * spacing)))
    assert [line.number for line in crossed.sailed] == list(range(1, len(crossed.sailed) + 1))
    for line in crossed.cross_lines:
        assert abs(np.cos(line.heading - crossed.lines[0].heading)) < 1e-9 and line.length == pytest.approx(400, abs=1)


def test_speeds_without_gaps_and_with_enough_pings_on_a_feature_are_those_of_the_worst_place():
    made = planned(Layout(overlap=0.1, speed=2.5))
    found = along_track([line.track for line in made.lines], SONAR, ORDERS["1a"], 2.5)
    footprint = 2 * 18 * np.tan(np.deg2rad(0.5))
    assert found.spacing == pytest.approx(0.5) and found.footprint == pytest.approx(footprint)
    assert found.gapless_speed == pytest.approx(5 * footprint)
    assert found.hits == pytest.approx(2.0 * 5 / 2.5) and found.feature_speed == pytest.approx(2.0 * 5 / 3)
    found = along_track([line.track for line in made.lines], SwathSonar(swath=1.0, rate=5.0), ORDERS["2"], 2.5)
    assert (found.footprint, found.gapless_speed, found.feature, found.hits) == (None,) * 4


def test_accuracies_are_read_in_their_units_and_bad_ones_refused():
    found = accuracies_of(["tide=0.1", "roll_deg=0.05"])
    assert found.tide == 0.1 and found.roll == pytest.approx(np.deg2rad(0.05)) and found.heave == Accuracies().heave
    for texts, words in ((["tid=1"], 'did you mean "tide"'), (["roll=1"], "roll_deg"), (["tide"], "NAME=VALUE"),
                         (["tide=x"], "tide is 'x'"), (["tide=-1"], "from 0"), (["tide=nan"], "from 0"),
                         (["tide=1", "tide=2"], "given twice"), (["heave_share=0.1"], "NAME=VALUE")):
        with pytest.raises(ValueError, match=words):
            accuracies_of(texts)
