"""Echoes of a bed with glints, and of one with weed: means stay, second moments are those of the glints in a cell.

    <I²>/<I>² = 2 (1 + s² / (β A)) + 2 / N

A = (∫ b dA)² / ∫ b² dA, the area of a resolution cell with its two-way response b to intensity. For a sidescan's gate
of the length ΔR in slant range, at the distance R and the grazing angle θ, A = R W ΔR / cos θ, W = (∫ b du)² / ∫ b² du
over the cosine along the platform. N scatterers lie in a cell: what they add is taken out by the same ones without
glints. 4 standard errors of the sample are allowed, and 3 % more for A.
"""
from dataclasses import replace
from functools import cache

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render

from mitsonar.device.arrays import arrays_of
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.echoes.scatterers.thinned_scatterers import Density, ThinnedScatterers
from mitsonar.scattering.surfaces.weed import Weed
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.loading import prepare
from mitsonar.survey.sidescan.kind import plan
from mitsonar.survey.sidescan.side_beam import main_lobe
from mitsonar.survey.sidescan.speckle import SideSpeckle
from mitsonar.units import KNOT
from mitsonar.validation import scenes

HEIGHT, PINGS = 20.0, 250


@pytest.fixture(scope="module", autouse=True)
def ready():
    prepare()


def bed(size=2000.0, depth=40.0, **variation):
    return scenes.bed(depth, {**scenes.lambert(), **variation}, size=size)


# ---- a sidescan's speckle

@cache
def intensity_of_gates(per_cell=5.0, **variation):
    """Intensities (ping, side, gate) beyond 60 m, of pings 2 m apart, and the areas of the cells (gate,) [m²]."""
    scene = scenes.sidescan({"bed": bed(**variation)}, rays=100, film={"range": 75.0, "bins": 1000},
                            sensor={"pings": PINGS, "ping_rate_hz": 2.0, "speed_knots": 8.0},
                            integrator={"scatterers_per_cell": per_cell})
    survey = plan(scene, scene.sensors()[0], replace(scene.integrator().settings, seed=3))
    speckle = SideSpeckle(survey)
    step = 75.0 / speckle.gates
    first = round(60.0 / step)
    R = step * (np.arange(first, speckle.gates) + 0.5)
    beam = main_lobe(survey.sonar, 75.0)
    lobe = beam.pressure[int(beam.nearest(np.array(67.5)))]
    power, du = np.abs(lobe) ** 2, beam.edge[int(beam.nearest(np.array(67.5)))] / (len(lobe) - 1)
    width = 2 * np.trapezoid(power, dx=du) ** 2 / np.trapezoid(power ** 2, dx=du)
    area = R * width * step / np.sqrt(1 - (HEIGHT / R) ** 2)
    return np.abs(speckle.of(np.arange(PINGS))[..., first:, 0]) ** 2, area


@pytest.mark.parametrize("per_area, share, per_cell", [(20.0, 0.5, 5.0), (100.0, 1.0, 5.0), (20.0, 0.5, 40.0)])
def test_gates_of_a_sidescan_have_the_moments_of_their_glints(per_area, share, per_cell):
    """The same whatever the number of scatterers in a cell."""
    plain, area = intensity_of_gates(per_cell)
    glinting, _ = intensity_of_gates(per_cell, glints=per_area, glint_share=share)
    n = glinting.size
    assert glinting.mean() == pytest.approx(1.0, abs=4 * glinting.std() / np.sqrt(n) + 0.003)
    wanted = 2 * share ** 2 / per_area * np.mean(1 / area)
    error = 4 * (glinting ** 2).std() / np.sqrt(n)
    found = (glinting ** 2).mean() - (plain ** 2).mean()
    assert wanted > 2 * error                       # so that the test says something
    assert found == pytest.approx(wanted, abs=error + 0.03 * wanted)


def test_neighbouring_gates_do_not_share_glints():
    """Correlation of intensities of neighbours, in which patches would show."""
    glinting, _ = intensity_of_gates(glints=20.0, glint_share=0.5)
    change = glinting - glinting.mean()
    assert abs((change[..., 1:] * change[..., :-1]).mean()) < 5 * (change ** 2).mean() / np.sqrt(change.size)


# ---- scatterers of arrays

