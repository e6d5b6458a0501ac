"""Soundings of real multibeam sounders: eigenrays through the file's cast give the sounder's own travel times.

Measured 2017 to 2025 by three sounders, where they are at hand. One way, root mean square of a ping: 2 mm (EM 710, at
122 m), 1 mm (EM 2040, at 56 m) with three lever arms fitted, the sounders' own calculation being what is compared with;
the EM 2042 at 5 m within 1 mm with nothing fitted. tests/benchmarks/real_multibeam.py prints all of it. The same times
tell by which rules each sounder reduced its soundings.
"""
import importlib.util
from pathlib import Path

import numpy as np
import pytest

from mitsonar.io.survey_lines import reading
from mitsonar.planning.instrument_rules import rules_of

HERE = Path(__file__).resolve()
MEASURED = HERE.parents[2] / "../shared/data/measured/multibeam"
pytestmark = pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared survey lines are not here")


@pytest.fixture(scope="module")
def benchmark():
    specification = importlib.util.spec_from_file_location("real_multibeam",
                                                           HERE.parents[1] / "benchmarks/real_multibeam.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name, held, bare, fitted, depth, aside", [
    ("em710_122m.all", True, 5e-3, 2e-3, 0.01, 0.02), ("em2040_56m.all", True, 0.04, 1e-3, 0.05, 0.13),
    ("em2042_os01.kmall", False, 1e-3, 1e-3, 2e-3, 2e-3)])
def test_times_and_places_are_the_sounder_s(benchmark, name, held, bare, fitted, depth, aside):
    pings = list(benchmark.pings_of(MEASURED / name, held))
    assert len(pings) >= 4
    for ours, with_arms, _ in pings:
        assert benchmark.rms(ours) < bare and benchmark.rms(with_arms) < fitted
    places = np.concatenate([one[2] for one in pings])
    assert np.isfinite(places).mean() > 0.999
    assert benchmark.rms(places[:, 0]) < depth and benchmark.rms(places[:, 1:]) < aside


@pytest.mark.parametrize("name, under_way", [("em710_122m.all", False), ("em2042_os01.kmall", True)])
def test_the_rules_of_a_sounder_are_found(name, under_way):
    rules = rules_of(reading.read(MEASURED / name, water_column=False))
    assert rules.node and rules.under_way == under_way
    assert rules.residual[True, under_way] < 0.4 * min(
        value for rule, value in rules.residual.items() if rule != (True, under_way))


def test_the_motion_of_an_all_file_is_that_of_its_pings():
    """The transducer depth is heave and mounting depth; the motion was 2 cm off, by the lever times its pitch."""
    line = reading.read(MEASURED / "em710_122m.all", water_column=False)
    there = np.interp(line["ping_time"], line["motion_time"], line["motion_depth"])
    inside = (line["ping_time"] > line["motion_time"][0]).values & (line["ping_time"] < line["motion_time"][-1]).values
    assert np.abs(line["ping_depth"].values - there)[inside].max() < 0.003
