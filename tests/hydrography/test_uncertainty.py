"""A priori uncertainty: each cause against soundings that are reduced with that thing wrong by its deviation.

Straight rays in the budget, bent ones in the soundings: 2 m/s of difference over the column leave 2 % of the size.
"""
from dataclasses import replace

import numpy as np
import pytest
from sounded_line import recorded, rocking, sounded, swath

from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.errors import disturbed
from mitsonar.hydrography.reduction.reduction import Installation, located
from mitsonar.hydrography.reduction.uncertainty import Accuracies, budget, with_uncertainty
from mitsonar.water import SoundSpeedProfile

WATER = SoundSpeedProfile([0, 200], [1501, 1499])
ARMS = Installation(transmit_offset=(2, 0.5, 0.3), receive_offset=(1, -0.5, 0.3), receive_mounting=(0.3, 0, 0))
NOTHING = Accuracies(**dict.fromkeys(Accuracies.__dataclass_fields__, 0.0))


FALL = 0.25


def at_rest(fall):
    """One ping at rest over a bed that falls to starboard, its receive array tilted by 0.3 rad."""
    time = np.linspace(-1, 1, 5)
    rest = PlatformMotion(time=time, x=0 * time, y=0 * time, depth=0 * time + 5, roll=0 * time, pitch=0 * time,
                  heading=0 * time + 1)
    across = np.linspace(-120, 80, 41)[None]
    sent = np.zeros(across.shape)
    return sounded(swath(rest, sent, across, sent + 8.0, 80.0 + fall * across), sent, rest, ARMS, WATER, WATER.at(5.3))


@pytest.fixture(scope="module")
def line():
    return at_rest(0.0)


@pytest.fixture(scope="module")
def slope():
    return at_rest(FALL)


def moved(line, motion=None, profile=WATER, **change):
    """Return how far one wrong thing moves soundings: up, aside, and off the slope."""
    found = located(replace(line.measured, **change), motion or line.motion, ARMS, profile, node=False)
    way = np.stack([found.x, found.y, found.depth], -1) - line.places
    starboard = way[..., 0] * np.cos(1) - way[..., 1] * np.sin(1)
    return np.abs(way[..., 2]), np.hypot(way[..., 0], way[..., 1]), np.abs(way[..., 2] - FALL * starboard)


CAUSES = {
    "roll": (1e-3, lambda line: moved(line, disturbed(line.motion, roll=1e-3))),
    "pitch": (1e-3, lambda line: moved(line, disturbed(line.motion, pitch=1e-3))),
    "heading": (1e-3, lambda line: moved(line, disturbed(line.motion, heading=1e-3))),
    "heave": (0.1, lambda line: moved(line, disturbed(line.motion, depth=0.1))),
    "position": (0.5, lambda line: moved(line, disturbed(line.motion, x=0.3, y=0.4))),
    "time": (1e-4, lambda line: moved(line, travel_time=line.measured.travel_time + 1e-4)),
    "profile": (1.0, lambda line: moved(line, profile=SoundSpeedProfile(
        [0, 5.3, 5.4, 200], [1501, WATER.at(5.3), WATER.at(5.4) + 1, 1500]))),
    # Beams steered and read with a speed that is off, in water that starts with it: a tilted array errs.
    "head": (1.0, lambda line: moved(line, profile=SoundSpeedProfile(
        [0, 5.3, 5.32, 200], [1502, WATER.at(5.3) + 1, WATER.at(5.32), 1499]), head_sound_speed=WATER.at(5.3) + 1,
        angle=np.arcsin(np.sin(line.measured.angle) * (1 + 1 / WATER.at(5.3))))),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_budget_is_what_soundings_move_by(line, cause):
    size, move = CAUSES[cause]
    found = budget(recorded(line), replace(NOTHING, **{cause: size}))[{"time": "detection"}.get(cause, cause)]
    for said, wanted in zip(found, move(line)[:2]):
        assert np.abs(said - wanted).max() < 0.03 * max(wanted.max(), 1e-2), cause


@pytest.mark.parametrize("cause", ["roll", "time", "profile", "head"])
def test_depths_on_a_slope_are_off_by_what_moves_them_aside_too(slope, cause):
    size, move = CAUSES[cause]
    said = budget(recorded(slope), replace(NOTHING, **{cause: size}))[{"time": "detection"}.get(cause, cause)][0]
    _, _, wanted = move(slope)
    inner = np.s_[:, 4:-4]                     # ends have no neighbours to tell the slope by
    assert np.abs(said - wanted)[inner].max() < 0.03 * max(wanted.max(), 1e-2)


def test_deviations_add_as_squares_and_one_alone_is_all(line):
    record = recorded(line)
    both = with_uncertainty(record, replace(NOTHING, roll=1e-3, heave=0.1))
    one, other = (budget(record, replace(NOTHING, **{name: size}))[name] for name, size in (("roll", 1e-3),
                                                                                           ("heave", 0.1)))
    np.testing.assert_allclose(both["uncertainty"]**2, one[0]**2 + other[0]**2, rtol=1e-6)
    np.testing.assert_allclose(both["horizontal_uncertainty"], one[1], rtol=1e-6)
    whole = with_uncertainty(record)
    assert np.isfinite(whole["uncertainty"]).all() and whole["uncertainty"].dtype == np.float32


def test_quality_says_the_deviation_of_detection(line):
    record = recorded(line)
    known = record.assign(quality=variable("quality", np.full(record["depth"].shape, 3.0)))
    found = budget(known, replace(NOTHING, time=1.0))["detection"][0]
    # A thousandth of the time is a thousandth of the depth under the arrays.
    np.testing.assert_allclose(found, 1e-3 * (80 - 5.3), rtol=2e-3)


def test_latency_counts_with_the_rates_of_the_motion():
    motion = rocking(np.arange(-1, 12, 0.01))
    sent = np.full((1, 41), 2.0)
    across = np.linspace(-100, 100, 41)[None]
    places = swath(motion, sent, across, 0 * sent, np.full(sent.shape, 80.0))
    record = recorded(sounded(places, sent, motion, Installation(), WATER))
    vertical, horizontal = budget(record, replace(NOTHING, latency=0.01))["latency"]
    rate = abs(0.1 * 1.3 * np.cos(2.6))
    assert vertical[0, -1] == pytest.approx(0.01 * rate * 100, rel=0.1)
    assert horizontal.min() > 0.01 * np.hypot(3, 5)


def test_accuracies_are_numbers_of_zero_or_more():
    with pytest.raises(ValueError, match="roll is -1"):
        Accuracies(roll=-1)
    with pytest.raises(ValueError, match="heave is nan"):
        Accuracies(heave=np.nan)
