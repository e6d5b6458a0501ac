"""Element signals and their Jacobian: arrays, platform and targets, over bed and target, still and under way.

Forward products against differences of the signals themselves, about 0.1 rad of phase, fourth order in the step. What
is left is the band-limited kernel: an echo between samples is wrong by -57 dB (1.4e-3), which moves with its delay as
fast as the signal does; and 1/(k R), 1e-4 here. So 3e-3, over a target alone half of it. Forward and backward products
are of the same sums, but for float32: 1e-6 of |w| |J v|.
"""
import numpy as np
import pytest
from summer import SUMMER_TEXT

import mitsonar
from mitsonar.validation.scenes import array_sonar, bed, point_target

STEPS = {"tx_position": 3e-4, "rx_position": 3e-4, "tx_weight": 1e-2, "tx_delay": 1.5e-7, "rx_delay": 1.5e-7,
         "rx_gain": 1e-2, "position_offset": 2e-4, "attitude_offset": 3e-3, "position": 2e-4,
         "target_strength_db": 0.05}
KEYS = [f"{'ball' if name in ('position', 'target_strength_db') else 'sensor'}.{name}" for name in STEPS]
RIGHT = 3e-3


def scene(profile="0:1500", speed=0.0):
    """Two arrays of a few elements off the platform's centre, over a bed with a target."""
    line = {"pitch": 0.06, "axis": "0.6, 0.5, 0.62", "normal": "forward"}
    arrays = {f"{side}_{name}": value for side, many in (("receive", 5), ("transmit", 2))
              for name, value in {"elements": many, **line}.items()}
    return array_sonar({"bed": bed(25.0), "ball": point_target([4.0, 18.0, -20.0], 5.0)}, water={"profile": profile},
                       sensor={"receive": "line", "transmit": "line", **arrays, "speed_knots": speed, "pings": 2},
                       integrator={"cell": 2.0}, film={"range": 30.0})


def model_of(made, keys=KEYS, **how):
    from mitsonar.gradients.elements.elements import ElementModel
    return ElementModel(made, keys, **how)


def test_signals_at_the_start_are_those_of_element_signals(variant):
    made = scene(SUMMER_TEXT, 4.0)
    signals = mitsonar.element_signals(made, [1, 0], seed=3).values
    value = model_of(made, pings=(1, 0), seed=3).value({})
    assert np.array_equal(value.astype(np.float32), signals.ravel().view(np.float32))


def test_a_model_begins_with_the_parameters_of_its_scene(variant):
    import mitsuba as mi
    made = scene()
    params = mi.traverse(made)
    params["sensor.position_offset"] = [0.02, 0, 0.01, 0, 0, 0]
    params["sensor.rx_delay"] = [0, 1e-6, 0, 0, 0]
    params.update()
    model = model_of(made, ["sensor.position_offset", "sensor.rx_delay"], pings=(1, 0))
    assert model.start["sensor.position_offset"] == pytest.approx(np.array([[0, 0, 0], [0.02, 0, 0.01]]))
    assert model.start["sensor.rx_delay"][1] == pytest.approx(1e-6)
    signals = mitsonar.element_signals(made, [1, 0]).values
    assert np.array_equal(model.value({}).astype(np.float32), signals.ravel().view(np.float32))


@pytest.mark.parametrize("profile, speed", [("0:1500", 0.0), (SUMMER_TEXT, 4.0)], ids=["still", "under way in summer"])
def test_products_with_the_jacobian_agree_with_differences_and_with_each_other(variant, rng, profile, speed):
    model = model_of(scene(profile, speed), pings=(1,), seed=1)
    jacobian = model.linearised({})
    weights = rng.standard_normal(len(jacobian.value))
    gradient = jacobian.backward(weights)
    for key in KEYS:
        step = STEPS[key.rpartition(".")[2]] * rng.uniform(-1, 1, model.start[key].shape)

        def change(size, key=key, step=step):
            there, back = (model.value({key: model.start[key] + sign * size * step}) for sign in (1, -1))
            return (there - back) / (2 * size)

        forward = jacobian.forward({key: step})
        wanted = (4 * change(1) - change(2)) / 3
        assert np.linalg.norm(forward - wanted) < RIGHT * np.linalg.norm(wanted), key
        off = weights @ forward - np.sum(gradient[key] * step)
        assert abs(off) < 1e-6 * np.linalg.norm(weights) * np.linalg.norm(forward), key


def test_gradients_of_pings_add_up(variant, rng):
    """What all pings share is read once a ping, and no ping's gradient is lost; float32 of the sums."""
    keys = ["ball.position", "ball.target_strength_db", "sensor.tx_position"]
    jacobian = model_of(scene(), keys, pings=(0, 1)).linearised({})
    weights = rng.standard_normal((2, len(jacobian.value) // 2))
    both, *alone = (jacobian.backward((weights * np.reshape(which, (2, 1))).ravel())
                    for which in ((1, 1), (1, 0), (0, 1)))
    for key in keys:
        assert all(part[key].any() for part in alone)
        assert np.linalg.norm(both[key] - alone[0][key] - alone[1][key]) < 1e-5 * np.linalg.norm(both[key]), key


def test_moving_all_of_a_scene_by_one_vector_changes_little(variant):
    """Signals know places relative to one another: the platform's move and the target's cancel, but for the bed."""
    made = array_sonar({"bed": bed(60.0), "ball": point_target([4.0, 18.0, -20.0])},
                       sensor={"receive": "line", "receive_elements": 3, "receive_pitch": 0.1}, film={"range": 30.0})
    jacobian = model_of(made, ["sensor.position_offset", "ball.position"]).linearised({})
    step = np.array([1e-3, -2e-3, 5e-4])
    alone = jacobian.forward({"ball.position": step})
    both = jacobian.forward({"ball.position": step, "sensor.position_offset": step[None]})
    assert np.linalg.norm(both) < 1e-4 * np.linalg.norm(alone)


@pytest.mark.parametrize("keys, words", [
    (["sensor.rx_positions"], "did you mean"), (["sensor.rx_weight"], "take sensor.rx_gain"),
    (["ball.position", "ball.position"], "name each once"), ([], "at least one")])
def test_parameters_that_are_not_there_are_refused(variant, keys, words):
    with pytest.raises(ValueError, match=words):
        model_of(scene(), keys)


def test_values_that_do_not_fit_are_refused(variant):
    model = model_of(scene(), ["ball.position"])
    for values, words in (({"ball.position": np.zeros(2)}, r"give it \(3,\)"), ({"ball.place": 1.0}, "ball.position"),
                          ({"ball.position": [np.nan, 0, 0]}, "not finite")):
        with pytest.raises(ValueError, match=words):
            model.value(values)
    with pytest.raises(ValueError, match="one for each"):
        model.linearised({}).backward(np.zeros(3))
    with pytest.raises(ValueError, match="ping 2 was asked for"):
        model_of(scene(), ["ball.position"], pings=(2,))
