"""Refracted rays against a scene: the hit lies on the scene, and everything said of it is that of the exact eigenray.

Truth is `propagation.eigenrays`, an independent NumPy solver checked against 60-digit arithmetic. The bed is a rough
height field 45 m deep, sonar 10.3 and 20 m deep, launch angles from 3 degrees above horizontal to straight down,
ranges to 260 m. Tolerance on time: 1 ns, the requirement; found are 2e-10 s (steepest profiles) and 1e-14 s (median).
"""
import json
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from summer import SUMMER_TABLE

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.propagation.numpy_rays.eigenrays import eigenrays
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

REFERENCE = Path(__file__).resolve().parents[2] / "../shared/reference/eigenrays.json"
PROFILES = {
    "constant": ([0.0], [1500.0]),
    "warming down": ([0.0, 60.0], [1470.0, 1500.0]),
    "summer": SUMMER_TABLE,
    "duct": ([0.0, 25.0, 60.0], [1500.0, 1475.0, 1510.0]),
    "one thick layer": ([0.0, 200.0], [1500.0, 1520.0]),          # source and hit in the same layer, weak gradient
    "coarse": ([0.0, 30.0, 120.0], [1495.0, 1490.0, 1497.0]),
    "zigzag": (np.arange(0.0, 61.0, 1.0), 1490 + 2.5 * (-1.0) ** np.arange(61)),
}
RAYS = 4000


def test_room_for_a_fan_is_found_once(bed, monkeypatch):
    """Rays in a zigzag need much room: the first fans find out how much by doubling it, the next ones begin there."""
    from mitsonar.propagation.device_rays import ray_fans as fans

    rooms, traced = [], fans._trace_rows

    def told(*arguments):
        rooms.append(int(arguments[-1][0]))
        return traced(*arguments)

    monkeypatch.setattr(fans, "_trace_rows", told)
    tracer = Tracer(bed, DeviceWater(SoundSpeedProfile(*map(np.asarray, PROFILES["zigzag"]))), max_range=260.0)
    tracer.sources([10.3])
    assert len(rooms) > 1 and rooms == [fans.FEWEST_VERTICES << k for k in range(len(rooms))]
    largest = rooms[-1]
    later = tracer.sources([10.4]).ray_fans
    assert rooms[-1] == largest and rooms.count(largest) == 2 and len(rooms) == int(np.log2(largest / 16)) + 2
    # more room than it needs makes no other fan
    alone = Tracer(bed, tracer.water, max_range=260.0).sources([10.4]).ray_fans
    size = alone.size.numpy()
    assert np.array_equal(size, later.size.numpy())
    rows = [fan.vertex.numpy().reshape(len(size), -1, 4) for fan in (alone, later)]
    assert all(np.array_equal(one[:n], other[:n]) for one, other, n in zip(*rows, size, strict=True))


@pytest.fixture(scope="module")
def bed():
    """A rough bed, and a sphere above it so that both kinds of shape are hit."""
    from mitsonar.scene.loading import prepare

    prepare()
    relief = {"fractal_rms": 0.6, "fractal_gamma": 3.3, "fractal_outer_scale": 60.0}
    return Geometry(mi.load_dict({
        "type": "scene", "bed": {"type": "seabed", "depth": 45.0, "length": 400.0, "width": 400.0, "spacing": 1.0,
        **relief}, "ball": {"type": "sphere", "center": [30.0, 0.0, -38.0], "radius": 9.0}}, optimize=False))


