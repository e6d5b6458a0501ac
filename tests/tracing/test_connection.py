"""Points connected to a source: the ray is the exact eigenray, and what stands in its way is found.

Truth for rays is `propagation.eigenray` (NumPy, checked against 60-digit arithmetic): every connection must be the
earliest arrival there, its time to 1 ns (found: 1e-10 s), and none may be missed. Truth for
occlusion in water of one speed are Mitsuba's own straight rays to the same lifted points: 1 in 1000 may differ, where
a silhouette lies within the 8 mm of the chords.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from summer import SUMMER_TABLE

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.echoes.point_targets import TARGET_RADIUS
from mitsonar.propagation import eigenray
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.shadows.occlusion import LIFT, LIFT_PER_RANGE
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

POINTS = 6000
PROFILES = {
    "constant": ([0.0], [1500.0]),
    "gradient": ([0.0, 200.0], [1450.0, 1650.0]),
    "summer": SUMMER_TABLE,
    "duct": ([0.0, 25.0, 60.0], [1500.0, 1475.0, 1510.0]),
    "zigzag": (np.arange(0.0, 61.0, 1.0), 1490 + 2.5 * (-1.0) ** np.arange(61)),
}


@pytest.fixture(scope="module")
def bed():
    """A rough bed about 45 m deep."""
    from mitsonar.scene.loading import prepare

    prepare()
    relief = {"fractal_rms": 0.6, "fractal_gamma": 3.3, "fractal_outer_scale": 60.0}
    return Geometry(mi.load_dict({"type": "scene", "bed": {
        "type": "seabed", "depth": 45.0, "length": 300.0, "width": 300.0, "spacing": 1.0, **relief}}, optimize=False))


def places(geometry, rng):
    """Points on the facets and the normals there, as NumPy (N, 3)."""
    vertices = geometry.vertices.numpy().reshape(-1, 4)[:, :3].astype(float)
    faces = geometry.faces.numpy().reshape(-1, 4)[:, :3]
    corner = vertices[faces[rng.integers(0, len(faces), POINTS)]]
    u, v = rng.random((2, POINTS, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    normal = np.cross(a, b)
    return corner[:, 0] + u * a + v * b, normal / np.linalg.norm(normal, axis=1, keepdims=True)


def connect(geometry, profile, depth, point, normal, **options):
    tracer = Tracer(geometry, DeviceWater(profile), max_range=260.0)
    lib = arrays_of(mi.Float)
    way = Connector(tracer.geometry, tracer.water).connect(
        tracer.sources([depth]), lib.Array3f64(0, 0, -depth), mi.UInt32(0),
        lib.Array3f64(*(upload(mi.Float64, column) for column in point.T)),
        mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in normal.T)), **options)
    dr.eval(vars(way))
    return way


@pytest.mark.parametrize("depth", [10.3, 20.0])
@pytest.mark.parametrize("name", PROFILES)
def test_the_ray_is_an_eigenray(variant, bed, rng, name, depth):
    profile = SoundSpeedProfile(*PROFILES[name])
    point, normal = places(bed, rng)
    way = connect(bed, profile, depth, point, normal)
    found = way.exists.numpy()
    across = np.hypot(point[:, 0], point[:, 1])
    exact = eigenray(profile, depth, -point[:, 2], across)
    assert (found == exact.exists).all()
    assert np.abs(exact.travel_time - way.travel_time.numpy())[found].max() < 1e-9
    assert np.median(np.abs(way.spreading_area.numpy() / exact.spreading_area - 1)[found]) < 1e-5
    launch = np.arcsin(-way.launch_direction.numpy()[2])
    assert np.abs(launch - exact.launch_angle)[found].max() < 1e-4


@pytest.mark.parametrize("name", PROFILES)
def test_no_ray_to_a_point_in_free_water_is_missed(variant, bed, rng, name):
    """At all depths about the source's, where rays turn and several arrive."""
    profile, depth = SoundSpeedProfile(*PROFILES[name]), 24.0
    bearing, distance = rng.uniform(0, 2 * np.pi, POINTS), rng.uniform(20, 200, POINTS)
    point = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), -rng.uniform(2, 40, POINTS)])
    way = connect(bed, profile, depth, point, np.zeros((POINTS, 3)))
    exact = eigenray(profile, depth, -point[:, 2], np.hypot(point[:, 0], point[:, 1]))
    found = way.exists.numpy()
    assert not (exact.exists & np.isfinite(exact.spreading_area) & ~found).any()
    assert (found & ~exact.exists).mean() < 5e-4               # a centimetre beyond the last ray
    found &= exact.exists
    assert np.abs(exact.travel_time - way.travel_time.numpy())[found].max() < 5e-9             # where it grazes a node


