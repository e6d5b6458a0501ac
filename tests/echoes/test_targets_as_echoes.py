"""Point targets: drawn evenly, each with its strength, seen past what they lie on, and not through what hides them."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import arrays_of
from mitsonar.echoes.point_targets import PointTargets
from mitsonar.echoes.sights.sights import Sights
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

TARGETS = [((0.0, 30.0, -40.0), -20.0, 3), ((20.0, 0.0, -25.0), -35.0, 5), ((-15.0, -15.0, -45.0), -10.0, 4)]


def test_draws_are_even_and_carry_the_strength_over_their_chance(variant):
    targets = PointTargets(TARGETS)
    which, strength = targets.drawn(mi.Float((np.arange(3000) / 3000).astype(np.float32)))
    assert np.bincount(which.numpy()).tolist() == [1000, 1000, 1000]
    expected = 10 ** (np.array([-20.0, -35.0, -10.0]) / 10)
    np.testing.assert_allclose(strength.numpy(), 3 * expected[which.numpy()], rtol=1e-5)
    np.testing.assert_array_equal(targets.label(which).numpy(), np.array([3, 5, 4])[which.numpy()])
    np.testing.assert_allclose(targets.position(which).numpy().T, np.array([p for p, *_ in TARGETS])[which.numpy()])


def test_a_scene_without_targets_has_none(variant):
    assert not PointTargets([])


def test_targets_echo_as_the_sonar_equation_has_it_unless_a_bed_hides_them(variant):
    """TS - 40 log10 r in water without absorption; the first lies on the bed, the third 5 m below it."""
    bed = {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -40]).scale([300, 300, 1])}
    geometry = Geometry(mi.load_dict({"type": "scene", "bed": bed}, optimize=False))
    water = DeviceWater(SoundSpeedProfile.constant(1500.0))
    targets, lib = PointTargets(TARGETS), arrays_of(mi.Float)
    sources = Tracer(geometry, water, max_range=200.0).sources([10.0])
    (echoes, free), = targets.echoes(Sights(Connector(geometry, water), max_depth=3), sources,
                                     lib.Array3f64(0, 0, -10), mi.UInt32(0), dr.arange(mi.UInt32, 3))
    distance = np.linalg.norm(np.array([p for p, *_ in TARGETS]) - [0, 0, -10], axis=1)
    assert free.numpy().tolist() == [True, True, False] and echoes.energy.numpy()[2] == 0
    level = 10 * np.log10(echoes.energy.numpy()[:2])
    assert level == pytest.approx([ts - 40 * np.log10(r) for (_, ts, _), r in zip(TARGETS[:2], distance)], abs=1e-3)
    np.testing.assert_allclose(echoes.out.travel_time.numpy()[:2], distance[:2] / 1500, rtol=1e-9)
