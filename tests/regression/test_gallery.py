"""The gallery: its plan takes every target, and a snippet of an image has the target in view and outlined."""
import importlib.util
from pathlib import Path

import numpy as np
import pytest
from labelled_sidescan import labelled

from mitsonar.sweep import load_plan

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def make_gallery():
    spec = importlib.util.spec_from_file_location("make_gallery", SCENES / "make_gallery.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_plan_is_every_target_at_three_distances_on_two_beds():
    plan = load_plan(SCENES / "gallery.toml")
    renders = [plan.render(number).parameters for number in range(len(plan))]
    kinds = {(render["species"], render["distance"], render["bed_seed"]) for render in renders}
    species = {path.stem for path in (SCENES / "targets").glob("*.ply")} - {"debris"}       # which is clutter
    assert len(species) == 12 and len(renders) == len(kinds) == 72
    assert {kind[0] for kind in kinds} == species


@pytest.mark.parametrize("ping, bin", [(5, 60), (90, 100), (190, 205)])
def test_a_snippet_has_its_target_in_view_and_outlined(make_gallery, ping, bin):
    target = [("highlight", "box.1", 1, ping, ping + 8, bin, bin + 10),
              ("shadow", "box.1", 1, ping, ping + 8, bin + 10, bin + 15)]
    colours = {None: (0.0, 0.0, 1.0), "box": (1.0, 0.0, 0.0)}
    drawn = make_gallery.snippet(labelled(200, 220, rectangles=target), colours)
    assert drawn.shape == (92, 121, 3)
    for colour in ((255, 0, 0), (0, 0, 255)):
        rows, columns = np.nonzero((drawn == colour).all(-1))
        assert 5 <= np.ptp(rows) <= 9 and 2 <= np.ptp(columns) <= 10