def test_a_target_is_not_in_its_own_shadow(variant, rng):
    """Wherever on its way a chord of the fan ends, also right in front of the target."""
    bearing, distance = rng.uniform(0, 2 * np.pi, 600), rng.uniform(20, 80, 600)
    point = np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), -rng.uniform(15, 35, 600)])
    geometry = Geometry(mi.load_dict({
        "type": "scene", "bed": {"type": "rectangle",
                                 "to_world": mi.ScalarTransform4f().translate([0, 0, -60]).scale([200, 200, 1])},
        **{f"t{i}": {"type": "point_target", "position": p.tolist()} for i, p in enumerate(point)}},
        optimize=False, parallel=False))
    way = connect(geometry, SoundSpeedProfile([0, 20, 60], [1600.0, 1500, 1700]), 25.0, point, np.zeros((600, 3)),
                  short=TARGET_RADIUS)
    assert way.exists.numpy().mean() > 0.9
    # one may be in the shadow of another
    assert (way.exists.numpy() & ~way.free.numpy()).sum() <= 1


def test_what_lies_in_the_way(variant, bed, rng):
    depth = 20.0
    point, normal = places(bed, rng)
    way = connect(bed, SoundSpeedProfile.constant(1500.0), depth, point, normal)
    origin = np.array([0.0, 0.0, -depth])
    side = -np.sign(np.sum(normal * (point - origin), axis=1, keepdims=True))
    end = point + side * normal * (LIFT + LIFT_PER_RANGE * np.hypot(*point.T[:2]))[:, None]
    start = mi.Point3f(*origin.tolist())
    towards = mi.Point3f(*(upload(mi.Float, column.astype(np.float32)) for column in end.T)) - start
    length = dr.norm(towards)
    straight = ~bed.scene.ray_test(mi.Ray3f(mi.Ray3f(start, towards / length), length)).numpy()
    free = way.free.numpy()
    assert 0.5 < free.mean() < 0.95
    assert (free != straight).mean() < 1e-3


def test_a_wall_hides_and_is_looked_round_on_request(variant):
    T = mi.ScalarTransform4f
    geometry = Geometry(mi.load_dict({
        "type": "scene",
        "bed": {"type": "rectangle", "to_world": T().translate([0, 0, -30]).scale([100, 100, 1])},
        "wall": {"type": "cube", "to_world": T().translate([20, 0, -25]).scale([0.1, 4, 5])}}, optimize=False))
    point = np.array([[30.0, 0.0, -29.0], [10.0, 0.0, -29.0], [30.0, 12.0, -29.0]])
    profile = SoundSpeedProfile(*PROFILES["summer"])
    nothing = np.zeros((3, 3))
    assert connect(geometry, profile, 10.0, point, nothing).free.numpy().tolist() == [False, True, True]
    assert connect(geometry, profile, 10.0, point, nothing, occlusion=False).free.numpy().all()
    # a target in front of the wall is not hidden by what is within the last bit of the way
    on_wall = np.array([[19.85, 0.0, -25.0]])
    assert connect(geometry, profile, 10.0, on_wall, np.zeros((1, 3)), short=0.02).free.numpy().all()


def test_ways_that_never_come_to_the_scene_are_free_whatever_the_memory_holds(variant, monkeypatch):
    """Points at the sonar's own depth over a bed 80 m below: no chord of their rays is kept.

    Chords that were never kept were read from memory as it was found.
    """
    import mitsonar.validation.scenes as scenes

    monkeypatch.setattr(dr, "empty", lambda kind, count: dr.full(kind, 1000, count))
    geometry = Geometry(scenes.array_sonar({"bed": scenes.bed(100.0, size=4000.0)}))
    x = np.linspace(5.0, 60.0, 4000)
    point = np.stack([x * np.cos(x), x * np.sin(x), np.full(4000, -20.0)], 1)
    way = connect(geometry, SoundSpeedProfile(*PROFILES["constant"]), 20.0, point, np.zeros((4000, 3)))
    assert way.free.numpy().all()


@pytest.mark.parametrize("name", ["constant", "summer", "duct"])
def test_points_of_the_water_are_connected_as_any_others(variant, bed, rng, name):
    """Rays are traced only where something may be in the way: the answers, bit by bit, are those of all rays."""
    profile, depth = SoundSpeedProfile(*PROFILES[name]), 12.0
    point = rng.uniform([-120, -120, -48], [120, 120, -1], (POINTS, 3))
    every = connect(bed, profile, depth, point, np.zeros_like(point))
    tracer = Tracer(bed, DeviceWater(profile), max_range=260.0)
    lib = arrays_of(mi.Float)
    way = Connector(bed, tracer.water).connect_in_water(
        tracer.sources([depth]), lib.Array3f64(0, 0, -depth),
        lib.Array3f64(*(upload(mi.Float64, column) for column in point.T)))
    assert 0.02 < 1 - every.free.numpy().mean() < 0.5
    for part in ("exists", "free", "travel_time", "spreading_area", "launch_direction"):
        np.testing.assert_array_equal(getattr(way, part).numpy(), getattr(every, part).numpy())
