"""The forms of the sonar equation agree with each other, and with spheres in water of one speed."""
import numpy as np
import pytest
from drjit.llvm.ad import Float, Float64

from mitsonar.echoes import sonar_equation as equation

AREA, RATIO, SINE, SOLID_ANGLE, STRENGTH, LOSS_DB = 6400.0, 1.01, 0.35, 2e-5, 0.012, 7.5


def value(array):
    return float(array.numpy()[0])


@pytest.fixture
def leg():
    return dict(spreading_area=Float(AREA), speed_ratio=Float(RATIO))


def test_a_ray_and_the_patch_it_lights_bring_the_same_echo(leg):
    """ΔΩ (σ / sin θ) (c_h / c_0)² / A of the ray, σ dA g² of the patch along its leg: to rounding, 1e-6."""
    ray = equation.echo_energy(solid_angle=Float(SOLID_ANGLE), strength=Float(STRENGTH), sin_grazing=Float(SINE),
                               loss=equation.absorbed(Float(LOSS_DB)), **leg)
    patch = equation.lit_patch(Float(SOLID_ANGLE), spreading_area=Float(AREA), sin_grazing=Float(SINE))
    gain = equation.leg_gain(**leg, loss_db=Float(LOSS_DB))
    assert value(ray) == pytest.approx(value(equation.along_legs(STRENGTH * patch, gain, gain)), rel=1e-6)


def test_a_target_in_water_of_one_speed_spreads_with_the_fourth_power_of_range():
    """TS - 40 log10 r - 2 α r."""
    gain = equation.leg_gain(spreading_area=Float(80.0 ** 2), speed_ratio=Float(1), loss_db=Float(2 * 0.03 * 80))
    echo = equation.along_legs(Float(10 ** -2.5), gain, gain)
    assert 10 * np.log10(value(echo)) == pytest.approx(-25 - 40 * np.log10(80) - 0.06 * 80, abs=1e-4)


def test_pressures_are_the_roots_of_energies(leg):
    out, back = equation.leg_gain(**leg), equation.leg_gain(spreading_area=Float(900), speed_ratio=Float(0.98))
    energy, pressure = equation.along_legs(Float(0.04), out, back), equation.pressure_along_legs(Float(0.2), out, back)
    assert value(pressure) ** 2 == pytest.approx(value(energy), rel=1e-6)


def test_a_ray_that_answers_a_wave_is_its_patch_along_its_leg(leg):
    """Intensity on the patch that a ray stands for: σ dA of it comes back along the leg, (c_h / c_0)² / A of that."""
    intensity, ray = Float(3e-4), dict(solid_angle=Float(SOLID_ANGLE), strength=Float(STRENGTH))
    answer = equation.returned_by_patch(intensity, sin_grazing=Float(SINE), speed_ratio=Float(RATIO), **ray)
    patch = equation.lit_patch(Float(SOLID_ANGLE), spreading_area=Float(AREA), sin_grazing=Float(SINE))
    assert value(answer) == pytest.approx(value(equation.returned(intensity * STRENGTH * patch, **leg)), rel=1e-6)


def test_a_patch_fills_the_solid_angle_it_was_lit_by():
    patch = equation.lit_patch(Float(SOLID_ANGLE), spreading_area=Float(AREA), sin_grazing=Float(SINE))
    seen = equation.solid_angle_of(patch, spreading_area=Float(AREA), sin_grazing=Float(SINE))
    assert value(seen) == pytest.approx(SOLID_ANGLE, rel=1e-6)


def test_a_flat_surface_overhead_is_an_image_of_the_sonar(leg):
    """A wave from the image, twice as far off and upside down: -1 / 2h in water of one speed."""
    gain = equation.leg_gain(spreading_area=Float(12.0 ** 2), speed_ratio=Float(1))
    assert value(equation.mirrored_overhead(gain, spreading_area=Float(12.0 ** 2), speed_ratio=Float(1))) == (
        pytest.approx(-1 / 24, rel=1e-6))


def test_rays_that_graze_bring_nothing():
    lit = equation.scattered(Float(1), Float([0.1, 0.1]), Float([0.0, 0.5]))
    np.testing.assert_allclose(lit.numpy(), [0, 0.2], rtol=1e-6)


@pytest.mark.parametrize("kind", [Float, Float64])
def test_speed_ratios_are_single_precision_from_either(kind):
    ratio = equation.speed_ratio(Float64([1480.0, 1520.0]), kind(1500))
    assert type(ratio) is Float
    np.testing.assert_allclose(ratio.numpy(), [1480 / 1500, 1520 / 1500], rtol=1e-7)
