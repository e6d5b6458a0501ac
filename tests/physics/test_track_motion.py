"""Random motion and the lever arm: their statistics, and rates that are the derivatives of the track.

The mean square over a long time is rms² by construction, whatever the seed: each of N = 32 sinusoids has its whole
power, and cross terms die out as 1 / (T Δf) (here below 2 %). Their sum is nearly Gaussian; its kurtosis over all times
and phases is 3 - 1.5 / N = 2.95. Rates against second-order differences at 0.1 ms: (ω h)² / 6 < 1e-8 relative.
"""
import numpy as np
import pytest

from mitsonar.sonar import Track
from mitsonar.sonar.motion import RandomMotion, Voyage


def voyage(pings, interval, heading=1.0):
    track = Track.straight(start=[0, 0, -5], heading=heading, speed=2.0, interval=interval, pings=pings)
    return Voyage(track=track, velocity=track.motion()[0], turn_rate=np.zeros((pings, 3)))


@pytest.mark.parametrize("seed", range(4))
def test_mean_squares_are_as_asked_for(seed):
    motion = RandomMotion(roll=0.05, pitch=0.02, yaw=0.01, heave=0.3, period=6.0, seed=seed)
    values, rates = motion.at(np.arange(0, 20_000, 0.5))
    for name in ("roll", "pitch", "yaw", "heave"):
        assert np.std(values[name]) == pytest.approx(getattr(motion, name), rel=0.02)
        assert abs(np.mean(values[name])) < 0.01 * getattr(motion, name)
        # the mean square frequency of the band is (1 + 0.15²) / period², less the tails that 32 lines miss
        assert np.std(rates[name]) / np.std(values[name]) * 6.0 / (2 * np.pi) == pytest.approx(1.01, abs=0.015)
    # two of their 32 lines that fall together correlate 1/32
    assert abs(np.corrcoef(values["roll"], values["heave"])[0, 1]) < 3 / 32


def test_it_is_narrow_band_and_nearly_gaussian():
    values = np.concatenate([RandomMotion(heave=1.0, period=8.0, seed=seed).at(np.arange(0, 4000, 1.0))[0]["heave"]
                             for seed in range(40)])
    assert np.mean(values ** 4) / np.mean(values ** 2) ** 2 == pytest.approx(2.95, abs=0.1)
    spectrum = np.abs(np.fft.rfft(values[:4000])) ** 2
    frequency = np.fft.rfftfreq(4000, 1.0)
    band = np.abs(frequency * 8.0 - 1) < 0.5
    assert spectrum[band].sum() > 0.99 * spectrum.sum()


def test_seeds_and_kinds_differ_and_repeat():
    def roll(**change):
        return RandomMotion(**{"roll": 0.1, "pitch": 0.1, **change}).at(np.arange(50.0))[0]

    assert np.array_equal(roll()["roll"], roll()["roll"]) and np.array_equal(roll()["roll"], roll(heave=1.0)["roll"])
    assert not np.allclose(roll()["roll"], roll(seed=1)["roll"]) and not np.allclose(roll()["roll"], roll()["pitch"])
    assert not roll()["yaw"].any()


def test_velocity_and_turn_rate_are_the_derivatives_of_the_track():
    motion = RandomMotion(roll=0.1, pitch=0.08, yaw=0.1, heave=0.3, period=5.0, seed=3)
    moved = voyage(20_001, 1e-4).rocking(motion).carried([1.0, 0.5, -0.7])
    velocity, turn_rate = moved.track.motion()
    np.testing.assert_allclose(moved.velocity[1:-1], velocity[1:-1], atol=1e-7)
    np.testing.assert_allclose(moved.turn_rate[1:-1], turn_rate[1:-1], atol=1e-7)
    assert np.abs(moved.turn_rate).max(0).min() > 0.01


def test_heave_lifts_and_nothing_changes_nothing():
    still = voyage(50, 0.2)
    assert still.rocking(RandomMotion()).carried(np.zeros(3)).track == still.track
    heaved = still.rocking(RandomMotion(heave=0.5, seed=2))
    values = RandomMotion(heave=0.5, seed=2).at(still.track.time)[0]["heave"]
    np.testing.assert_allclose(heaved.track.position[:, 2], -5 + values, atol=1e-12)
    assert np.array_equal(heaved.track.position[:, :2], still.track.position[:, :2])


@pytest.mark.parametrize(("heading", "place"), [(0, [2, 3, -9]), (90, [3, -2, -9]), (180, [-2, -3, -9])])
def test_the_offset_is_forward_starboard_down(heading, place):
    there = voyage(2, 1.0, np.deg2rad(heading)).carried([3, 2, 4]).track.position[0]
    np.testing.assert_allclose(there, place, atol=1e-12)


@pytest.mark.parametrize("change", [{"roll": -0.1}, {"period": 0}, {"heave": np.nan}, {"pitch": np.inf}])
def test_motion_that_is_none(change):
    with pytest.raises(ValueError, match=f"random motion: {next(iter(change))} is"):
        RandomMotion(**change)
