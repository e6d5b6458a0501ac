"""Two sonars that ping together from one platform: same places and times, each with its own frequency and echoes.

The bed is flat and Lambert, 20 m below the sonars. Sonars on one track share its pose to the last bit. Two that
are alike hear the same bed; at two frequencies the phases of its scatterers add up otherwise, and speckle is
independent: over 6 x 2 x 150 bins amplitudes of both correlate by 0 ± 0.024.
"""
import numpy as np
import pytest
import sonar_scenes as scenes

import mitsonar


@pytest.fixture
def pair(variant):
    """Load a scene of two sidescans, the second on the track of the first, with what is added to either."""
    def run(low=None, high=None, kind="sidescan", ranges=(60.0, 50.0)):
        import mitsuba as mi

        track = {"pings": 6, "depth": 5.0, "heading_deg": 30.0, "motion": "tow", "speed_knots": 4.0}
        first, second = ({"type": "sonar_film", "range": end, "range_min": 21.0, "bins": 150} for end in ranges)
        water = {"type": "seawater", "sound_speed": 1500.0}
        preset = {"preset": "towed_400khz"} if kind == "sidescan" else {}
        return mi.load_dict({
            "type": "scene", "integrator": {"type": "sonar_path", "rays": 8000}, "bed": scenes.bed(25.0),
            "low": {"type": "sidescan", "preset": "towed_100khz", **track, **(low or {}), "medium": water,
                    "film": first},
            "high": {"type": kind, **preset, **(high or {}), "platform": {"type": "ref", "id": "low"}, "medium": water,
                     "film": second}}, optimize=False, parallel=False)
    return run


def refused(pair, **how):
    from mitsonar.scene.errors import plain

    with pytest.raises((ValueError, RuntimeError)) as caught:
        pair(**how)
    return plain(caught.value)


def test_both_ping_at_the_same_places_and_times(pair):
    scene = pair()
    low, high = (mitsonar.render(scene, 3, sensor=name) for name in ("low", "high"))
    for name in ("x", "y", "z", "roll", "pitch", "heading", "ping_time"):
        assert np.array_equal(low[name], high[name])
    assert np.ptp(low["roll"].values) > 0
    assert low.attrs["frequency"] == 100e3 and high.attrs["frequency"] == 400e3
    assert low.attrs["seed"] == high.attrs["seed"] == 3
    assert mitsonar.render(scene, 3, sensor=1).equals(high)


@pytest.mark.parametrize(("preset", "least", "most"), [("towed_100khz", 0.999, 1), ("towed_400khz", -0.1, 0.1)])
def test_both_hear_one_bed_and_other_frequencies_other_speckle_of_it(pair, preset, least, most):
    steady = {"noise": False, "yaw_jitter_deg": 0.0, "phase_jitter_deg": 0.0}
    scene = pair(low=steady, high={**steady, "preset": preset}, ranges=(60.0, 60.0))
    low, high = (mitsonar.render(scene, 3, sensor=name) for name in ("low", "high"))
    amplitude = [10 ** ((image["level"] - image["mean_level"]).values.ravel() / 20) for image in (low, high)]
    heard = np.isfinite(amplitude).all(0)
    assert heard.mean() > 0.95
    assert least < np.corrcoef(*np.array(amplitude)[:, heard])[0, 1] < most
    both = mitsonar.render(scene, 3, sensor="low")
    assert both.equals(low)


def test_one_on_another_place_of_the_platform(pair):
    scene = pair(high={"offset": "1, 0.5, 0.2"})
    low, high = (scene.integrator().survey(scene, sensor).track for sensor in scene.sensors())
    arm = np.einsum("pij,j->pi", low.rotation(), [1, 0.5, 0.2])
    np.testing.assert_allclose(high.position - low.position, arm, atol=1e-9)
    assert np.array_equal(low.time, high.time) and np.array_equal(low.roll, high.roll)


def test_a_written_ping_rate_holds_for_both(pair):
    scene = pair(low={"ping_rate_hz": 5.0}, ranges=(30.0, 100.0))
    low, high = (scene.integrator().survey(scene, sensor).track.time for sensor in scene.sensors())
    assert np.array_equal(low, high) and high[1] == pytest.approx(0.2)


@pytest.mark.parametrize(("how", "words"), [
    ({"high": {"pings": 9}}, 'pings and a nested <sensor> are both given; the track is that of "low"'),
    ({"high": {"motion": "hull", "roll_deg": 2.0}}, "motion, roll_deg and a nested <sensor>"),
    ({"ranges": (50.0, 60.0)}, 'the pings of "low", whose track it shares, come every 0.06'),
    ({"kind": "sector_scan"}, "neither of the two may be a sector_scan"),
])
def test_refusals(pair, how, words):
    assert words in refused(pair, **how)


def test_sensors_by_their_ids(pair):
    with pytest.raises(ValueError, match='"hihg" was asked for .did you mean "high".*; the scene has low, high'):
        mitsonar.render(pair(), sensor="hihg")
