"""Scenes that are changed by `mi.traverse`: later renders follow, and what cannot be is refused in a sentence.

A point target 60 m ahead, no bed within reach, constant 1500 m/s: an echo's time, phase and level are known. Delays are
those of band-limited signals, 1e-3 of a sample; phases 2 pi f tau within 2e-3, by float32 over 12 thousand cycles.
"""
import numpy as np
import pytest
from sonar_scenes import array_sonar, buried_bed, point_target, sidescan, synthetic_aperture

import mitsonar

mi = pytest.importorskip("mitsuba")
RANGE, FREQUENCY, SPEED = 60.0, 100e3, 1500.0
SENSOR = {"pulse": "cw", "pulse_ms": 2.0, "receive": "line", "receive_normal": "forward", "receive_elements": 4}


@pytest.fixture
def scene(variant):
    return array_sonar({"bed": buried_bed(200.0), "buoy": point_target([0.0, RANGE, -10.0])}, sensor=dict(SENSOR),
                       film={"range": RANGE + 10, "range_min": RANGE - 10})


@pytest.fixture
def parameters(scene):
    return mi.traverse(scene)


def named(parameters, end):
    return next(key for key in parameters.keys() if key.endswith(end))


def change(parameters, end, change):
    """Write what `change` makes of a parameter's numbers."""
    key = named(parameters, end)
    parameters[key] = mi.Float64(change(np.array(parameters[key])))
    parameters.update()


def peak(scene):
    """The elements' signals in the middle of the echo."""
    signals = mitsonar.element_signals(scene).values.reshape(4, -1)
    return signals[:, np.abs(signals).sum(0).argmax()]


def phase(now, before):
    return np.angle(now / before)


def wrapped(angle):
    return np.angle(np.exp(1j * angle))


def test_what_is_written_back_unchanged_gives_the_same_bytes(scene, parameters):
    before = mitsonar.element_signals(scene).values
    for key in ("tx_position", "rx_position", "rx_delay", "rx_weight", "buoy.position", "buoy.target_strength_db"):
        change(parameters, key, np.copy)
    np.testing.assert_array_equal(mitsonar.element_signals(scene).values, before)


def test_a_target_is_as_strong_as_it_is_said_to_be(scene, parameters):
    before = peak(scene)
    change(parameters, "buoy.target_strength_db", lambda level: level + 6)
    np.testing.assert_allclose(np.abs(peak(scene) / before), 10 ** (6 / 20), rtol=1e-5)


@pytest.mark.parametrize("end", ["buoy.position", "buoy.vertex_positions"])
def test_a_target_that_is_moved_away_answers_later(scene, parameters, end):
    before, key = peak(scene), named(parameters, end)
    moved = np.array(parameters[key]) + [0.0, 2.0 ** -10, 0.0]
    parameters[key] = type(parameters[key])(moved)
    parameters.update()
    turned = -2 * np.pi * FREQUENCY * 2 * 2.0 ** -10 / SPEED
    np.testing.assert_allclose(wrapped(phase(peak(scene), before) - turned), 0, atol=5e-3)
    for other in ("buoy.position", "buoy.vertex_positions"):
        np.testing.assert_allclose(np.array(parameters[named(parameters, other)]), moved, atol=1e-6)


def test_an_element_that_is_moved_forward_hears_earlier(scene, parameters):
    before = peak(scene)
    change(parameters, "rx_position", lambda place: place + np.tile([1e-3, 0, 0], 4) * np.repeat([0, 1, 0, 0], 3))
    turned = phase(peak(scene), before)
    np.testing.assert_allclose(turned, [0, 2 * np.pi * FREQUENCY * 1e-3 / SPEED, 0, 0], atol=5e-3)


@pytest.mark.parametrize("end, late", [("tx_delay", np.ones(4)), ("rx_delay", np.array([0, 0, 1.0, 0]))])
def test_an_element_with_a_delay_is_late(scene, parameters, end, late):
    before = peak(scene)
    change(parameters, end, lambda delay: delay + 1e-6 * (1 if end == "tx_delay" else late))
    np.testing.assert_allclose(phase(peak(scene), before), -2 * np.pi * FREQUENCY * 1e-6 * late, atol=5e-3)


def test_an_element_that_fails_is_silent(scene, parameters):
    change(parameters, "rx_weight", lambda weight: weight * [1, 1, 1, 0])
    np.testing.assert_array_equal(np.abs(peak(scene)) > 0, [True, True, True, False])