@pytest.mark.parametrize("way, cell", [("elements", 0.3), ("elements", 0.01), ("beams", 0.0)])
def test_squares_of_bed_have_the_glints_of_their_area_for_elements_and_beams(way, cell):
    """Powers with and without glints of the same scatterers, in squares of 0.9 m, 0.1 m with 1 cm cells."""
    side, per_area, share = (0.1, 40.0, 0.8) if cell == 0.01 else (0.9, 10.0, 0.8)
    power = []
    for variation in ({}, {"glints": per_area, "glint_share": share}):
        size = 9.0 if cell == 0.01 else 70.0
        geometry = Geometry(scenes.array_sonar({"bed": bed(size=size, depth=15.0, **variation)}))
        if way == "elements":
            facets = Scatterers(geometry, cell)
            number, k = np.divmod(np.arange(2 * int(facets.cuts[-1]) ** 2), int(facets.cuts[-1]) ** 2)
            facet = np.flatnonzero(facets.scattering)[number]
            cells = facets.at(*(mi.UInt32(column.astype(np.uint32)) for column in (facet, k)))
            cells, exist = facets.glinted(cells, cells.area), np.ones(len(k), bool)
        else:
            density = Density(origin=np.array([0.0, 0.0, -10.0]), axis=np.array([1.0, 0.0, 0.0]), per_cell=6.0,
                              range_cell=0.1, sine_cell=0.02, nearest=2.0, farthest=30.0)
            thinned = ThinnedScatterers(Scatterers(geometry, np.inf), farthest=30.0,
                                        places=np.array([[0.0, 0.0, -10.0]]))
            cells, exist = thinned.at(*thinned.candidates(density, lambda *_: mi.Bool(True)), density)
            exist = exist.numpy()
        x, y, _ = cells.point.numpy()[:, exist]
        energy = (dr.square(cells.amplitude[0]) + dr.square(cells.amplitude[1])).numpy()[exist]
        power.append(energy.astype(float))
    area = cells.area.numpy()[exist]
    square = np.floor(x / side).astype(int) * 100_000 + np.floor(y / side).astype(int)
    square = np.unique(square, return_inverse=True)[1]
    weight, S = np.bincount(square, area), np.bincount(square, area * power[1] / power[0])
    whole = np.abs(weight / side ** 2 - 1) < 0.5              # the others lie at the edge
    S = S[whole] / weight[whole]
    wanted = share ** 2 * np.mean(1 / weight[whole]) / per_area
    assert S.mean() == pytest.approx(1.0, abs=4 * np.sqrt(wanted / len(S)))
    error = 4 * np.std((S - 1) ** 2) / np.sqrt(len(S))
    assert error < 0.3 * wanted
    assert S.var() == pytest.approx(wanted, abs=error + 0.05 * wanted)


# ---- rays

def test_weed_is_where_its_field_says():
    """Levels of a sidescan over those without weed, against 1 + f (w - 1) at the middle of each bin.

    Patches of 12 m with edges of 4 m are wide against bins of 0.15 m by 1 m; 300 rays a bin leave 3 % of noise.
    """
    def level(**variation):
        scene = scenes.sidescan({"bed": bed(depth=40.0, size=400.0, **variation)}, rays=60_000, pings=3,
                                sensor={"ping_rate_hz": 0.2, "speed_knots": 2.0, "noise": False, "speckle": False},
                                film={"range_min": 35.0, "range": 65.0, "bins": 100})
        dataset = render(scene)[0]
        return dataset, 10 ** (dataset["mean_level"].values.astype(float) / 10)

    weed = {"cover": 0.4, "size": 12.0, "edge": 4.0}
    with_weed = level(weed_db=7.0, **{f"weed_{name}": value for name, value in weed.items()})
    dataset, bare = level()
    ratio = with_weed[1] / bare
    ground = np.sqrt(dataset["range"].values ** 2 - HEIGHT ** 2)
    on_bed = Weed(strength=10 ** 0.7, **weed).on(arrays_of(mi.Float))
    north = np.arange(3) * 5.0 * 2.0 * KNOT
    for side, sign in ((0, -1), (1, 1)):
        x, y = np.meshgrid(sign * ground, north)
        wanted = on_bed.at(*(mi.Float(v.ravel().astype(np.float32)) for v in (x, y))).numpy().reshape(x.shape)
        error = ratio[:, side] / wanted - 1
        assert wanted.std() > 0.5
        assert abs(error.mean()) < 0.01 and error.std() < 0.03