def fan(rng, count=RAYS):
    """Directions: half of them all over, half near horizontal."""
    azimuth = rng.uniform(0, 2 * np.pi, count)
    angle = np.radians(np.concatenate([rng.uniform(5, 90, count // 2), rng.uniform(-3, 12, count - count // 2)]))
    d = np.stack([np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), -np.sin(angle)])
    return mi.Vector3f(*(upload(mi.Float, row.astype(np.float32)) for row in d)), angle


def trace(geometry, profile, depth, direction, **options):
    tracer = Tracer(geometry, DeviceWater(profile), max_range=280.0, **options)
    lib = arrays_of(mi.Float)
    origin = lib.Array3f64(0, 0, -depth)
    return tracer.trace(tracer.sources([depth]), origin, mi.UInt32(0), direction)


def profiles():
    """Built-in profiles, and those of the reference where it is at hand."""
    known = {name: SoundSpeedProfile(*table) for name, table in PROFILES.items()}
    if REFERENCE.is_file():
        for name, table in json.loads(REFERENCE.read_text())["profiles"].items():
            known[name] = SoundSpeedProfile(table["depth"], table["c"])
    return known


@pytest.mark.parametrize("depth", [10.3, 20.0])
@pytest.mark.parametrize("name", list(profiles()))
def test_hits_carry_the_time_and_spreading_of_the_exact_eigenray(variant, bed, rng, name, depth):
    profile = profiles()[name]
    direction, launch = fan(rng)
    hits = trace(bed, profile, depth, direction)
    valid = hits.valid.numpy()
    assert valid.mean() > 0.3
    x, y, z = hits.point.numpy()[:, valid]
    exact = eigenrays(profile, depth, -z, np.hypot(x, y))
    time = hits.travel_time.numpy()[valid]
    # of several arrivals, the one launched like the traced ray
    nearest = np.nanargmin(np.where(exact.exists, np.abs(exact.launch_angle - launch[valid, None]), np.inf), axis=1)
    pick = (np.arange(len(time)), nearest)
    assert np.abs(exact.travel_time[pick] - time).max() < 1e-9
    assert np.median(np.abs(exact.travel_time[pick] - time)) < 1e-12
    assert np.abs(exact.arc_length[pick] - hits.arc_length.numpy()[valid]).max() < 5e-3
    spreading = hits.spreading_area.numpy()[valid] / exact.spreading_area[pick] - 1
    assert np.quantile(np.abs(spreading), 0.99) < 0.015               # 0.06 dB, in 5 1/s; beside caustics, by the mm
    down = -hits.arrival_direction.numpy()[2, valid]
    assert np.quantile(np.abs(np.arcsin(down) - exact.arrival_angle[pick]), 0.999) < 2e-4


@pytest.mark.parametrize("name", list(profiles()))
def test_hits_lie_on_the_rays_as_they_were_launched(variant, bed, rng, name):
    """The eigenray to a hit leaves as the ray did: rays that pass each other by the chords' 2 mm would be 1e-4 off.

    What is left is float32, of directions (6e-8) and of the range that the series sums (1e-5 m), and the series' next
    term. Rays within half a degree of a facet stay on their chords.
    """
    direction, launch = fan(rng)
    hits = trace(bed, profiles()[name], 20.0, direction)
    slant = np.abs((hits.normal.numpy() * hits.arrival_direction.numpy()).sum(0))
    steep = hits.valid.numpy() & (slant > 0.02)
    off = np.arcsin(-hits.launch_direction.numpy()[2]) - launch
    miss = np.abs(off * hits.arc_length.numpy())[steep]
    assert np.median(miss) < 1e-5 and np.quantile(miss, 0.99) < 5e-4


def test_hits_lie_on_the_scene_and_say_which_shape(variant, bed, rng):
    direction, _ = fan(rng)
    hits = trace(bed, SoundSpeedProfile(*PROFILES["summer"]), 20.0, direction)
    label, point = hits.label.numpy(), hits.point.numpy()
    number = {name: number for number, name in bed.labels.items()}
    on_ball = label == number["ball"]
    assert on_ball.sum() > 20
    distance = np.linalg.norm(point[:, on_ball] - np.array([[30.0], [0.0], [-38.0]]), axis=0)
    assert np.abs(distance - 9.0).max() < 1e-4                        # float32 hits of an analytic shape
    normal = hits.normal.numpy()
    facing = (normal * hits.arrival_direction.numpy()).sum(0)[hits.valid.numpy()]
    assert (facing <= 1e-6).all()
    np.testing.assert_allclose(np.linalg.norm(normal[:, label > 0], axis=0), 1, atol=1e-5)


def test_misses_are_zero_not_nan(variant, bed):
    """What a miss leaves behind indexes tables further on; it must be a number."""
    up = mi.Vector3f(dr.zeros(mi.Float, 64), 0, 1)
    hits = trace(bed, SoundSpeedProfile(*PROFILES["summer"]), 20.0, up)
    assert not hits.valid.numpy().any()
    assert np.isfinite(hits.point.numpy()).all()
    assert (hits.label.numpy() == 0).all()


def test_straight_water_gives_mitsubas_own_hits(variant, bed, rng):
    direction, _ = fan(rng)
    hits = trace(bed, SoundSpeedProfile([0.0], [1500.0]), 20.0, direction)
    si = bed.scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, -20), direction))
    both = hits.valid.numpy() & si.is_valid().numpy() & (si.t.numpy() < 270)
    assert both.mean() > 0.5
    assert np.mean(hits.valid.numpy()[si.t.numpy() < 270] == si.is_valid().numpy()[si.t.numpy() < 270]) > 0.999
    gap = np.linalg.norm(hits.point.numpy()[:, both] - si.p.numpy()[:, both], axis=0)
    assert np.quantile(gap, 0.99) < 2e-3                              # float32 at 270 m and 1 degree of grazing


