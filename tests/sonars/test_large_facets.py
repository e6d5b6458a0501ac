"""Of facets larger than the reach only the cells in reach are listed: no cell is missed, none listed twice."""
import numpy as np
import pytest

from mitsonar.echoes.scatterers.pieces import pieces_in_reach
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.loading import prepare
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar, bed


def tilted(tmp_path):
    """One long triangle and one short, tilted, beside a wall."""
    path = tmp_path / "slope.obj"
    path.write_text("v -90 -40 -25\nv 120 -20 -14\nv -30 80 -30\nv 95 90 -18\nv 5 6 -20\nv 5 12 -20\nv 5 12 -14\n"
                    "f 1 2 3\nf 3 2 4\nf 5 6 7\n")
    return {"type": "obj", "filename": str(path), "bsdf": {"type": "lambert", "mu_db": -27.0}}


@pytest.mark.parametrize("kind,start", [("rectangle", [0.0, 0.0, -10.0]), ("rectangle", [49.0, -43.0, -10.0]),
                                        ("slope", [10.0, 10.0, -10.0]), ("slope", [-40.0, 20.0, -12.0])])
def test_no_cell_in_reach_is_missed(variant, tmp_path, kind, start):
    prepare()
    shape = bed(20.0, size=100.0) if kind == "rectangle" else tilted(tmp_path)
    geometry = Geometry(array_sonar({"bed": shape}))
    scatterers, reach = Scatterers(geometry, 0.3), 17.0
    facets = scatterers.in_reach(np.array(start), 0.0, reach)

    def near(stretches):
        found = set()
        for facet, s in scatterers.listed(stretches, 50_000):
            point = scatterers.at(facet, s).point.numpy().T
            close = np.linalg.norm(point - start, axis=1) < reach
            found |= set(zip(facet.numpy()[close].tolist(), s.numpy()[close].tolist()))
        return found

    cuts = scatterers.cuts[facets].astype(np.int64)
    every = facets, np.zeros(len(facets), np.int64), np.ones(len(facets), np.int64), cuts ** 2
    some = pieces_in_reach(scatterers, facets, np.array(start), 0.0, reach).runs()
    assert near(some) == near(every) and len(near(every)) > 1000
    assert some[3].sum() < 0.3 * every[3].sum()
    assert all(np.all(s.numpy() < cuts.max() ** 2) for _, s in scatterers.listed(some, 50_000))


def test_pieces_hold_their_cells_and_those_nearer_than_the_record_are_left_out(variant, tmp_path):
    geometry = Geometry(array_sonar({"bed": tilted(tmp_path)}))
    scatterers, origin = Scatterers(geometry, 0.1), np.array([10.0, 10.0, -10.0])
    facets = scatterers.in_reach(origin, 0.0, 30.0)
    pieces = pieces_in_reach(scatterers, facets, origin, 25.0, 30.0)
    piece = np.repeat(np.arange(len(pieces.cells)), pieces.cells)
    point = np.concatenate([scatterers.at(facet, s).point.numpy().T
                            for facet, s in scatterers.listed(pieces.runs(), 50_000)])
    off = np.linalg.norm(point - pieces.centre[piece], axis=1)
    assert np.all(off < pieces.radius[piece] * (1 + 1e-6))
    distance = np.linalg.norm(pieces.centre - origin, axis=1)
    assert np.all(distance + pieces.radius > 25.0) and np.all(distance - pieces.radius < 30.0)
    every = pieces_in_reach(scatterers, facets, origin, 0.0, 30.0).cells.sum()
    assert 100_000 < pieces.cells.sum() < 0.8 * every


def test_cells_listed_once(variant):
    scatterers = Scatterers(Geometry(array_sonar({"bed": bed(20.0, size=100.0)})), 0.5)
    facets = scatterers.in_reach(np.array([3.0, 4.0, -10.0]), 0.0, 15.0)
    runs = pieces_in_reach(scatterers, facets, np.array([3.0, 4.0, -10.0]), 0.0, 15.0).runs()
    numbers = [facet.numpy().astype(np.uint64) << np.uint64(32) | s.numpy()
               for facet, s in scatterers.listed(runs, 777)]
    assert max(map(len, numbers)) <= 777
    numbers = np.concatenate(numbers)
    assert len(np.unique(numbers)) == len(numbers)


def test_a_huge_bed_costs_what_is_in_reach(variant):
    """1 km at 5 cm is 1.6 x 10^9 cells; listing them all would take minutes."""
    scene = array_sonar({"bed": bed(20.0, size=1000.0)}, integrator={"cell": 0.05}, film={"range": 12.0})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    scatterers = PressureRecord(survey).ensonification(0).scatterers
    origin = survey.track.position[0]
    listed = pieces_in_reach(scatterers, scatterers.in_reach(origin, 0.0, 12.0), origin, 0.0, 12.0).cells.sum()
    assert listed < 2 * np.pi * (12.0 ** 2 - 10.0 ** 2) / (0.5 * 0.05 ** 2 / 2)
    assert np.abs(PressureRecord(survey).at(0).responses()).max() > 0
