"""The smooth materials as Mitsuba sees them: coefficients, silence as rough surfaces, attributes that are refused."""
import numpy as np
import pytest

from mitsonar.scattering.surfaces.reflection import fluid_reflection


@pytest.fixture
def mi(variant):
    import mitsuba

    return mitsuba


def coefficient(mi, material, sines, sound_speed=1500.0):
    """R of a material at grazing angles, complex."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, len(sines))
    real, imaginary = material.reflection(si, mi.Float(sines.astype(np.float32)), mi.Float(100e3),
                                          mi.Float(sound_speed), mi.Bool(True))
    return real.numpy() + 1j * imaginary.numpy()


SINES = np.sin(np.radians([2.0, 15.0, 30.0, 60.0, 90.0]))


@pytest.mark.parametrize("kind, value", [("rigid", 1.0), ("soft", -1.0)])
def test_walls_and_skins(mi, make, kind, value):
    assert np.array_equal(coefficient(mi, make(kind), SINES), np.full(5, value))


@pytest.mark.parametrize("sound_speed", [1450.0, 1530.0])
def test_impedance_follows_the_water(mi, make, sound_speed):
    got = coefficient(mi, make("impedance", density=1891.0, sound_speed=1767.0, loss=0.016), SINES, sound_speed)
    wanted = fluid_reflection(SINES, 1891 / 1025, 1767 / sound_speed, 0.016)
    assert got == pytest.approx(wanted[0] + 1j * wanted[1], abs=1e-4)


def test_the_same_material_as_water_is_not_there(mi, make):
    assert np.abs(coefficient(mi, make("impedance", density=1025.0, sound_speed=1500.0), SINES)).max() < 1e-3


@pytest.mark.parametrize("kind", ["rigid", "soft", "impedance"])
def test_smooth_surfaces_scatter_nothing(mi, make, kind):
    import drjit as dr

    numbers = {"density": 2000.0, "sound_speed": 3000.0} if kind == "impedance" else {}
    material, si = make(kind, **numbers), dr.zeros(mi.SurfaceInteraction3f, 3)
    up = mi.Vector3f(0, 0, 1) + dr.zeros(mi.Vector3f, 3)
    assert material.smooth
    assert not np.any(material.scattering_strength(si, up, up, mi.Float(1e5), mi.Float(1500)).numpy())


@pytest.mark.parametrize("kind, numbers, sentence", [
    ("rigid", {"density": 1000.0}, "unknown attribute"),
    ("impedance", {"density": 1000.0}, "sound_speed is missing"),
    ("impedance", {"density": -1.0, "sound_speed": 1500.0}, "density is the float -1.0; expected a number"),
    ("impedance", {"density": 1000.0, "sound_speed": 1500.0, "loss": 2.0}, "loss is the float 2.0")])
def test_what_is_refused(mi, make, kind, numbers, sentence):
    with pytest.raises(RuntimeError, match=sentence):
        make(kind, **numbers)
