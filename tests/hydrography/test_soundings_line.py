"""The record that tests share: it is a line of soundings, and its angles and times say where its soundings are."""
import numpy as np
from soundings_line import RECEIVE, SPEED, TRANSMIT, blocks_of, soundings_line

from mitsonar.hydrography.record import VARIABLES, check, joined


def test_a_line_made_by_hand_is_a_line_of_soundings():
    line = soundings_line()
    check(line)
    assert set(line.variables) <= set(VARIABLES)


def test_pings_joined_again_are_the_line():
    line = soundings_line(pings=5)
    assert joined(blocks_of(line)).identical(line)


def test_a_still_and_level_ship_would_hear_it_from_the_soundings_distance():
    line = soundings_line(pings=3)
    good = line["valid"].values
    # Twice the way from between the arrays, to the 0.4 m that they lie off the line's reference point and the ship
    # moves on while the echo is under way.
    way = np.sqrt(line["across_track"]**2 + line["along_track"]**2 + (line["depth"] - line["ping_depth"])**2).values
    away = (np.linalg.norm(TRANSMIT) + np.linalg.norm(RECEIVE)) / 2 + 0.2
    assert np.abs(way - SPEED * line["travel_time"].values / 2)[good].max() < away
    assert np.allclose(line["error"].values[good], (line["depth"] - line["true_depth"]).values[good], atol=1e-12)
    # Starboard is where angles are positive.
    assert np.all(np.diff(np.where(good, line["angle"].values, np.nan)[2, 4:-1]) > 0)
