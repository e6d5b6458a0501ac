"""Coherent pictures: the image of `mitsonar.render`, products against each other, closed form, and a fit by its users.

What is left of the Jacobian's error is that of the elements' signals, see `test_element_signals`: 3e-3.
"""
import drjit as dr
import numpy as np
import pytest
from sonar_scenes import array_sonar, bed, forward_looking, multibeam, point_target

import mitsonar
from mitsonar.inversion import Gaussian, Prior, fit

ACROSS = {f"{side}_{name}": value for side in ("receive", "transmit")
          for name, value in {"pitch": 0.0075, "normal": "forward", "axis": "starboard"}.items()}
RIGHT = 3e-3
STEPS = {"sensor.tx_delay": 1e-7, "sensor.rx_delay": 1e-7, "ball.position": 1e-4, "ball.target_strength_db": 0.05}

FLAWS = {"receive_flaws": 0.2, "receive_element_height": 0.03, "receive_vertical_sidelobe_db": -20.0}


def scene(receivers=6, senders=3, **how):
    """Two lines across the bow look at a target before the bed."""
    sensor = {"receive": "line", "receive_elements": receivers, "transmit": "line", "transmit_elements": senders,
              "beams": 5, "pings": 2, "picture": "elements", **ACROSS, **how}
    return array_sonar({"bed": bed(13.0), "ball": point_target([1.0, 8.0, -10.4], 5.0)}, sensor=sensor,
                       integrator={"cell": 1.5}, film={"range": 10.0})


def attached(made, key, tangent=None):
    import mitsuba as mi
    parameters = mi.traverse(made)
    leaf = type(parameters[key])(dr.detach(parameters[key]))
    dr.enable_grad(leaf)
    if tangent is not None:
        dr.set_grad(leaf, type(leaf)(tangent))
    parameters[key] = leaf
    parameters.update()
    return parameters, leaf


@pytest.mark.parametrize("flaws", [{}, FLAWS])
def test_a_model_gives_the_picture_that_is_rendered(variant, flaws):
    made = scene(**flaws)
    model = mitsonar.coherent_model(made, ["ball.position"], seed=3)
    level = mitsonar.render(made, seed=3)["level"].values
    found = 10 * np.log10(np.maximum(model.value({}).reshape(model.shape), 1e-30))
    there = level > level.max() - 60
    assert np.abs(found - level)[there].max() < 1e-4


@pytest.mark.parametrize(("of", "flaws"), [("intensity", {}), ("amplitude", {}), ("amplitude", FLAWS)])
def test_products_agree_with_differences_and_with_each_other(variant, rng, of, flaws):
    model = mitsonar.coherent_model(scene(**flaws), list(STEPS), of=of, pings=(1,), seed=1)
    jacobian = model.linearised({})
    weights = rng.standard_normal(jacobian.value.shape)
    gradient = jacobian.backward(weights)
    for key, size in STEPS.items():
        step = size * rng.uniform(-1, 1, model.start[key].shape)

        def change(far, key=key, step=step):
            there, back = (model.value({key: model.start[key] + sign * far * step}) for sign in (1, -1))
            return (there - back) / (2 * far)

        forward = jacobian.forward({key: step})
        wanted = (4 * change(1) - change(2)) / 3
        # a target's place turns phases, which an intensity knows little of: what is left out weighs more there
        right = 2e-2 if key == "ball.position" and of == "intensity" else RIGHT
        assert np.linalg.norm(forward - wanted) < right * np.linalg.norm(wanted), key
        assert abs(weights @ forward - np.sum(gradient[key] * step)) \
            < 1e-5 * np.linalg.norm(weights) * np.linalg.norm(forward), key


