"""The rules by which a line was reduced are found from its times: each of the four is known again.

Places are made by `resounded` under a rule, of times and angles that stay; the rule's own residual is then rounding,
and the others' are what the rule changes: 30 m/s of the head's speed over a layer of metres, and a way of 5.8 m/s.
"""
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from sounded_line import recorded, rocking, sounded, swath
from soundings_line import soundings_line

from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.io import survey_lines
from mitsonar.planning.instrument_rules import InstrumentRules, rules_of, time_residuals

RULES = [(node, under_way) for node in (True, False) for under_way in (True, False)]


@pytest.fixture(scope="module")
def line():
    sent = np.broadcast_to(1.0 + 0.5 * np.arange(2)[:, None], (2, 25))
    motion = rocking(np.arange(0.0, 3.0, 0.05))
    across = np.broadcast_to(np.linspace(-60, 60, 25), sent.shape)
    whole = recorded(sounded(swath(motion, sent, across, 0 * across, 40.0), sent, motion))
    return whole.assign(head_sound_speed=variable("head_sound_speed", whole["head_sound_speed"].values + 30.0))


@pytest.mark.parametrize("node, under_way", RULES)
def test_the_rule_that_made_the_places_is_found(line, node, under_way):
    made = resounded(line, **InstrumentRules(node=node, under_way=under_way, residual={}).arguments(line))
    made = made.assign(head_sound_speed=line["head_sound_speed"])                  # what the file says of its sensor
    rules = rules_of(made)
    assert (rules.node, rules.under_way) == (node, under_way)
    assert rules.residual[node, under_way] < 1e-6 < 1e-3 < min(
        value for rule, value in rules.residual.items() if rule != (node, under_way))
    again = resounded(made, **rules.arguments(made))
    assert np.allclose(again["depth"], made["depth"], rtol=0, atol=1e-6)
    words = "; ".join(rules.words)
    assert ("the head's sound speed" in words) == node and ("with the ship's way" in words) == under_way
    assert "do not decide" not in words


def test_what_the_times_do_not_decide_is_said():
    still = soundings_line(pings=3, beams=30, column=False, snippets=False)         # water of one speed, its head's
    rules = rules_of(still)
    assert rules.node and rules.under_way
    assert "the times do not decide which sound speed was used" in rules.words


def test_a_line_without_motion_to_its_last_echo_has_the_usual_rules(line):
    rules = rules_of(line.isel(motion=slice(0, 3)))
    assert (rules.node, rules.under_way, rules.residual, rules.words) == (True, True, {}, ())


def shallow(folder):
    """A line of 2 m under the head, made with the cast; the head's sensor says 48 m/s more, as one did.

    One sounding of a ping is put 300 m off, where the cast, ever slower with depth, lets no ray come.
    """
    line = soundings_line(pings=2, beams=32, depth=4.6, slope=0.0, column=False, snippets=False,
                          speeds=(1500.0, 1499.9, 1498.0))
    for name in ("x", "across_track"):
        line[name][1, 20] += 300.0
    line["head_sound_speed"] = line["head_sound_speed"] + 48.4
    survey_lines.write(line, folder / "shallow.kmall")
    return folder / "shallow.kmall"


def test_soundings_that_no_ray_leads_to_do_not_end_the_comparison(tmp_path):
    path = Path(__file__).resolve().parents[1] / "benchmarks/real_multibeam.py"
    specification = importlib.util.spec_from_file_location("real_multibeam", path)
    benchmark = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(benchmark)
    rows = {tuple(row[1:3]): row for row in benchmark.rows_of(shallow(tmp_path))}
    assert len(rows) == 4 and all(np.isfinite(float(row[5])) for row in rows.values())


def test_residuals_are_the_way_s_part_in_the_times(line):
    # A ship at v straight on changes the way back by some v t sin(angle from below): of the order of decimetres here.
    made = resounded(line)
    bare = np.concatenate([one for one, _ in time_residuals(made, True, False)])
    assert 0.01 < np.abs(bare).max() < 0.5
