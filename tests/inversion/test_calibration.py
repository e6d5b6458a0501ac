"""Calibration of an array from point targets: arrival times and their derivatives, and an array that is off."""
from dataclasses import replace

import numpy as np
import pytest
from summer import SUMMER

from mitsonar.inversion.arrays.arrival_model import UNITS, ArrivalModel
from mitsonar.inversion.arrays.arrival_times import MeasuredArrivals
from mitsonar.sonar.motion.track import Track
from mitsonar.water import SoundSpeedProfile

RING = np.stack([np.zeros(6), 0.2 * np.cos(np.arange(6)), 0.2 * np.sin(np.arange(6))], 1)
TARGETS = np.array([[-6.0, 14, -21], [5, 17, -18], [1, 22, -13]])
PINGS = 4
UNIFORM = SoundSpeedProfile.constant(1500.0)


def track(pings=PINGS):
    """A platform that surges, heaves and rolls."""
    time = 0.2 * np.arange(pings)
    return Track(time=time, position=np.stack([2 * time, 0 * time, -10 + 0.1 * np.sin(time)], 1),
                 roll=0.05 * np.sin(2 * time), pitch=0.03 * np.cos(time), heading=0.1 * np.sin(time))


def test_arrivals_move_with_every_parameter_as_differences_say(rng):
    """Float64 throughout: differences leave 1e-7, those of rotations among them."""
    model = ArrivalModel(track(), RING, [0.1, 0.2, 0.1], TARGETS, SUMMER, duration=0.05)
    jacobian = model.linearised({})
    weights = rng.standard_normal(len(jacobian.value))
    gradient = jacobian.backward(weights)
    for name, start in model.start.items():
        direction = rng.standard_normal(start.shape)
        step = 1e-6 if name == "rx_delay" else 1e-4
        there, back = (model.value({name: start + sign * step * direction}) for sign in (1, -1))
        forward = jacobian.forward({name: direction})
        assert np.linalg.norm(forward - (there - back) / (2 * step)) < 1e-6 * np.linalg.norm(forward), name
        assert weights @ forward == pytest.approx(np.sum(gradient[name] * direction), abs=1e-12)
    whole = np.concatenate([np.ravel(direction) for direction in model.start.values()])
    assert jacobian.dense() @ whole == pytest.approx(jacobian.forward(model.start), abs=1e-12)


def test_a_platform_whose_targets_move_with_it_hears_the_same():
    """Navigation as a whole cannot be told from the places of targets, in uniform water: a null space."""
    model = ArrivalModel(track(), RING, np.zeros(3), TARGETS, SUMMER, duration=0.05)
    jacobian = model.linearised({})
    shift = np.array([0.3, -0.2, 0.0])
    both = jacobian.forward({"position_offset": np.tile(shift, (PINGS, 1)),
                             "target_position": np.tile(shift, (len(TARGETS), 1))})
    assert np.abs(both).max() < 1e-6 * np.abs(jacobian.forward({"target_position": np.tile(shift, (3, 1))})).max()


def heard(model, values, rng, frequency=100e3, deviation=5e-8):
    """Arrivals of those values as they would be measured, phases with their cycles lost."""
    time = model.value(values).reshape(model.shape)
    late = time + deviation * rng.standard_normal(time.shape)
    ratio = np.full(time.shape, 1 / (2 * (2 * np.pi * frequency * deviation) ** 2))
    return MeasuredArrivals(time=time + 5e-7 * rng.standard_normal(time.shape), noise_ratio=ratio, bandwidth=6e3,
                            peak=np.exp(-2j * np.pi * frequency * late), frequency=frequency)


def test_an_array_that_is_off_is_found_as_well_as_is_said(rng):
    """Errors are as large as the uncertainties say (within half, over a hundred numbers), and smaller than before."""
    from mitsonar.inversion.arrays.calibration import BELIEVED, found
    model = ArrivalModel(track(), RING, np.zeros(3), TARGETS, UNIFORM, duration=0.05)
    believed = {name: np.full(start.shape, {**BELIEVED, "velocity_offset": 0.0}[name])
                for name, start in model.start.items()}
    truth = {name: start + believed[name] * rng.standard_normal(start.shape) for name, start in model.start.items()}
    answer = found(model, heard(model, truth, rng), believed)
    off = {name: np.ravel((answer.values[name] - truth[name]) / np.maximum(answer.uncertainty[name], 1e-15))
           for name in ("rx_position", "position_offset", "attitude_offset", "target_position")}
    assert np.sqrt(np.mean(np.concatenate(list(off.values())) ** 2)) == pytest.approx(1, abs=0.5)
    before, after = (np.linalg.norm(part["position_offset"] - truth["position_offset"])
                     for part in (model.start, answer.values))
    assert after < 0.7 * before
    assert answer.ambiguous < 0.01
    assert answer.effective < len(answer.singular_values)
    # the array as a whole may stand elsewhere against platform and targets: that is said
    assert any("shift forward is not observable" in sentence for sentence in answer.sentences())
    assert answer.to_dataset()["rx_position_deviation"].dims == ("rx", "axis")


