"""What is said before an array's pings are computed, and how far they are while they are: block by block of cells.

Cells: a bed of two facets of 200 m, cut into n² each, n = ⌈longest side / cell⌉; all of both are within 300 m.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.echoes import ensonification
from mitsonar.survey.pressure import cost as array_cost
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import LEAD
from mitsonar.validation.scenes import array_sonar, bed

CUTS = int(np.ceil(200 * np.sqrt(2) / 2.0))
LINE = {"receive": "line", "receive_elements": 3, "receive_normal": "down"}


def scene(*, ensonification="scatterers", pings=1, size=200.0, film=300.0, **sensor):
    return array_sonar({"bed": bed(20.0, size=size)}, sensor={**LINE, "pings": pings, **sensor}, film={"range": film},
                       integrator={"cell": 2.0, "ensonification": ensonification, "rays": 5000})


def record_of(scene, **how):
    return PressureRecord(scene.integrator().array_survey(scene, scene.sensors()[0], LEAD), **how)


def test_cells_within_reach_are_counted(variant):
    assert array_cost.cells_within_reach(record_of(scene()), 0) == 2 * CUTS ** 2
    near = array_cost.cells_within_reach(record_of(scene(film=40.0)), 0)
    assert 0 < near < 0.3 * 2 * CUTS ** 2                                  # π 35² of 200²


@pytest.mark.parametrize("changes, factor", [({"pings": 3}, 3), ({"threads": 2}, 0.5), ({"transmit": 4}, None)])
def test_time_grows_with_what_there_is_to_do(variant, changes, factor):
    threads = changes.pop("threads", 1)
    many = {"transmit": "line", "transmit_elements": 4} if changes.pop("transmit", None) else changes
    once = array_cost.cost(record_of(scene()), [0], threads=1)
    made = record_of(scene(**many))
    more = array_cost.cost(made, range(made.survey.track.pings), threads=threads)
    assert once.cells == more.cells == 2 * CUTS ** 2 and (once.elements, once.pairs, once.ensonifications) == (3, 1, 1)
    if factor is None:                                                     # ensonified once, carried four times
        assert (more.pairs, more.ensonifications) == (4, 1) and once.seconds < more.seconds < 4 * once.seconds
    else:
        assert more.seconds == pytest.approx(factor * once.seconds)
    exact = array_cost.cost(record_of(scene(**many), return_path="eigenray"), [0], threads=1)
    assert exact.seconds > array_cost.cost(made, [0], threads=1).seconds


@pytest.mark.parametrize("seconds, words", [
    (0.4, "under 1 s"), (5.9, "about 6 s"), (119, "about 119 s"), (120, "about 2 min"), (7000, "about 117 min"),
    (36000, "about 10 h"), (4e6, "about 1111 h")])
def test_durations_are_said_in_words(seconds, words):
    assert array_cost._duration(seconds) == words


def test_it_is_said_before_the_work_with_what_would_be_faster(variant, monkeypatch):
    monkeypatch.setattr(array_cost, "RETURNED", 1e-2)                      # a slow machine
    said = []
    small = scene(size=60.0, film=40.0, picture="elements")
    for verb in (mitsonar.render, mitsonar.element_signals, mitsonar.impulse_response):
        said.clear()
        verb(small, say=said.append, progress=lambda done, total: said.append(done))
        assert "1 ping to 3 elements, " in said[0] and " cells of 200 cm within reach: about " in said[0]
        assert "faster: a shorter range, or coarser with cell 4 (about " in said[0] and "ensonification rays" in said[0]
        assert not any(isinstance(later, str) for later in said[1:]) and len(said) > 1
    monkeypatch.undo()
    said.clear()
    mitsonar.element_signals(small, say=said.append)
    assert not said                                                        # a moment
    monkeypatch.setattr(array_cost, "RETURNED", 1e-3)
    mitsonar.element_signals(scene(ensonification="rays", film=40.0), say=said.append)
    assert said[0].startswith("1 ping to 3 elements, cells found by 5e+03 rays: about ")


@pytest.mark.parametrize("verb, total", [(mitsonar.element_signals, 2), (mitsonar.impulse_response, 4)])
def test_progress_goes_on_within_a_ping(variant, verb, total, monkeypatch):
    """Blocks of 1000 cells; signals count pings, responses pings times transmit elements."""
    monkeypatch.setattr(ensonification, "CELLS_PER_BLOCK", 1000)
    told = []
    some = scene(size=100.0, film=60.0, pings=2, transmit="line", transmit_elements=2, speed_knots=2.0)
    verb(some, range(2), progress=lambda done, of: told.append((done, of)))
    done = np.array([done for done, _ in told])
    assert {of for _, of in told} == {total} and done[-1] == total and (np.diff(done) >= 0).all()
    # what a source has ensonified is kept for the next one of the ping, which is then done at once
    for first in (0, total // 2):
        assert np.sum((done > first) & (done < first + 1)) >= 4
    assert all(number in done for number in range(1, total + 1))
