"""Pings that find out for their neighbours where rays are needed: who asks whom, and that blocks play no part."""
import numpy as np
import pytest

from mitsonar.sonar.motion.track import Track
from mitsonar.survey.energy import sides as module
from mitsonar.survey.energy.energy import record
from mitsonar.survey.energy.side_launch import GROUP, scouts
from mitsonar.survey.energy.sides import Sides
from mitsonar.validation.scenes import bed, lambert, sidescan

BEAM, FARTHEST = 0.02, 50.0        # [rad], [m]: 1 m wide at the end of the record


def track(pings, step=0.1, turn=0.0):
    """A straight track north whose heading turns by so much [rad] a ping."""
    number = np.arange(pings)
    return Track(time=0.1 * number, position=np.stack([0.0 * number, step * number, -5.0 + 0 * number], -1),
                 heading=turn * number, pitch=0.0 * number, roll=0.3 * (number % 2))


def test_pings_of_a_group_ask_one_of_them_whatever_their_roll():
    np.testing.assert_array_equal(scouts(track(10), FARTHEST, BEAM), [2, 2, 2, 2, 6, 6, 6, 6, 9, 9])


@pytest.mark.parametrize("step, turn, expected", [(1.5, 0.0, [0, 1, 2, 3]), (0.7, 0.0, [0, 2, 2, 2]),
                                                  (0.1, 0.03, [0, 1, 2, 3]), (0.1, 0.01, [0, 2, 2, 2])])
def test_pings_that_see_other_ground_are_scouts_themselves(step, turn, expected):
    np.testing.assert_array_equal(scouts(track(4, step, turn), FARTHEST, BEAM), expected)


def survey_of(pings):
    made = sidescan({"seabed": bed(20.0, lambert(-27.0), size=120.0)}, rays=8000,
                    sensor={"start": [0.0, 0.0, -12.0], "pings": pings, "speed_knots": 2.0},
                    film={"range": 20.0, "bins": 60})
    return made.integrator().survey(made, made.sensors()[0])


def test_a_group_makes_one_first_pass_and_blocks_change_no_byte(variant, monkeypatch):
    found, need = [], module.aside_need

    def counted(*rays, rows, **more):
        found.append(rows)
        return need(*rays, rows=rows, **more)

    monkeypatch.setattr(module, "aside_need", counted)
    survey, made = survey_of(2 * GROUP + 1), []
    for size in (2 * GROUP + 1, 3, 1):
        rows = Sides(survey)
        rows.pings_per_block = size
        found.clear()
        made.append(record(survey, rows, 1))
        assert sum(found) == 2 * 3, f"sides that were asked, in blocks of {size}"
    for other in made[1:]:
        np.testing.assert_array_equal(other.intensity, made[0].intensity)
        np.testing.assert_array_equal(other.rays, made[0].rays)


def test_a_rows_need_of_rays_is_its_own_whatever_is_traced_with_it(variant):
    """A row that few rays aside reach, alone and beside a row with forty times as many."""
    import mitsuba as mi

    from mitsonar.device.arrays import upload
    from mitsonar.scene.tracing.launch import CELLS
    from mitsonar.survey.energy.energy_bins import EnergyBins, aside_need

    bins, rng = EnergyBins(start=0.0, length=1e-3, count=60, sound_speed=1500.0, beam=1.0, absorption_db=0.0), (
        np.random.default_rng(5))

    def need(*rays):
        row = np.repeat(np.arange(len(rays)), rays)
        cell, bin = row * CELLS + rng.integers(CELLS, size=len(row)), rng.integers(60, size=len(row))
        cell[:rays[0]], bin[:rays[0]] = first
        aside = np.arange(len(row)) % 2 == 0
        row, cell, bin = (upload(mi.UInt32, column.astype(np.uint32)) for column in (row, cell, bin))
        return aside_need(row, cell, bin, mi.Bool(True), mi.Bool(aside), rows=len(rays), bins=bins, drawn=0.5,
                          wanted=0.1)[:, 0]                                # of the first row

    first = rng.integers(CELLS, size=200), rng.integers(60, size=200)
    np.testing.assert_array_equal(need(200), need(200, 8000))
