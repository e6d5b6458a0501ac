"""The vector approximation on the device: differences between elements and centre, against exact eigenrays.

Geometry: a sonar 8.3 m deep that moves, heaves and turns, hits 30 to 58 m deep and 5 to 200 m away. Exact: eigenrays to
where centre and elements are when their echoes arrive, found by iteration, the array turned by exp(t [ω]x).

Bias: float32 rounds a delay of d/c = 0.3 ms to 0.015 ns rms, 0.08 ns at most; the expansion errs by less than 1.3 times
its own estimate below 1 ns. Tolerances: 0.1 ns for float32 against float64 of the same function, 1 ns against exact
rays where the estimate is below 0.5 ns.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Array3f64, Float, Float64, UInt32
from scipy.spatial.transform import Rotation

from mitsonar.device.arrays import upload
from mitsonar.propagation import eigenray, return_time
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.device_rays.two_point import source_state
from mitsonar.propagation.numpy_rays.slices import Slices
from mitsonar.propagation.returns.return_paths import return_paths
from mitsonar.propagation.returns.travel import REST, steady
from mitsonar.propagation.returns.vector_approximation import (
    DIFFERENCES,
    ELEMENT_FIELDS,
    corrections,
    difference_of,
    expected_error,
    level_difference,
    vector_difference,
    vector_element_fields,
)
from mitsonar.propagation.returns.vector_legs import matched_leg
from mitsonar.water import SoundSpeedProfile

DEPTH, HITS = 8.3, 300
FINE = np.arange(0.0, 61.0)
WATERS = {
    "uniform": SoundSpeedProfile.constant(1500),
    "six nodes": SoundSpeedProfile([0, 5, 12, 25, 40, 60], [1508, 1507.5, 1499, 1491, 1489.5, 1490.5]),
    "gradient 1 1/s": SoundSpeedProfile([0, 60], [1500, 1560]),
    "thermocline": SoundSpeedProfile(FINE, 1490 + 9 * (1 - np.tanh((FINE - 15) / 4))),
}
MOTIONS = {
    "still": ((0, 0, 0), (0, 0, 0)),
    "under way": ((2, 1, 0), (0, 0, 0)),
    "heaving": ((2, 1, 0.3), (0, 0, 0)),
    "turning": ((5, -1, 0.1), (0.05, 0.02, 0.05)),
}


class Case:
    """Hits, elements, and the exact times to both ends, in one water and one motion."""

    def __init__(self, water, motion, length=0.5, flat=False):
        rng = np.random.default_rng(3)
        azimuth, across = rng.uniform(0, 2 * np.pi, HITS), rng.uniform(5, 200, HITS)
        self.water = WATERS[water]
        self.velocity, self.rate = (np.array(part, float) for part in MOTIONS[motion])
        depth = rng.uniform(30, 58, HITS)
        self.way = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), DEPTH - depth], -1)
        elements = rng.normal(size=(4, 3)) * ((1, 1, 0) if flat else 1)
        self.elements = length * elements / np.linalg.norm(elements, axis=1, keepdims=True)
        self.ray = eigenray(self.water, DEPTH, depth, across)
        self.centre = self._exact(np.zeros(3))
        self.late = np.stack([self._exact(d) - self.centre for d in self.elements], -1)

    def _exact(self, element):
        time = self.ray.travel_time
        for _ in range(7):
            passed = self.ray.travel_time + time
            place = passed[:, None] * self.velocity + Rotation.from_rotvec(passed[:, None] * self.rate).apply(element)
            x, y, _ = (self.way - place).T
            time = eigenray(self.water, DEPTH - place[:, 2], DEPTH - self.way[:, 2], np.hypot(x, y)).travel_time
        return time

    def on_device(self, method="vector"):
        table = layer_table(self.water, Float)
        return return_paths(
            table, source_state(table, np.array([DEPTH])), UInt32(0),
            Array3f64(*(upload(Float64, part) for part in self.way.T)), upload(Float64, self.ray.travel_time),
            upload(Float64, self.ray.ray_parameter), upload(Float, np.float32(self.ray.spreading_area)),
            upload(Float, np.float32(np.sin(self.ray.launch_angle))), method=method,
            travel=steady([dr.opaque(Float64, v) for v in self.velocity],
                          [dr.opaque(Float64, w) for w in self.rate]))

    def fields(self, method="vector"):
        return ELEMENT_FIELDS[method](self.elements, DEPTH, self.water)


def differences(paths, fields, method="vector"):
    """Delays (H, E) by the device in float32, and by NumPy in float64 from the same fields of the hits."""
    difference = DIFFERENCES[method]
    count = len(fields[0])
    single = [difference(paths.hit_fields, [dr.opaque(Float, field[k]) for field in fields]) for k in range(count)]
    hits = [np.asarray(field.numpy(), float)[:, None] for field in paths.hit_fields]
    return np.stack([late.numpy() for late in single], -1), difference(hits, [field[None] for field in fields])


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("water", WATERS)
def test_centre_and_elements_hear_the_echo_when_it_arrives(water, motion):
    case = Case(water, motion)
    paths, fields = case.on_device(), case.fields()
    sure = paths.expected_error(fields).numpy() < 0.5e-9
    assert sure.mean() > 0.9
    assert np.abs(paths.return_time.numpy() - case.centre)[sure].max() < 0.02e-9
    single, double = differences(paths, fields)
    assert np.abs(single - case.late)[sure].max() < 1e-9
    assert np.abs(single - double)[sure].max() < 0.1e-9
    assert np.sqrt(np.mean((single - double)[sure] ** 2)) < 0.03e-9


def test_steep_rays_are_known_to_the_rounding(motion="still"):
    case = Case("six nodes", motion)
    single, double = differences(case.on_device(), case.fields())
    steep = case.ray.launch_angle > np.deg2rad(20)
    assert np.abs(double - case.late)[steep].max() < 0.1e-9
    assert np.abs(single - case.late)[steep].max() < 0.15e-9


@pytest.mark.parametrize("motion", MOTIONS)
def test_uniform_water_leaves_rounding_alone(motion):
    case = Case("uniform", motion)
    paths = case.on_device()
    for method in DIFFERENCES:
        single, _ = differences(case.on_device(method), case.fields(method), method)
        # 0.07 ns more while turning: v·d, of second order, is that of the array as it was at the ping
        assert np.abs(single - case.late).max() < (0.15e-9 if motion == "turning" else 0.1e-9)
    assert np.abs(paths.return_time.numpy() - case.centre).max() < 1e-15


@pytest.mark.parametrize("velocity", ["still", "under way", "heaving"])
def test_device_paper_is_equation_two(velocity):
    case = Case("gradient 1 1/s", velocity)
    paths, fields = case.on_device("paper"), case.fields("paper")
    origin = np.array([0, 0, -DEPTH])
    times = return_time(case.water, origin, origin + case.way, [[0, 0, 0], *case.elements], case.velocity, "paper")
    np.testing.assert_allclose(paths.return_time.numpy(), times[:, 0], atol=1e-13)
    # within one layer the element's gradient is that at the centre, so only float32 rounds
    assert np.abs(differences(paths, fields, "paper")[0] - (times[:, 1:] - times[:, :1])).max() < 0.1e-9


def test_reciprocity_gives_transmit_elements():
    """The time from an element to a hit is the time back: a still array's differences serve both."""
    case = Case("thermocline", "still")
    depth = DEPTH - case.elements[:, 2]
    across = np.linalg.norm(case.way[:, None, :2] - case.elements[:, :2], axis=-1)
    out = eigenray(case.water, depth, (DEPTH - case.way[:, 2])[:, None], across).travel_time
    paths = case.on_device()
    sure = paths.expected_error(case.fields()).numpy() < 0.5e-9
    single, _ = differences(paths, case.fields())
    assert np.abs(single - (out - case.ray.travel_time[:, None]))[sure].max() < 1e-9
    np.testing.assert_array_equal(paths.return_time.numpy(), case.ray.travel_time)


