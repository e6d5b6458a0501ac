"""The sound-speed profile from times of soundings.

Lines over a slope that climbs through the thermocline tell it, the bed being unknown; over a level bed they tell the
mean alone, and another order of the layers fits as well. The lines are those of `benchmarks/simulated_soundings`,
fewer beams of them, of a bed and water that the fit cannot have.
"""
import sys
from pathlib import Path

import numpy as np
import pytest

from mitsonar.gradients.soundings.sounding_bed import BedGrid
from mitsonar.hydrography.detection.sounding_beams import SoundingBeams
from mitsonar.inversion.profile.profile import fit_profile
from mitsonar.inversion.profile.profile_problem import ProfilePrior
from mitsonar.water import SoundSpeedProfile

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from simulated_soundings import HEAD, surveyed  # noqa: E402  (after the path to it)

FINE = np.arange(0.0, 60, 0.5)
CAST = SoundSpeedProfile(FINE, 1510 - 18 / (1 + np.exp(-(FINE - 22) / 3)))
NODES = np.r_[0, HEAD, np.linspace(4, 44, 11)]
START = SoundSpeedProfile(NODES, np.full(NODES.size, float(CAST.at(HEAD))))
PRIOR = ProfilePrior(length=8.0)


def over(shallowest, deepest, **options):
    """Beams of lines over a slope, or a level bed."""
    return surveyed(CAST, shallowest, deepest, **{"lines": 4, "pings": 24, "beams": 24, "noise": 5e-6, **options})[0]


@pytest.fixture(scope="module")
def sloping():
    return fit_profile(over(8, 42), START, noise=5e-6, prior=PRIOR)


@pytest.fixture(scope="module")
def level():
    return fit_profile(over(41, 42), START, noise=5e-6, prior=PRIOR)


def test_a_slope_through_the_thermocline_tells_the_profile(sloping):
    some = sloping.told & (sloping.depth > HEAD)
    error = (sloping.speed - CAST.at(NODES))[some]
    before = (sloping.start - CAST.at(NODES))[some]
    assert some.sum() >= 7 and sloping.is_profile
    assert np.abs(error).mean() < 0.15 * np.abs(before).mean()
    # deviations tell the errors: of eight nodes the mean square ratio is 1 give or take 0.5, and as much again for
    # what a profile of few nodes cannot say
    assert np.mean((error / sloping.deviation[some]) ** 2) < 4
    assert isinstance(sloping.profile, SoundSpeedProfile)


def test_nodes_above_the_bed_are_not_told(sloping):
    above = (NODES > HEAD + 1) & (NODES < sloping.bed_depths[0])
    assert above.any() and not sloping.told[above].any()
    assert "no more is told than their mean" in sloping.verdict


def test_a_level_bed_is_no_reason_to_claim_a_profile(level):
    assert not level.is_profile
    with pytest.raises(ValueError, match="do not tell a profile: .* the mean sound speed from the head to the bed is"):
        level.profile
    # layers in another order meet the times as well
    assert np.abs(level.rival - level.speed).max() > 8
    assert level.rival_misfit == pytest.approx(level.misfit[-1], rel=0.02)


def test_a_level_bed_tells_the_mean(level, sloping):
    fine = np.linspace(HEAD, level.bed_depths[1], 4000)
    assert level.column_mean == pytest.approx(CAST.at(fine).mean(), abs=0.1)
    assert (level.singular_values > 1).sum() < (sloping.singular_values > 1).sum()


def test_one_line_over_an_unknown_bed_tells_nothing(sloping):
    fit = fit_profile(over(8, 42, lines=1, crossing=0), START, noise=5e-6, prior=PRIOR)
    assert fit.directions < 0.1 < 0.3 < sloping.directions
    with pytest.raises(ValueError, match="seen from one direction only, so that its depth and the speed"):
        fit.profile


def test_singular_values_and_deviations_are_of_one_posterior(sloping):
    """Without scatter that goes together on the bed, deviations follow from the prior's patterns: Σ pattern²/(1+s²)."""
    pure = np.sqrt((sloping.patterns ** 2 / (1 + sloping.singular_values[:, None] ** 2)).sum(0))
    assert (sloping.deviation >= pure * (1 - 1e-6)).all()
    np.testing.assert_allclose(np.sqrt((sloping.patterns ** 2).sum(0)), sloping.prior_deviation, rtol=1e-6)


def test_a_known_bed_needs_one_line_only():
    beams, bed = surveyed(CAST, 8, 42, lines=1, crossing=0, pings=24, beams=20, noise=5e-6)
    bed = BedGrid(x=bed.x[::4], y=bed.y[::4], depth=bed.depth[::4, ::4])
    fit = fit_profile(beams, START, noise=5e-6, prior=ProfilePrior(length=8.0, bed_deviation=0.05), bed=bed)
    some = fit.told & (fit.depth > HEAD)
    assert some.sum() >= 7
    assert np.abs(fit.speed - CAST.at(NODES))[some].mean() < 1.0


def test_a_roll_of_the_array_is_found_where_it_is_allowed():
    beams = over(8, 42)
    angle = np.arcsin(beams.slowness * beams.head_speed) - 0.002 * beams.starboard     # the beams that are believed
    values = {name: getattr(beams, name) for name in SoundingBeams.__dataclass_fields__}
    values["slowness"] = np.abs(np.sin(angle)) / beams.head_speed
    fit = fit_profile(SoundingBeams(**values), START, noise=5e-6, prior=ProfilePrior(length=8.0, roll_deviation=0.01))
    assert fit.roll == pytest.approx(0.002, abs=3e-4)


def test_all_of_it_is_in_the_dataset(sloping, level):
    one = sloping.to_dataset()
    assert one["sound_speed"].attrs["units"] == "m/s" and one.sizes["node"] == NODES.size
    assert one.attrs["observable"] == sloping.verdict and "sound_speed_rival" not in one
    assert "sound_speed_rival" in level.to_dataset()


@pytest.mark.parametrize(("options", "message"), [
    ({"noise": 0.0}, "noise is 0 s; give the times' standard deviation"),
    ({"iterations": 0}, "iterations is 0; at least one"),
    ({"cell": -1.0}, "cell is -1 m; give a distance above zero"),
    ({"cell": 0.5}, "is more than 2500; take larger cells")])
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        fit_profile(over(8, 42, pings=4, lines=2), START, **options)


def test_water_beds_and_priors_that_will_not_do_are_refused():
    beams = over(8, 42, pings=4, lines=2)
    fast = SoundSpeedProfile([0.0, 5], [1500.0, 2900.0])
    with pytest.raises(ValueError, match="of [0-9]+ beams turn back in the start's water before they reach"):
        fit_profile(beams, fast)
    with pytest.raises(ValueError, match="a bed of 300000 nodes is more than 250000"):
        fit_profile(beams, START, bed=BedGrid(x=np.arange(3e5), y=[0.0], depth=np.full((1, 300000), 40.0)))
    with pytest.raises(ValueError, match="profile prior: length is -1; give a number above zero"):
        ProfilePrior(length=-1.0)
