"""Scatterers thinned to the resolution: as many as asked, fixed to the ground, and of the right area together.

The number in a region is the integral of (1) of the module over it, within the 5 sigma of what low-discrepancy places
and one hash a facet leave (Poisson is an upper bound). The areas of all scatterers of a region add to its own.
"""
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.echoes.scatterers import thinned_scatterers
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.echoes.scatterers.thinned_scatterers import Density, ThinnedScatterers, TransmitLobe
from mitsonar.scene.geometry import Geometry
from mitsonar.validation import scenes

ALTITUDE, REACH = 5.0, 30.0
BEDS = {"of two facets": lambda: scenes.bed(ALTITUDE + 10, size=80.0),
        "of many": lambda: {"type": "seabed", "depth": ALTITUDE + 10, "length": 80.0, "width": 80.0, "spacing": 0.5,
                            "bsdf": scenes.lambert()}}


def density(x=0.0, per_cell=4.0):
    return Density(origin=np.array([x, 0.0, -10.0]), axis=np.array([1.0, 0.0, 0.0]), per_cell=per_cell, range_cell=0.2,
                   sine_cell=0.03, nearest=2.0, farthest=REACH)


@pytest.fixture(scope="module", params=BEDS)
def scatterers(request):
    geometry = Geometry(scenes.array_sonar({"seabed": BEDS[request.param]()}))
    return ThinnedScatterers(Scatterers(geometry, np.inf), farthest=REACH, places=np.array([[0.0, 0.0, -10.0]]))


def existing(scatterers, density):
    """Places (R, 3) in the scene, areas and amplitudes of the scatterers that exist."""
    patch, k = scatterers.candidates(density, lambda direction, distance, wider: mi.Bool(True))
    cells, exist = scatterers.at(patch, k, density)
    dr.eval(exist, cells.point, cells.area, cells.amplitude)
    there = exist.numpy()
    return (cells.point.numpy().T[there], cells.area.numpy()[there],
            (cells.amplitude[0].numpy() + 1j * cells.amplitude[1].numpy())[there])


def ring(place, inner, outer):
    distance = np.hypot(place[:, 0], place[:, 1])
    return (distance > inner) & (distance < outer)


@pytest.mark.parametrize("inner, outer", [(3.0, 8.0), (8.0, 16.0), (16.0, 28.0)])
def test_there_are_as_many_as_the_resolution_asks_for(scatterers, inner, outer):
    place, _, _ = existing(scatterers, density())
    number = int(ring(place, inner, outer).sum())
    r, phi = np.meshgrid(np.linspace(inner, outer, 400), np.linspace(0, 2 * np.pi, 720, endpoint=False))
    R = np.hypot(r, ALTITUDE)
    # the bed's normal is vertical, the axis points east: |n · (l × a)| = |l_north|
    seen = np.maximum(np.abs(r * np.sin(phi)) / R, 0.25)
    expected = 4.0 * np.mean(seen * r / R) * (outer - inner) * 2 * np.pi / (0.2 * 0.03)
    assert abs(number - expected) < 5 * np.sqrt(expected) + 0.01 * expected


def test_their_areas_add_to_that_of_the_bed(scatterers):
    place, area, _ = existing(scatterers, density())
    some = ring(place, 6.0, 28.0)
    # every scatterer of about 0.03 m2 is there or not: 1 / sqrt(number)
    assert area[some].sum() == pytest.approx(np.pi * (28.0 ** 2 - 6.0 ** 2), rel=5 / np.sqrt(some.sum()))


def test_as_the_sonar_moves_most_stay_and_keep_their_amplitudes(scatterers):
    found = (existing(scatterers, density(x)) for x in (0.0, 0.2))
    before, after = ({tuple(one.round(6)): z for one, z in zip(place, amplitude)} for place, _, amplitude in found)
    kept = set(before) & set(after)
    assert len(kept) > 0.9 * max(len(before), len(after))
    assert all(before[place] == after[place] for place in kept)


def test_fewer_a_cell_are_a_part_of_more(scatterers):
    few, many = ({tuple(place.round(6)) for place in existing(scatterers, density(per_cell=q))[0]} for q in (2.0, 6.0))
    assert few < many


def test_too_many_are_refused(scatterers):
    with pytest.raises(ValueError, match="the limit is .*Use fewer"):
        scatterers.candidates(density(per_cell=1e6), lambda direction, distance, wider: mi.Bool(True))


LOBES = {"everywhere": (), "in a narrow lobe": (0.02,), "in two wide ones": (0.2, 0.3)}


@pytest.mark.parametrize("cells", LOBES)
@pytest.mark.parametrize("around", [False, True])
@pytest.mark.parametrize("height", [0.1, 5.0, 20.0])
def test_groups_of_patches_miss_no_scatterer(variant, monkeypatch, cells, around, height):
    """A rough bed and a slanted plate, from close by to far off, looked at patch by patch and group by group."""
    bed = {"type": "seabed", "depth": 15.0, "length": 60.0, "width": 40.0, "spacing": 0.4, "fractal_rms": 0.5,
           "bsdf": scenes.lambert()}
    plate = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([4, 6, -13]).rotate([1, 0, 0], 60),
             "bsdf": scenes.lambert()}
    facets = Scatterers(Geometry(scenes.array_sonar({"seabed": bed, "plate": plate})), np.inf)
    origin = np.array([2.0, -1.0, -15.0 + height])
    lobes = tuple(TransmitLobe(axis=np.array([0.6, 0.8, 0.0]), sine=0.1 * number, cell=cell, finer=1.5,
                               place=np.array([0.0, 0.3 * number, 0.0])) for number, cell in enumerate(LOBES[cells]))
    asked = replace(density(), origin=origin, around=around, lobes=lobes)
    found = []
    for fewest in (1 << 30, 1):
        monkeypatch.setattr(thinned_scatterers, "FEWEST", fewest)
        some = ThinnedScatterers(facets, farthest=REACH, places=origin[None])
        listed = some.candidates(asked, lambda direction, distance, wider: mi.Bool(True))
        found.append([part.numpy() for part in listed])
    assert all(np.array_equal(one, other) for one, other in zip(*found))
    assert len(found[0][0])


def test_what_is_never_in_reach_has_no_patches():
    """A surface kilometres wide over a sonar of 20 m: few of its facets are cut, and none of them into millions."""
    geometry = Geometry(scenes.array_sonar({"seabed": scenes.bed(15.0, size=80.0), "sea": {"type": "sea_surface"}}))
    some = ThinnedScatterers(Scatterers(geometry, np.inf), farthest=20.0, places=np.array([[0.0, 0.0, -10.0]]))
    assert 1000 < some.patches < 4_000_000


def test_of_a_large_facet_only_what_is_in_reach_is_cut():
    """Two facets of 800 m and a reach of 30 m: the scatterers are those of facets that are cut as a whole."""
    facets = Scatterers(Geometry(scenes.array_sonar({"seabed": scenes.bed(15.0)})), np.inf)
    some, whole = (ThinnedScatterers(facets, farthest=REACH, places=np.array([[0.0, 0.0, -10.0]]), margin=margin)
                   for margin in (0.0, 1000.0))
    assert 30 * some.patches < whole.patches
    for one, other in zip(existing(some, density()), existing(whole, density())):
        np.testing.assert_array_equal(one, other)