def test_direction_at_the_centre_is_that_of_the_ray():
    case = Case("six nodes", "heaving")
    x, y, z = (part.numpy() for part in case.on_device().direction)
    passed = case.ray.travel_time + case.centre
    place = passed[:, None] * case.velocity
    arrival = eigenray(case.water, DEPTH - case.way[:, 2], DEPTH - place[:, 2],
                       np.hypot(*(case.way - place)[:, :2].T)).arrival_angle
    np.testing.assert_allclose(z, np.sin(-arrival), atol=2e-6)
    np.testing.assert_allclose(np.hypot(np.hypot(x, y), z), 1, atol=1e-6)
    np.testing.assert_allclose(np.arctan2(y, x), np.arctan2(*(place - case.way).T[1::-1]), atol=1e-5)


@pytest.mark.parametrize("water", ["six nodes", "thermocline", "gradient 1 1/s"])
def test_estimate_bounds_the_error(water):
    case = Case(water, "still", length=2.0)
    paths, fields = case.on_device(), case.fields()
    hits = [np.asarray(field.numpy(), float)[:, None] for field in paths.hit_fields]
    elements = [field[None] for field in fields]
    error = np.abs(vector_difference(hits, elements) - case.late)
    estimate = np.where(paths.rough.numpy()[:, None], np.inf, expected_error(hits, elements))
    judged = estimate < 1e-8
    assert judged.mean() > 0.5
    assert (error[judged] < 3 * estimate[judged] + 0.15e-9).all()