@pytest.mark.parametrize("end", ["tx_position", "tx_delay", "rx_position", "rx_delay", "rx_weight"])
def test_pictures_follow_elements(variant, end):
    scene = array_sonar({"bed": buried_bed(200.0), "buoy": point_target([5.0, 12.0, -10.0])},
                        sensor={**SENSOR, "transmit": "line", "transmit_elements": 4, "transmit_normal": "forward",
                                "beams": 9},
                        film={"range": 16.0, "range_min": 10.0})
    before = mitsonar.render(scene)["level"].values
    parameters = mi.traverse(scene)
    size = {"position": 1e-3, "delay": 1e-6, "weight": 0.5}[end.partition("_")[2]]
    change(parameters, end, lambda value: value + size * np.cos(np.arange(value.size) + 0.5))
    after = mitsonar.render(scene)["level"].values
    assert np.abs(after - before)[np.isfinite(before)].max() > 0.01


@pytest.mark.parametrize("end, value, said", [
    ("tx_position", [0.0, 1.0], "tx_position has 2 numbers; give 3, 3 for each of 1 elements"),
    ("rx_delay", [0, 0, 0, np.nan], "receive array: delay"),
    ("rx_weight", np.zeros(4), "receive array: no element has a weight"),
    ("buoy.position", [0.0, np.inf, 0.0], "position is [0.0, inf, 0.0]; give three finite numbers"),
    ("buoy.target_strength_db", [400.0], "target_strength_db is [400.0]; give one number from -200 to 100"),
])
def test_what_cannot_be_is_refused(parameters, end, value, said):
    from mitsonar.scene.errors import plain

    with pytest.raises((RuntimeError, ValueError)) as caught:
        change(parameters, end, lambda _: np.array(value, float))
    assert said in plain(caught.value) and "\n" not in plain(caught.value)


def test_an_aperture_hears_its_elements_where_they_are_put(variant):
    scene = synthetic_aperture({"bed": buried_bed(200.0, size=400.0), "buoy": point_target([30.0, 0.0, -10.0])},
                               sensor={"pings": 1, "receivers": 4}, film={"range": 40.0, "range_min": 20.0})
    parameters = mi.traverse(scene)
    before = peak(scene)
    for end in ("rx_position", "tx_delay"):
        old = mi.Float64(parameters[named(parameters, end)])
        change(parameters, end, lambda value: value + (2e-4 if "position" in end else 1e-7))
        assert np.abs(phase(peak(scene), before)).max() > 0.01, end
        parameters[named(parameters, end)] = old
        parameters.update()
    np.testing.assert_array_equal(peak(scene), before)


def test_a_mesh_whose_vertices_are_lifted_answers_sooner(variant):
    scene = sidescan({"bed": {"type": "seabed", "depth": 20.0, "length": 120.0, "width": 160.0, "spacing": 4.0,
                              "bsdf": {"type": "lambert"}}}, depth=10.0, pings=1, rays=20_000)
    before, parameters = mitsonar.render(scene), mi.traverse(scene)
    key = named(parameters, "vertex_positions")
    vertices = np.array(parameters[key]).reshape(-1, 3)
    parameters[key] = mi.Float((vertices + [0, 0, 5]).astype(np.float32).ravel())
    parameters.update()
    after = mitsonar.render(scene)

    def first(image):
        level = image["mean_level"].values.reshape(-1, image.sizes["range"]).max(0)
        return float(image["range"][(level > level.max() - 25).argmax()])

    assert first(before) == pytest.approx(10, abs=0.5) and first(after) == pytest.approx(5, abs=0.5)


@pytest.mark.parametrize("material, key, value", [
    ({"type": "lambert"}, "strength", -1.0), ({"type": "lambert"}, "strength", 0.4),
    ({"type": "sediment", "sediment": "medium sand"}, "density_ratio", np.nan)])
def test_materials_that_cannot_be_are_refused(variant, material, key, value):
    from mitsonar.scene.errors import plain
    from mitsonar.scene.loading import prepare

    prepare()
    parameters = mi.traverse(mi.load_dict(material))
    parameters[key] = mi.Float(value)
    with pytest.raises((RuntimeError, ValueError)) as caught:
        parameters.update()
    assert f"{key} is [" in plain(caught.value)