def test_tolerance_bounds_how_far_hits_move(variant, bed, rng):
    """Chords within 2 or 20 mm of the ray find points that differ by about as much along a flat grazing bed."""
    direction, _ = fan(rng, 1000)
    profile = SoundSpeedProfile(*PROFILES["summer"])
    fine, coarse = (trace(bed, profile, 20.0, direction, tolerance=t) for t in (0.002, 0.02))
    both = fine.valid.numpy() & coarse.valid.numpy()
    gap = np.linalg.norm(fine.point.numpy()[:, both] - coarse.point.numpy()[:, both], axis=0)
    assert np.median(gap) < 0.02


@pytest.mark.parametrize("depth", [30.0, 44.5])
@pytest.mark.parametrize("name", ["constant", "summer", "one thick layer", "duct"])
def test_hits_at_the_depth_of_the_source(variant, rng, name, depth):
    """A wall around the sonar, rays within half a degree of level: depths agree to millimetres, where moments of the
    water between them are rounding noise."""
    wall = {"type": "cylinder", "p0": [0.0, 0.0, -60.0], "p1": [0.0, 0.0, -1.0], "radius": 50.0}
    from mitsonar.scene.loading import prepare

    prepare()
    geometry = Geometry(mi.load_dict({"type": "scene", "wall": wall}, optimize=False))
    angle, azimuth = np.radians(rng.uniform(-0.5, 0.5, RAYS)), rng.uniform(0, 2 * np.pi, RAYS)
    d = np.stack([np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), -np.sin(angle)])
    profile = SoundSpeedProfile(*PROFILES[name])
    hits = trace(geometry, profile, depth, mi.Vector3f(*(upload(mi.Float, row.astype(np.float32)) for row in d)))
    valid = hits.valid.numpy()
    assert valid.mean() > 0.99
    x, y, z = hits.point.numpy()[:, valid]
    exact = eigenrays(profile, depth, -z, np.hypot(x, y))
    off = np.nanmin(np.abs(exact.travel_time - hits.travel_time.numpy()[valid, None]), axis=1)
    assert off.max() < 1e-9
    level = -10 * np.log10(hits.spreading_area.numpy()[valid] / np.hypot(np.hypot(x, y), z + depth) ** 2)
    assert np.quantile(np.abs(level), 0.99) < 0.5


def test_texture_coordinates_are_those_of_the_shape(variant):
    """Mitsuba's own at the same points, for a mesh with coordinates and for a rectangle, where a material reads
    textures."""
    from mitsonar.scene.loading import prepare

    prepare()
    T = mi.ScalarTransform4f
    for shape in ({"type": "seabed", "depth": 30.0, "length": 80.0, "width": 80.0, "spacing": 2.0},
                  {"type": "rectangle", "to_world": T().translate([0, 0, -30]).scale(40.0)}):
        scene = mi.load_dict({"type": "scene", "bed": {**shape, "bsdf": {"type": "diffuse"}}}, optimize=False)
        angle = np.radians(np.linspace(50, 88, 500))
        d = mi.Vector3f(*(upload(mi.Float, v.astype(np.float32)) for v in (0.6 * np.cos(angle), 0.8 * np.cos(angle),
                                                                             -np.sin(angle))))
        hits = trace(Geometry(scene), SoundSpeedProfile([0.0], [1500.0]), 10.0, d)
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(0, 0, -10), d))
        np.testing.assert_allclose(hits.uv.numpy(), si.uv.numpy(), atol=2e-5)


def test_shapes_at_the_surface_are_hit(variant):
    """Rays stop above the water, not at it: a plate at z = 0 reflects every ray that looks up at it."""
    from mitsonar.scene.loading import prepare

    prepare()
    plate = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(200.0)}
    angle = np.radians(np.linspace(-20, -88, 2000))
    d = mi.Vector3f(*(upload(mi.Float, v.astype(np.float32)) for v in (np.cos(angle), 0 * angle, -np.sin(angle))))
    geometry = Geometry(mi.load_dict({"type": "scene", "plate": plate}))
    hits = trace(geometry, SoundSpeedProfile(*PROFILES["summer"]), 20.0, d)
    assert hits.valid.numpy().mean() > 0.999