def test_cycles_in_doubt_are_told(rng):
    from mitsonar.inversion.arrays.calibration import BELIEVED, found
    model = ArrivalModel(track(), RING, np.zeros(3), TARGETS, UNIFORM, duration=0.05)
    believed = {name: np.full(start.shape, BELIEVED[name]) for name, start in model.start.items()}
    measured = heard(model, {}, rng)
    phases = replace(measured, peak=np.exp(2j * np.pi * rng.random(measured.peak.shape)))
    assert any("in doubt" in sentence for sentence in found(model, phases, believed).sentences())


def test_a_ping_whose_phases_are_of_another_cycle_is_left_out(rng):
    from mitsonar.inversion.arrays.calibration import BELIEVED, found
    model = ArrivalModel(track(), RING, np.zeros(3), TARGETS, UNIFORM, duration=0.05)
    believed = {name: np.full(start.shape, 0.01 * BELIEVED[name]) for name, start in model.start.items()}
    measured = heard(model, {}, rng)
    late = measured.time.copy()
    late[2] += 0.46 / measured.frequency
    answer = found(model, replace(measured, time=late), believed)
    assert np.flatnonzero(answer.left_out).tolist() == [2]
    assert any("Pings 2 were left out" in sentence for sentence in answer.sentences())


@pytest.mark.parametrize("how, words", [
    ({"keys": ["rx_positions"]}, "did you mean"), ({"targets": np.zeros((2, 2))}, "three finite numbers")])
def test_models_that_cannot_be_are_refused(how, words):
    arguments = {"targets": TARGETS, "keys": tuple(UNITS), **how}
    with pytest.raises(ValueError, match=words):
        ArrivalModel(track(), RING, np.zeros(3), arguments["targets"], SUMMER, duration=0.05, keys=arguments["keys"])


def test_an_array_is_calibrated_from_its_signals(variant, rng):
    """Element signals of an array that is 2 mm off, over a quiet bed: its shape to 0.3 mm, and gains to 2 %."""
    import mitsonar
    from mitsonar.inversion.arrays.calibration import calibrated
    from mitsonar.validation.scenes import array_sonar, buried_bed, point_target
    shapes = {f"ball{number}": point_target(place, 5.0) for number, place in enumerate(TARGETS)}
    scene = array_sonar({"bed": buried_bed(30.0), **shapes}, integrator={"cell": 4.0}, film={"range": 32.0},
                        sensor={"receive": "line", "receive_elements": 6, "receive_pitch": 0.05, "pings": 4,
                                "pulse": "lfm", "bandwidth_khz": 20.0, "speed_knots": 2.0, "self_noise_db": 70.0})
    signals = mitsonar.element_signals(scene, list(range(4)))
    gain = np.array([1, 1, 1, 0.5, 1, 1.5])
    believed = signals.copy(data=(signals.values * gain[:, None]).astype(np.complex64))
    for axis in "xyz":
        off = 2e-3 * rng.standard_normal(6)
        believed = believed.assign_coords({f"rx_{axis}": ("rx", signals[f"rx_{axis}"].values + off)})
    profile = scene.sensors()[0].water.profile
    answer = calibrated(believed, TARGETS, profile, believed={
        "rx_position": 2e-3, "rx_delay": 0.0, "position_offset": 0.0, "attitude_offset": 0.0, "velocity_offset": 0.0,
        "target_position": 0.0})
    true = np.stack([signals[f"rx_{axis}"].values for axis in "xyz"], 1)
    assert np.sqrt(np.mean((answer.values["rx_position"] - true) ** 2)) < 3e-4
    assert answer.gain == pytest.approx(gain / gain.mean(), rel=0.02)
    with pytest.raises(ValueError, match="no parameter of a calibration"):
        calibrated(believed, TARGETS, profile, believed={"rx_place": 1.0})
    with pytest.raises(ValueError, match="targets that stand out"):
        calibrated(believed, TARGETS + [0, 40, 0], profile)
    with pytest.raises(ValueError, match="give the result of mitsonar.element_signals"):
        calibrated(believed.isel(tx=0), TARGETS, profile)
