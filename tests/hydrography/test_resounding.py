"""A record reduced anew: the same places with what it was made with, others with another profile or head's speed."""
import numpy as np
import pytest
from sounded_line import HEAD, SUMMER
from soundings_line import soundings_line

from mitsonar.hydrography.record import check, variable
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.water import SoundSpeedProfile


def test_record_reduced_with_its_own_water_stays_where_it_is(soundings):
    again = resounded(soundings, node=False)
    check(again)
    for name in ("x", "y", "depth", "across_track", "along_track"):
        np.testing.assert_allclose(again[name], soundings[name], rtol=0, atol=1e-8)
    assert again.attrs == soundings.attrs and again["valid"].values.all()


def test_another_profile_and_head_speed_are_used_and_written_down(soundings):
    uniform = SoundSpeedProfile.constant(1485.0)
    other = resounded(soundings, uniform)
    assert np.abs(other["depth"] - soundings["depth"]).max() > 0.3
    assert other["cast_depth"].values.tolist() == [0.0] and other["cast_sound_speed"].values.tolist() == [1485.0]
    slow = resounded(soundings, head_speed=HEAD - 10)
    assert np.all(slow["head_sound_speed"] == HEAD - 10) and np.all(soundings["head_sound_speed"] == HEAD)
    # Sines read in slower water are larger slownesses: the swath grows.
    assert float(slow["across_track"].max()) > float(soundings["across_track"].max()) + 1


def test_what_was_known_at_the_old_places_is_left_out(soundings):
    known = soundings.assign(true_depth=variable("true_depth", soundings["depth"].values),
                             error=variable("error", 0 * soundings["depth"].values),
                             valid=variable("valid", soundings["depth"].values > 90))
    again = resounded(known, SUMMER)
    assert "true_depth" not in again and "error" not in again and "true_depth" in known
    assert np.array_equal(np.isfinite(again["depth"]), known["depth"] > 90)


@pytest.mark.parametrize("speed", [np.full(3, 1500.0), 100.0, np.nan])
def test_speeds_that_no_water_has_are_refused(soundings, speed):
    with pytest.raises(ValueError, match="head_speed|sound_speed"):
        resounded(soundings, head_speed=speed)


def test_other_datasets_are_refused(soundings):
    with pytest.raises(ValueError, match="lacks angle"):
        resounded(soundings.drop_vars("angle"))


def test_line_of_three_sectors_made_by_other_formulas_is_met():
    # Straight rays in water of one speed; three transmissions of a ping, padded and missing soundings.
    given = soundings_line()
    again, valid = resounded(given), given["valid"].values
    for name in ("x", "y", "depth", "across_track", "along_track"):
        np.testing.assert_allclose(again[name].values[valid], given[name].values[valid], rtol=0, atol=1e-6)
    assert np.array_equal(again["valid"], valid) and not np.isfinite(again["depth"].values[~valid]).any()


def test_pings_of_several_receiving_heads_have_their_own_arms(soundings):
    head = np.arange(soundings.sizes["ping"]) % 2
    arms = np.stack([soundings["receive_offset"].values, soundings["receive_offset"].values + [0, 0.7, 0]])
    mountings = np.repeat(soundings["receive_mounting"].values[None], 2, 0) + [[0, 0, 0], [0.01, 0, 0]]
    twin = soundings.assign(head=variable("head", head), head_receive_offset=variable("head_receive_offset", arms),
                            head_receive_mounting=variable("head_receive_mounting", mountings))
    again = resounded(twin, node=False)
    other = resounded(soundings.assign(receive_offset=variable("receive_offset", arms[1]),
                                       receive_mounting=variable("receive_mounting", mountings[1])), node=False)
    for name in ("depth", "x"):
        np.testing.assert_allclose(again[name][0::2], soundings[name][0::2], rtol=0, atol=1e-8)
        np.testing.assert_allclose(again[name][1::2], other[name][1::2], rtol=0, atol=1e-8)
    assert np.abs(again["depth"] - soundings["depth"])[1::2].max() > 0.5


def test_a_sector_is_sent_from_its_own_part_of_the_array(soundings):
    """Moving all parts by a vector is moving the array; moving one moves its soundings alone."""
    by = np.array([0.3, -0.2, 0.1])
    shape = (soundings.sizes["ping"], soundings.sizes["transmission"], 3)
    every = soundings.assign(sector_offset=variable("sector_offset", np.broadcast_to(by, shape)))
    moved = resounded(soundings.assign(transmit_offset=soundings["transmit_offset"] + by))
    again = resounded(every)
    for name in ("x", "y", "depth"):
        np.testing.assert_allclose(again[name], moved[name], rtol=0, atol=1e-9)
    offsets = np.zeros(shape)
    offsets[:, 0] = by
    first = resounded(soundings.assign(sector_offset=variable("sector_offset", offsets)))
    of_first, still = soundings["sector"].values == 0, resounded(soundings)
    assert np.array_equal(first["depth"].values[~of_first], still["depth"].values[~of_first])
    np.testing.assert_allclose(first["depth"].values[of_first], moved["depth"].values[of_first], rtol=0, atol=1e-9)