def test_turned_rays_are_marked():
    water = WATERS["gradient 1 1/s"]
    table = layer_table(water, Float)
    ray = eigenray(water, 20, 20.5, 150)
    assert np.isfinite(ray.turning_depth)
    paths = return_paths(table, source_state(table, np.array([20.0])), UInt32(0), Array3f64(150, 0, -0.5),
                         Float64(ray.travel_time), Float64(ray.ray_parameter), Float(ray.spreading_area),
                         Float(np.sin(ray.launch_angle)), travel=REST)
    fields = vector_element_fields([[0.1, 0, 0]], 20.0, water)
    assert paths.rough.numpy().all() and np.isinf(paths.expected_error(fields).numpy()).all()
    late = vector_difference(paths.hit_fields, [Float(field[0]) for field in fields]).numpy()
    exact = eigenray(water, 20, 20.5, 149.9).travel_time - ray.travel_time
    assert late == pytest.approx(exact, abs=1e-9)      # first order is right


def test_corrections_are_the_equations(rng):
    """The terms one by one, as they are derived, against the form with their factors shared."""
    count = 2000
    w0, gamma, per_length = rng.uniform(0.1, 1, count), rng.uniform(-1, 1, count), rng.uniform(0.005, 0.2, count)
    lengthening, h = rng.uniform(-0.5, 0.5, (2, count))
    excess, variance = rng.uniform(-0.005, 0.03, count), rng.uniform(0, 1e-6, count)
    p0, k = np.sqrt(1 - w0**2), per_length / (1 + per_length * lengthening)
    w = np.clip((w0 + per_length * h) / (1 + per_length * lengthening), 0.06, 1 - 1e-9)
    p, q = np.sqrt(1 - w**2), np.sqrt(w**2 + excess)
    missed = h * p * (excess / (w * q * (w + q)) - 3 * variance / (8 * q**5))
    bent = missed / (1 / (k * w**2) + h * ((1 + excess) / q**3 - 1 / w**3))
    change = p + bent - p0
    expected = (h * excess / (w + q) - h * variance / (8 * q) / q**2 + missed * bent / 2 * (1 - bent * p / w**2)
                - gamma * change**3)
    within = w == (w0 + per_length * h) / (1 + per_length * lengthening)
    value, _, found = corrections(w0, p0, gamma, per_length, 1 / (1 + per_length * lengthening), h, excess, variance)
    assert within.mean() > 0.5
    np.testing.assert_allclose(value[within], expected[within], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[within], change[within], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("motion", [MOTIONS["still"], MOTIONS["under way"], ((5, -1, 0), (0, 0, 0.05))])
@pytest.mark.parametrize("water", WATERS)
def test_level_arrays_have_no_slice(water, motion, monkeypatch):
    monkeypatch.setitem(MOTIONS, "level", motion)
    case = Case(water, "level", flat=True)
    paths, fields = case.on_device(), case.fields()
    assert difference_of("vector", case.elements, case.water) is level_difference
    hits = [np.asarray(field.numpy(), float)[:, None] for field in paths.hit_fields]
    elements = [field[None] for field in fields]
    level = level_difference(hits, elements)
    sure = paths.expected_error(fields).numpy() < 0.5e-9
    np.testing.assert_allclose(level[sure], vector_difference(hits, elements)[sure], rtol=0, atol=1e-15)
    single = [level_difference(paths.hit_fields, [dr.opaque(Float, field[k]) for field in fields]).numpy()
              for k in range(len(fields[0]))]
    assert np.abs(np.stack(single, -1) - level)[sure].max() < 0.1e-9


def test_difference_is_the_cheapest_that_is_right():
    curved, one, flat, tall = WATERS["six nodes"], WATERS["uniform"], [[0.3, 0.1, 0]], [[0.3, 0.1, 0.01]]
    assert difference_of("paper", flat, curved) is DIFFERENCES["paper"]
    assert difference_of("vector", flat, curved) is level_difference
    assert difference_of("vector", tall, one, tilt=0.1, climb=0.3) is level_difference
    for elements, moves in ((tall, {}), (flat, {"climb": 0.1}), (flat, {"tilt": 0.01})):
        assert difference_of("vector", elements, curved, **moves) is vector_difference
    case = Case("uniform", "heaving")
    hits = [np.asarray(field.numpy(), float)[:, None] for field in case.on_device().hit_fields]
    elements = [field[None] for field in case.fields()]
    np.testing.assert_allclose(level_difference(hits, elements), vector_difference(hits, elements), atol=1e-12)


def test_matched_leg_in_uniform_water_is_the_leg():
    height, across, speed = 40.0, 30.0, 1500.0
    p = across / np.hypot(height, across) / speed
    u = np.sqrt(1 / speed**2 - p**2)
    leg = matched_leg(*(np.array([height / u**k]) for k in (1, 3, 5)), np.array([p]), speed)
    assert leg.length[0] == pytest.approx(50, rel=1e-14) and leg.speed[0] == pytest.approx(1500, rel=1e-14)
    assert leg.vertical[0] == pytest.approx(0.8, rel=1e-14) and leg.horizontal[0] == pytest.approx(0.6, rel=1e-14)
    assert abs(leg.third[0]) < 1e-12


def test_slices_are_the_integrals(rng):
    depth = np.sort(rng.uniform(0, 50, 12))
    water = SoundSpeedProfile(depth, 1480 + rng.uniform(0, 40, 12))
    slices, upper = Slices(water), rng.uniform(-5, 50, 20)
    for other in (upper + rng.uniform(0.1, 8, 20), upper - rng.uniform(0.1, 8, 20)):
        mean, variance = slices.between(upper, other)
        z = upper + (other - upper) * (np.arange(200_000)[:, None] + 0.5) / 200_000
        squared = water.at(z) ** -2.0
        np.testing.assert_allclose(mean, squared.mean(0), rtol=1e-10)
        np.testing.assert_allclose(variance, squared.var(0), rtol=1e-6, atol=1e-20)
    mean, variance = slices.between(upper, upper)
    np.testing.assert_allclose(mean, water.at(upper) ** -2.0, rtol=1e-15)
    assert not variance.any()


def test_platform_values_compile_nothing_anew():
    case, fields = Case("six nodes", "still"), None
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        hashes = set()
        for motion in ("under way", "heaving", "turning"):
            case.velocity, case.rate = (np.array(part, float) for part in MOTIONS[motion])
            paths, fields = case.on_device(), case.fields()
            dr.eval(paths.hit_fields)
            dr.kernel_history_clear()
            dr.eval(vector_difference(paths.hit_fields, [dr.opaque(Float, field[0]) for field in fields]))
            hashes.add(tuple(entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])))
    assert len(hashes) == 1