def test_two_senders_and_one_target_interfere_as_their_delay_says(variant):
    """|p|² = |1 + e^(-iφ)|² / 4 of one sender's: d ln |p|² / dτ = -2π f tan(φ/2), φ = 2π f τ for a target ahead."""
    made = array_sonar({"bed": bed(500.0), "ball": point_target([0.0, 8.0, -10.0], 20.0)}, sensor={
        "receive": "point", "transmit": "line", "transmit_elements": 2, "beams": 1, "picture": "elements",
        "transmit_pitch": 0.0075, "transmit_normal": "forward", "transmit_axis": "starboard"},
        integrator={"cell": 20.0}, film={"range": 10.0})
    late = 1.5e-6
    model = mitsonar.coherent_model(made, ["sensor.tx_delay"])
    delay = model.start["sensor.tx_delay"] + [0, late]
    jacobian = model.linearised({"sensor.tx_delay": delay})
    peak = int(np.argmax(jacobian.value))
    slope = jacobian.forward({"sensor.tx_delay": np.array([0, 1.0])})[peak] / jacobian.value[peak]
    # the envelope is later too, by less than 2 % of the carrier's turn: bandwidth over frequency, at the peak squared
    assert slope == pytest.approx(-2 * np.pi * 100e3 * np.tan(np.pi * 100e3 * late), rel=0.02)


@pytest.mark.parametrize("key", ["sensor.tx_delay", "ball.position"])
def test_a_loss_of_rendered_levels_goes_back_and_a_tangent_forward(variant, rng, key):
    import mitsuba as mi
    made = scene()
    parameters, leaf = attached(made, key)
    image = mi.render(made, parameters, seed=1)
    level = np.array(dr.detach(image))
    weights = np.where(level > level.max() - 20, rng.standard_normal(level.shape), 0).astype(np.float32)
    dr.backward(dr.sum(image * mi.TensorXf(weights)))
    gradient = np.array(dr.grad(leaf))
    step = STEPS[key] * rng.uniform(-1, 1, gradient.shape)
    parameters, leaf = attached(made, key, step)
    moved = mi.render(made, parameters, seed=1)
    dr.forward_to(moved)
    forward = np.array(dr.grad(moved))
    scale = np.linalg.norm(weights) * np.linalg.norm(forward[weights != 0])
    assert gradient.any() and abs(np.sum(weights * forward) - gradient @ step) < 1e-5 * scale


def test_keys_of_beams_and_of_both_kinds_are_refused(variant):
    made = scene()
    attached(made, "sensor.rx_delay")
    with pytest.raises(ValueError, match="beams are formed with it"):
        made.integrator().render(made)
    made = scene()
    attached(made, "sensor.tx_delay")
    attached(made, "sensor.medium.sound_speed")
    with pytest.raises(ValueError, match="one of them carry"):
        made.integrator().render(made)


def test_other_sonars_and_quantities_are_refused(variant):
    with pytest.raises(ValueError, match="this sensor is a multibeam"):
        mitsonar.coherent_model(multibeam({"bed": bed(20.0)}), ["sensor.tx_delay"])
    with pytest.raises(ValueError, match="of is 'phase'"):
        mitsonar.coherent_model(scene(), ["sensor.tx_delay"], of="phase")


def test_a_fit_recovers_the_delays_of_elements_from_one_forward_looking_picture(variant, rng):
    """Delays of some tenth of a period at 720 kHz, found to a two-hundredth of it, but for what all have in common."""
    made = forward_looking({"bed": bed(60.0), **{f"buoy{n}": point_target([x, y, -10.0], 10.0) for n, (x, y) in
                                                 enumerate([(-1.0, 5.0), (0.4, 6.0), (1.5, 7.0)])}},
                           sensor={"picture": "elements", "receive_elements": 8, "beams": 16, "noise": False},
                           integrator={"cell": 5.0}, film={"range": 8.0})
    key = "sensor.rx_delay"
    model = mitsonar.coherent_model(made, [key], of="amplitude", seed=1)
    true = model.start[key] + rng.uniform(-1, 1, 8) * 1e-7
    wanted = model.value({key: true})
    found = fit(model, Gaussian(wanted, 1e-3 * np.abs(wanted).max()), {key: Prior(deviation=1e-7)})
    off = found.values[key] - true
    assert np.abs(off - off.mean()).max() < 5e-3 / 720e3
