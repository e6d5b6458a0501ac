"""Prices of a dry run: hours of cores and bytes times the rates that are given."""
import pytest

from mitsonar.sweep import prices
from mitsonar.sweep.estimate import Estimate, SceneCost
from mitsonar.sweep.prices import Rates, costs

ESTIMATE = Estimate(folder="", total=5000, missing=2000, changed=0, damaged=0, processes=8, threads=2, at_once=8,
                    seconds=9.0, bytes=3e6, duration=2250.0, trials=3, free=0, unplanned=[])


@pytest.fixture(autouse=True)
def cores(monkeypatch):
    monkeypatch.setattr(prices, "cores", lambda: 16)


@pytest.mark.parametrize("rates, said", [
    (Rates(core_hour=0.5, gb_month=0.02, currency="EUR"), "5.00 EUR and 0.12 EUR a month"),
    (Rates(core_hour=400), "4,000.00"), (Rates(gb_month=0.0), "0 a month"), (Rates(), "")])
def test_prices_are_rates_times_hours_of_cores_and_gigabytes(rates, said):
    hours, size, price = costs(ESTIMATE, 2, rates, 2000)
    assert (hours, size, price) == (2000 * 9 * 2 / 3600, 6e9, said)        # two threads of a process are two cores


def test_a_scene_of_a_plan_has_a_price_of_its_own():
    scene = SceneCost(name="fan.xml", missing=10, seconds=36.0, bytes=1e6, trials=2)
    assert costs(scene, 2, Rates(core_hour=1, gb_month=1), 1000) == (20.0, 1e9, "20.00 and 1.00 a month")


def test_a_process_takes_no_more_cores_than_there_are(monkeypatch):
    monkeypatch.setattr(prices, "cores", lambda: 1)
    assert costs(ESTIMATE, 2, Rates(), 1000)[0] == 2.5


@pytest.mark.parametrize("wrong, said", [({"core_hour": -1}, "rate of a core hour is -1"),
                                         ({"gb_month": float("nan")}, "rate of a GB and month is nan"),
                                         ({"currency": "a\nb"}, "the currency is")])
def test_rates_that_are_none_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        Rates(**wrong)
