"""Legs through casts of many nodes: the table of whole layers against layers one by one, and its cost."""
import json
from pathlib import Path
from time import process_time

import numpy as np
import pytest

from mitsonar.hydrography.reduction import legs
from mitsonar.hydrography.reduction.legs import COEFFICIENTS, LayerColumn, Starts
from mitsonar.water import SoundSpeedProfile

REFERENCE = Path(__file__).resolve().parents[2] / "../shared/reference/eigenrays.json"
DEPTH = np.linspace(0, 120, 400)
FINE = SoundSpeedProfile(DEPTH, 1500 - 15 * np.tanh((DEPTH - 30) / 12) + 0.5 * np.sin(3 * DEPTH))


def rays(count=500, head=False):
    rng = np.random.default_rng(5)
    depth = rng.uniform(3, 6, count)
    depth[:3] = FINE.depth[[12, 13, 14]]                       # at nodes
    start = Starts(profile=FINE, depth=depth, head_speed=FINE.at(depth) - 4 if head else None)
    end = np.r_[depth[:5] + 0.01, rng.uniform(20, 119, count - 5)]     # the first within a layer
    end[5] = FINE.depth[200]
    return start, np.sin(rng.uniform(0, 1.56, count)) / start.speed, end


@pytest.mark.parametrize("head", [False, True])
def test_table_of_whole_layers_agrees_with_layers_one_by_one(monkeypatch, head):
    # 1e-12 of the sums is what 40 coefficients leave; flatter rays are crossed one by one in both.
    start, slowness, end = rays(head=head)
    quick = start.to_depth(slowness, end)
    monkeypatch.setattr(legs, "FEW", 10**6)
    slow = start.to_depth(slowness, end)
    assert np.isnan(slow.time).any() and np.isfinite(slow.time).sum() > 300
    for one, other in zip(quick, slow):
        np.testing.assert_allclose(one, other, rtol=3e-11, atol=1e-12)


def test_rays_run_for_a_time_are_as_deep_as_that_time_takes(monkeypatch):
    start, slowness, end = rays()
    time = start.to_depth(slowness, end).time
    down = np.isfinite(time)
    np.testing.assert_allclose(start[down].depth_after(slowness[down], time[down]), end[down], atol=1e-9)
    # A guess by few nodes is near; rays that hardly get through may turn there.
    guess = start[down].coarse(time[down]).depth_after(slowness[down], time[down])
    assert np.isfinite(guess).mean() > 0.9 and np.nanmedian(np.abs(guess - end[down])) < 0.2


def test_many_nodes_cost_no_more_than_few(monkeypatch):
    start, slowness, end = rays(2000)
    LayerColumn.of(FINE, 10, 397)
    start.to_depth(slowness, end)
    spent = []
    for few in (legs.FEW, 10**6):
        monkeypatch.setattr(legs, "FEW", few)
        begin = process_time()
        start.to_depth(slowness, end)
        spent.append(process_time() - begin)
    assert spent[0] < spent[1] / 2
    assert LayerColumn.of(FINE, 10, 20).table.shape == (11, 4, COEFFICIENTS)


@pytest.mark.skipif(not REFERENCE.is_file(), reason="the shared reference of eigenrays is not here")
def test_legs_agree_with_references_of_sixty_digits():
    # Range and dx/dp at the reference's own p lose digits where the ray runs flat: 1e-8 is what p's rounding costs.
    reference = json.loads(REFERENCE.read_text(encoding="utf-8"))
    seen = 0
    for case in reference["cases"]:
        if case["branch"] != "direct" or case["target_depth"] <= case["source_depth"]:
            continue
        water = SoundSpeedProfile(*(reference["profiles"][case["profile"]][name] for name in ("depth", "c")))
        start = Starts(profile=water, depth=np.array([case["source_depth"]]))
        leg = start.to_depth(np.array([float(case["p"])]), np.array([case["target_depth"]]))
        if leg.sine[0] < 0.05 or float(case["p"]) * water.at(case["source_depth"]) > 0.999:
            continue
        wanted = [float(case[name]) for name in ("range", "time", "arc_length", "dX_dp")]
        found = [float(case["p"]) * leg.stretch[0], leg.time[0], leg.length[0], leg.slope[0]]
        np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-9, err_msg=str(case))
        seen += 1
    assert seen > 20
