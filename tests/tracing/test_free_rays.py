"""Free rays, and points connected to points: what hides them, on bodies far away, and by way of the surface.

A point on a small sphere is hidden by the sphere if its normal looks away, however far the other end is: for float32 a
sphere of 0.2 m at 300 m is known to some centimetres only from its neighbourhood. Points within asin(0.05) of the edge
are left out. A ray by way of the surface from 10 m to 10 m depth over 20 m meets the surface half way.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.free_rays import FreeRays
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

SUMMER = [0, 11, 20, 40], [1513.2, 1506.4, 1494.2, 1492.2]


def traced(shapes, profile):
    """A tracer in the water and scene of {id: dict}."""
    return Tracer(mi.load_dict({"type": "scene", **shapes}, optimize=False), DeviceWater(SoundSpeedProfile(*profile)),
                  max_range=400.0)


def connector(shapes, profile):
    """A connector there."""
    tracer = traced(shapes, profile)
    return Connector(tracer.geometry, tracer.water)


def wide(points):
    """NumPy (3, N) on the device."""
    return arrays_of(mi.Float).Array3f64(*(mi.Float64(np.ascontiguousarray(axis, float)) for axis in points))


@pytest.mark.parametrize("radius, distance", [(0.2, 300.0), (1.0, 300.0), (0.2, 30.0)])
def test_a_sphere_far_away_hides_its_other_side_and_no_more(variant, rng, radius, distance):
    free = connector({"ball": {"type": "sphere", "center": [distance, 0, -100], "radius": radius}}, ([0.0], [1500.0]))
    normal = rng.normal(size=(3, 4000))
    normal /= np.linalg.norm(normal, axis=0)
    point = np.array([[distance], [0], [-100]]) + radius * normal
    away = np.broadcast_to([[0.0], [0.0], [-30.0]], point.shape)
    towards = (away - point) / np.linalg.norm(away - point, axis=0)
    sine = np.sum(towards * normal, axis=0)
    on, off = mi.Vector3f(*map(mi.Float, normal.astype(np.float32))), mi.Vector3f(0, 0, 0)
    for way in (free.join(wide(away), off, wide(point), on), free.join(wide(point), on, wide(away), off)):
        assert way.exists.numpy().all()
        np.testing.assert_array_equal(way.free.numpy()[abs(sine) > 0.05], (sine > 0)[abs(sine) > 0.05])


@pytest.mark.parametrize("profile", [([0.0], [1500.0]), SUMMER])
@pytest.mark.parametrize("top, bottom, direct, folded",
                         [(0, 3, True, False), (8, 35, False, True), (38, 39, True, True)])
def test_what_hangs_from_the_surface_hides_the_way_by_it(variant, profile, top, bottom, direct, folded):
    T = mi.ScalarTransform4f
    wall = {"type": "rectangle", "to_world": T().translate([0, 9, -(top + bottom) / 2]).rotate(
        [1, 0, 0], -90).scale([20, (bottom - top) / 2, 1])}
    bed = {"type": "rectangle", "to_world": T().translate([0, 0, -40]).scale([99, 99, 1])}
    free = connector({"bed": bed, "wall": wall, "sea": {"type": "sea_surface", "wind_speed": 0.0, "size": 100.0}},
                     profile)
    start, end, none = wide([[0], [0], [-10]]), wide([[0], [20], [-10]]), mi.Vector3f(0, 0, 0)
    assert bool(dr.all(free.join(start, none, end, none).free)) is direct
    assert bool(dr.all(free.join(start, none, end, none, folded=True).free)) is folded


@pytest.mark.parametrize("profile", [([0.0], [1500.0]), SUMMER])
def test_free_rays_meet_what_the_rays_of_a_source_meet(variant, rng, profile):
    """From the same place in the same directions, within 2 mm: a free ray's chords lie so far off, and what follows it.

    The bed lies where a layer of the summer's water ends, where chords end, too: none slips through.
    """
    tracer = traced({"bed": {"type": "rectangle", "to_world": mi.ScalarTransform4f().translate([0, 0, -40]).scale(
        [300, 300, 1])}}, profile)
    angle, azimuth = np.radians(rng.uniform(8, 80, 500)), rng.uniform(0, 2 * np.pi, 500)
    direction = mi.Vector3f(*(mi.Float(axis.astype(np.float32)) for axis in (
        np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), -np.sin(angle))))
    origin = wide([[0], [0], [-10]])
    known = tracer.trace(tracer.sources([10.0]), origin, mi.UInt32(0), direction)
    start = origin + dr.zeros(type(origin), 500)
    free = FreeRays(tracer).hit(start, mi.Vector3f(0, 0, 0), direction)
    assert known.valid.numpy().all() and free.valid.numpy().all()
    np.testing.assert_allclose(free.point.numpy(), known.point.numpy(), atol=2e-3)
    np.testing.assert_allclose(free.travel_time.numpy(), known.travel_time.numpy(), atol=2e-3 / 1490)
    np.testing.assert_allclose(free.arrival_direction.numpy(), known.arrival_direction.numpy(), atol=2e-5)
    assert np.isnan(free.spreading_area.numpy()).all()
