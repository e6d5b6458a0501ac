"""Cells in side lobes: thinned to a share of them, they bring the energy of all, and none comes without its reason.

The energy of thinned cells is a sum over cells that exist with the chance p, each as 1/p of itself: its variance is at
most Σ e² (1/p - 1). Four of its roots are passed once in 16,000 draws.
"""
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.survey.pressure.ensonified_ping import ensonification_of
from mitsonar.validation.scenes import array_sonar, bed

BELOW = 1e-2
SIDE = {f"{array}_{name}": value for array in ("transmit", "receive") for name, value in {
    "pattern": "rectangular", "element_length": 0.04, "element_height": 0.01, "normal": "0, 1, 0.5",
    "baffle": "hard"}.items()}


@pytest.fixture(scope="module", params=["large facets", "a mesh"])
def survey(request):
    shape = bed(16.0, size=100.0) if request.param == "large facets" else {
        "type": "seabed", "depth": 16.0, "length": 80.0, "width": 80.0, "spacing": 0.7, "bsdf": {"type": "lambert"}}
    scene = array_sonar({"bed": shape}, film={"range": 20.0, "range_min": 14.0}, sensor=SIDE, integrator={"cell": 0.1})
    return scene.integrator().array_survey(scene, scene.sensors()[0])


def echoes(survey, below, at=(0.0, 0.0, -10.0)):
    """Places and energies of the echoes, (N, 3) and (N,)."""
    light = ensonification_of(replace(survey, thin_below=below))
    blocks = list(light.scatterer_echoes(np.array(at), survey.track.rotation()[0], 6.0, 0))
    place = np.concatenate([block.out.offset.numpy().T for block in blocks]) + at
    return place, np.concatenate([block.energy.numpy() for block in blocks]).astype(float)


def numbered(place):
    """Cells by their scatterers' places, to a tenth of a millimetre, sorted."""
    x, y, _ = np.round(1e4 * place).astype(np.int64).T
    return np.unique((x << 32) + y)


def test_thinned_cells_bring_the_energy_of_all_in_every_sector(survey):
    (place, energy), (few, thinned) = echoes(survey, 0.0), echoes(survey, BELOW)
    assert len(few) < 0.35 * len(place)
    edges = np.radians([-90, -50, -30, -15, -5, 5, 15, 30, 50, 90])
    for low, high in zip(edges[:-1], edges[1:]):
        sums = []
        for where, values in ((place, energy), (few, thinned)):
            angle = np.arctan2(where[:, 1], where[:, 0])
            inside = (angle > low) & (angle <= high)
            sums.append((values[inside].sum(), (values[inside] ** 2).sum()))
        (expected, _), (found, squares) = sums
        # of thinned echoes, e²/p² for those that exist: its mean is Σ e²/p
        assert abs(found - expected) < 4 * np.sqrt(squares) + 1e-6 * expected


def test_the_main_lobe_is_whole(survey):
    (place, energy), (few, thinned) = echoes(survey, 0.0), echoes(survey, BELOW)
    ahead = [np.abs(np.arctan2(where[:, 1], where[:, 0])) < np.radians(5) for where in (place, few)]
    np.testing.assert_array_equal(energy[ahead[0]].sum(), thinned[ahead[1]].sum())


def test_cells_that_exist_are_a_part_of_those_under_less_thinning(survey):
    every, some, few = (numbered(echoes(survey, below)[0]) for below in (0.0, BELOW / 10, BELOW))
    assert np.isin(few, some).all() and np.isin(some, every).all()
    assert len(few) < len(some) < len(every)


def test_neighbouring_pings_thin_to_nearly_the_same_cells(survey):
    here, there = (numbered(echoes(survey, BELOW, (0.0, y, -10.0))[0]) for y in (0.0, 0.05))
    assert np.isin(here, there).mean() > 0.95


def test_no_cell_that_may_exist_is_left_out_when_they_are_listed(survey):
    """Listing of the first ones of each piece, against a look at every cell."""
    light = ensonification_of(replace(survey, thin_below=BELOW))
    origin, rotation = np.array([0.0, 0.0, -10.0]), survey.track.rotation()[0]
    found, every = (numbered(echoes(survey, below)[0]) for below in (BELOW, 0.0))
    exist = []
    sources, start = light._source(origin)
    for _, pieces in light.pieces(origin):
        for facet, k in light.scatterers.listed(pieces.runs(), 1 << 20):
            point = light.scatterers.at(facet, k).point
            direction = light.connector.launch_direction(sources, start, mi.UInt32(0), point)
            bound = light.beams.bound(direction, mi.Float(dr.norm(point - start)), rotation)
            these = light.scatterers.exist(facet, k, light.side_lobes.share(bound)) & (bound > 1e-8)
            exist.append(numbered(point.numpy().T[these.numpy()]))
    np.testing.assert_array_equal(np.intersect1d(np.concatenate(exist), every), found)
