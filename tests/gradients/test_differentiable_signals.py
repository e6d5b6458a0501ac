"""Element signals as Dr.Jit sees them: attached to elements, targets and the track, and of use to somebody's own loop.

Products are those of `ElementModel`, whose own tests hold them to differences: float32 of the signals leaves 1e-6 here.
"""
import mitsonar  # noqa: F401  isort: skip
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.validation.scenes import array_sonar, bed, point_target

KEYS = "sensor.rx_delay", "ball.position", "sensor.position_offset"


@pytest.fixture
def made(variant):
    """A line of six over a bed with a target, two pings."""
    return array_sonar({"bed": bed(25.0), "ball": point_target([4.0, 18.0, -20.0], 15.0)}, water={"profile": "0:1500"},
                       sensor={"receive": "line", "receive_elements": 6, "receive_pitch": 0.06, "pings": 2},
                       integrator={"cell": 3.0}, film={"range": 30.0})


def attached(scene, *keys):
    params = mi.traverse(scene)
    for key in keys:
        dr.enable_grad(params[key])
    params.update()
    return params


def test_gradients_are_those_of_the_closed_forms(made, rng):
    from mitsonar.gradients.elements.elements import ElementModel
    params = attached(made, *KEYS)
    signals = mitsonar.differentiable_signals(made, params, [1], seed=2)
    with dr.suspend_grad():
        value = mitsonar.element_signals(made, [1], seed=2).values
    assert np.array_equal(np.array(signals)[..., 0], value[:, 0].real)
    weights = rng.standard_normal(signals.shape)
    dr.backward(dr.sum(signals * mi.TensorXf(weights)))
    wanted = ElementModel(made, KEYS, pings=[1], seed=2).linearised({}).backward(weights.ravel())
    for key in KEYS:
        found = np.array(dr.grad(params[key])).reshape(-1, *wanted[key].shape[1:])
        assert np.linalg.norm(found[1 if key.endswith("offset") else ...] - wanted[key]) < 1e-5 * np.linalg.norm(
            wanted[key]), key
    assert np.all(np.array(dr.grad(params["sensor.position_offset"]))[:3] == 0)     # the other ping's


def test_signals_move_as_their_parameters_do(made, rng):
    from mitsonar.gradients.elements.elements import ElementModel
    params = attached(made, "sensor.rx_delay")
    signals, direction = mitsonar.differentiable_signals(made, params), rng.standard_normal(6)
    dr.set_grad(params["sensor.rx_delay"], mi.Float64(direction))
    moved = np.array(dr.forward_to(signals))
    wanted = ElementModel(made, ["sensor.rx_delay"]).linearised({}).forward({"sensor.rx_delay": direction})
    assert np.linalg.norm(moved.ravel() - wanted) < 1e-6 * np.linalg.norm(wanted)


def test_a_loop_of_ones_own_finds_late_channels(made):
    """By Adam, from signals of channels that are up to 2 µs late, a fifth of a period: to a twentieth of that."""
    late = 1e-6 * np.array([0.0, 2.0, -1.0, 1.5, -2.0, 0.5])
    params = mi.traverse(made)
    params["sensor.rx_delay"] = mi.Float64(late)
    params.update()
    heard = mi.TensorXf(np.ascontiguousarray(mitsonar.element_signals(made).values[:, 0]).view(np.float32).reshape(
        1, 6, -1, 2))
    scale = float(np.mean(np.square(np.array(heard))))
    steps = mi.ad.Adam(lr=0.3, beta_1=0.6)
    steps["late_us"] = mi.Float64(np.zeros(6))
    for _ in range(25):
        params["sensor.rx_delay"] = 1e-6 * steps["late_us"]
        params.update()
        signals = mitsonar.differentiable_signals(made, params)
        dr.backward(dr.mean(dr.square(signals - heard)) / scale)
        steps.step()
    assert np.abs(1e6 * late - np.array(steps["late_us"])).max() < 0.1


def test_nothing_is_zero_in_silence(made):
    with pytest.raises(ValueError, match="no parameter carries a gradient"):
        mitsonar.differentiable_signals(made, mi.traverse(made))
    params = attached(made, "sensor.rx_delay")
    with pytest.raises(ValueError, match="sensor.rx_delay has no gradient in a picture whose beams are formed with it"):
        made.integrator().render(made)
    with pytest.raises(ValueError, match="elements stand still in mean levels"):
        mitsonar.gradient(made, ["sensor.rx_delay"], np.ones_like)
    params = attached(made, "sensor.medium.sound_speed")
    with pytest.raises(ValueError, match="is no parameter of element signals"):
        mitsonar.differentiable_signals(made, params)
