"""The bsdf `elastic` is the law: in float32 on the device, by name, by parameters, by textures and maps of classes.

Tolerance: 0.003 dB, as of the bsdf `sediment`, whose lobe it shares.
"""
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scattering import ELASTIC_SEDIMENTS, ElasticSediment, bistatic_strength_db
from mitsonar.scene.loading import prepare

TOLERANCE = 3e-3
PARAMETERS = {"density_ratio": [2.2, 2.7], "sound_speed_ratio": [2.0, 2.4], "loss": [0.002, 0.02],
              "shear_speed_ratio": [0.3, 1.2], "shear_loss": [0.02, 0.1], "w2": [1e-5, 1e-4], "gamma": [2.8, 3.4],
              "w3": [0.0, 6e-5]}


def directions(grazing_in, grazing_out, azimuth):
    """Local directions towards where sound comes from and goes to."""
    i, s, turn = np.broadcast_arrays(*(np.atleast_1d(angle) for angle in (grazing_in, grazing_out, azimuth)))
    wi = mi.Vector3f(mi.Float(np.cos(i)), 0, mi.Float(np.sin(i)))
    wo = mi.Vector3f(mi.Float(-np.cos(s) * np.cos(turn)), mi.Float(-np.cos(s) * np.sin(turn)), mi.Float(np.sin(s)))
    return wi, wo


def strength_db(material, *angles, frequency, pixels=0):
    """Strength of a material on the device, in the middle of N pixels along u where there are any."""
    import drjit as dr

    wi, wo = directions(*angles)
    si = dr.zeros(mi.SurfaceInteraction3f, max(pixels, dr.width(wi)))
    if pixels:
        si.uv = mi.Point2f(mi.Float((np.arange(pixels) + 0.5) / pixels), 0.5)
    found = material.scattering_strength(si, wi, wo, dr.opaque(mi.Float, frequency), dr.opaque(mi.Float, 1480.0))
    with np.errstate(divide="ignore"):
        return 10 * np.log10(found.numpy().astype(float))


def along_u(values):
    """A texture of 1 x N pixels without interpolation."""
    pixels = np.asarray(values, np.float32)[None, :, None]
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True, "filter_type": "nearest",
            "wrap_mode": "clamp"}


@pytest.mark.parametrize("sediment", ELASTIC_SEDIMENTS)
def test_material_is_the_law(make, rng, sediment):
    i, s = rng.uniform(0.001, np.pi / 2, (2, 3000))
    turn = rng.uniform(0, 2 * np.pi, 3000)
    s[:1000], turn[:1000] = i[:1000], np.pi
    material = make("elastic", sediment=sediment)
    for frequency in (5e3, 30e3, 95e3, 290e3):
        expected = bistatic_strength_db("elastic", i, s, turn, frequency, sound_speed=1480.0, sediment=sediment)
        found = strength_db(material, i, s, turn, frequency=frequency)
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


def test_finite_from_grazing_to_nadir(make):
    angles = np.array([0, 1e-7, 1e-4, 0.01, np.pi / 2])
    i, s, turn = (part.ravel() for part in np.meshgrid(angles, angles, [0.0, 1e-6, np.pi]))
    found = strength_db(make("elastic"), i, s, turn, frequency=1e5)
    assert (found < np.inf).all() and not np.isnan(found).any()
    assert np.isneginf(found[(i == 0) | (s == 0)]).all()


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_may_be_a_texture(variant, name):
    prepare()
    material = mi.load_dict({"type": "elastic", "w3": 1e-5, name: along_u(PARAMETERS[name])})
    assert material.textured
    found = strength_db(material, 0.4, 0.6, 2.0 + np.zeros(2), frequency=50e3, pixels=2)
    expected = [bistatic_strength_db(ElasticSediment.of("rock", **{"w3": 1e-5, name: value}), 0.4, 0.6, 2.0,
                                     50e3, sound_speed=1480.0) for value in PARAMETERS[name]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


def test_textures_are_clipped_to_what_is_valid(variant):
    prepare()
    textures = {name: along_u([-5.0, 100.0]) for name in PARAMETERS}
    found = strength_db(mi.load_dict({"type": "elastic", **textures}), 0.4, 0.6, np.zeros(2), frequency=1e4, pixels=2)
    assert np.isfinite(found).all()


def test_a_map_of_classes_carries_many_solids(variant):
    prepare()
    classes, numbers = ["cobble", "rock", "rough rock"], [2, 0, 1, 1]
    material = mi.load_dict({"type": "elastic", "classes": ", ".join(classes), "sediment_class": along_u(numbers)})
    found = strength_db(material, 0.5, 0.5, np.full(4, np.pi), frequency=4e4, pixels=4)
    expected = [bistatic_strength_db("elastic", 0.5, 0.5, np.pi, 4e4, sound_speed=1480.0, sediment=classes[number])
                for number in numbers]
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("name", PARAMETERS)
def test_derivatives(make, name):
    """Against central differences of the float64 law, to 1 %."""
    import drjit as dr

    rock = {field: getattr(ElasticSediment.of("rock", w3=1e-5), field) for field in PARAMETERS}
    step, angles = 1e-4 * rock[name], (0.6, 0.9, 2.5)
    above, below = (10 ** (bistatic_strength_db(ElasticSediment.of("rock", **rock | {name: rock[name] + change}),
                                                *angles, 60e3, sound_speed=1480.0) / 10) for change in (step, -step))
    material = make("elastic", w3=1e-5)
    parameters = mi.traverse(material)
    dr.enable_grad(parameters[name])
    parameters.update()
    wi, wo = directions(*angles)
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    dr.backward(material.scattering_strength(si, wi, wo, mi.Float(60e3), mi.Float(1480)))
    assert np.sum(dr.grad(parameters[name]).numpy()) == pytest.approx((above - below) / (2 * step), rel=0.01)


@pytest.mark.parametrize("attributes, words", [
    (dict(sediment="clay"), "clay is not among the solid seabeds"),
    (dict(sediment="porridge"), 'no sediment is called "porridge"; known are'),
    (dict(shear_loss=0.0), "shear_loss is the float 0.0; expected a number above 0"),
    (dict(shear_speed_ratio=2.2), "shear_speed_ratio is 2.2; it must be below 1.992"),
    (dict(w3=0.01), "reflection and volume send back"),
    (dict(volume_parameter=0.1), 'unknown attribute "volume_parameter"'),
])
def test_refusals_say_why(refusal, attributes, words):
    assert words in refusal("elastic", **attributes)


def test_frequencies_beyond_the_published_are_refused(make):
    material = make("elastic", sediment="rough rock")
    material.check(300e3, 1500.0)
    with pytest.raises(ValueError, match="rough rock at 310 kHz is too rough"):
        material.check(310e3, 1500.0)
