"""Facets that beams make negligible as a whole, or not at all, against the bound at many points of each."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsonar.device.arrays import upload
from mitsonar.echoes.scatterers.pieces import NEGLIGIBLE, pieces_in_beams
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar

SUMMER_TEXT = "0:1508, 8:1507, 14:1494, 40:1490"


@pytest.mark.parametrize("face", [{"baffle": "hard", "normal": "0, 1, 0.2"}, {
    "pattern": "rectangular", "element_length": 0.02, "element_height": 0.3, "normal": "0, 1, 0.4"}])
def test_no_cell_of_a_facet_contradicts_what_is_said_of_it(variant, rng, face):
    sensor = {f"{array}_{name}": value for array in ("transmit", "receive") for name, value in face.items()}
    relief = {"type": "seabed", "depth": 30.0, "length": 120.0, "width": 120.0, "spacing": 1.0}
    scene = array_sonar({"bed": {**relief, "bsdf": {"type": "lambert"}}},
                        water={"profile": SUMMER_TEXT}, film={"range": 50.0}, integrator={"cell": 0.2}, sensor=sensor)
    made = PressureRecord(scene.integrator().array_survey(scene, scene.sensors()[0])).ensonification(0)
    origin, rotation = np.array([0.0, 0.0, -10.0]), Rotation.from_rotvec([0.05, 0.1, 0.3]).as_matrix()
    sources, start = made._source(origin)
    _, pieces = made.pieces(origin)[0]
    found, most = pieces_in_beams(pieces, made.connector, made.beams, sources, start, rotation)
    assert {-1, 0, 1} == set(found)
    assert np.mean(found == 0) < 0.5
    for _ in range(4):
        k = pieces.first + (np.floor(rng.random(len(found)) * pieces.cells).astype(np.int64) << 2 * pieces.level)
        cells = made.scatterers.at(upload(mi.UInt32, pieces.facet), upload(mi.UInt32, k.astype(np.uint32)))
        direction = made.connector.launch_direction(sources, start, mi.UInt32(0), cells.point)
        bound = made.beams.bound(direction, mi.Float(dr.norm(cells.point - start)), rotation).numpy()
        assert np.all(bound <= most * (1 + 1e-6))
        assert np.all(bound[found == 1] > NEGLIGIBLE)
        assert np.all(bound[found == -1] <= NEGLIGIBLE)
