"""The bsdf `sediment` is the law: in float32 on the device, by name, by parameters, by textures and maps of classes.

Tolerance: 0.003 dB, what float32 leaves: 4e-4 dB, and more only on the flank of lobes a thousandth of a radian wide
(muds at 5 kHz), which the last bit of a direction moves.
Derivatives: against central differences of the float64 law, to 0.5 % (the differences' own rounding and h² are 1e-6).
"""
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scattering import SEDIMENTS, Sediment, bistatic_strength_db
from mitsonar.scene.loading import prepare

TOLERANCE = 3e-3
NAMES = ("density_ratio", "sound_speed_ratio", "loss", "volume_parameter", "w2", "gamma")


def directions(grazing_in, grazing_out, azimuth):
    """Local directions towards where sound comes from and goes to."""
    i, s, turn = np.broadcast_arrays(grazing_in, grazing_out, azimuth)
    wi = mi.Vector3f(mi.Float(np.cos(i)), 0, mi.Float(np.sin(i)))
    wo = mi.Vector3f(mi.Float(-np.cos(s) * np.cos(turn)), mi.Float(-np.cos(s) * np.sin(turn)), mi.Float(np.sin(s)))
    return wi, wo


def strength(material, angles, frequency, *, si=None, sound_speed=1500.0):
    """σ of a material on the device."""
    import drjit as dr

    wi, wo = directions(*angles)
    if si is None:
        si = dr.zeros(mi.SurfaceInteraction3f, dr.width(wi))
    return material.scattering_strength(si, wi, wo, dr.opaque(mi.Float, frequency), dr.opaque(mi.Float, sound_speed))


def strength_db(*arguments, **more):
    return 10 * np.log10(strength(*arguments, **more).numpy().astype(float))


def some_angles(rng, count=3000):
    """Any angles, then backscatter, then some hundredths of a radian about specular."""
    i, s = rng.uniform(0.001, np.pi / 2, (2, count))
    turn = rng.uniform(0, 2 * np.pi, count)
    third = count // 3
    s[:third], turn[:third] = i[:third], np.pi
    near = slice(third, 2 * third)
    s[near] = np.clip(i[near] + 0.01 * rng.normal(size=third), 0.001, np.pi / 2)
    turn[near] = 0.01 * rng.normal(size=third)
    return i, s, turn


@pytest.mark.parametrize("sediment", SEDIMENTS)
def test_material_is_the_law(make, rng, sediment):
    material, angles, law = make("sediment", sediment=sediment), some_angles(rng), Sediment.of(sediment)
    for frequency in (5e3, 30e3, 95e3, 400e3):
        try:
            expected = bistatic_strength_db(law, *angles, frequency, sound_speed=1480.0)
        except ValueError:
            continue
        found = strength_db(material, angles, frequency, sound_speed=1480.0)
        np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("gamma", [2.41, 2.8, 3.25, 3.6, 3.89])
def test_free_parameters(make, rng, gamma):
    free = dict(density_ratio=1.6, sound_speed_ratio=0.9999, loss=0.02, volume_parameter=0.0, w2=3e-5, gamma=gamma)
    material, angles = make("sediment", **free), some_angles(rng)
    expected = bistatic_strength_db("sediment", *angles, 20e3, **free)
    np.testing.assert_allclose(strength_db(material, angles, 20e3), expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("resolution, frequency", [(0.05, 30e3), (0.05, 300e3), (0.5, 100e3)])
def test_features_that_a_mesh_holds_are_left_out(make, rng, resolution, frequency):
    material, angles = make("sediment", sediment="fine sand", mesh_resolution=resolution), some_angles(rng)
    expected = bistatic_strength_db("sediment", *angles, frequency, sediment="fine sand", mesh_resolution=resolution)
    whole = bistatic_strength_db("sediment", *angles, frequency, sediment="fine sand")
    np.testing.assert_allclose(strength_db(material, angles, frequency), expected, rtol=0, atol=0.01)
    assert np.abs(expected - whole).max() > 1


def test_finite_from_grazing_to_nadir_and_nothing_where_not_asked(make):
    angles = np.array([0, 1e-7, 1e-4, 0.01, np.pi / 2])
    i, s, turn = (part.ravel() for part in np.meshgrid(angles, angles, [0.0, 1e-6, np.pi]))
    for sediment in ("medium sand", "clay"):
        material = make("sediment", sediment=sediment)
        found = strength(material, (i, s, turn), 1e5).numpy()
        assert np.isfinite(found).all() and (found >= 0).all()
        assert (found[(i == 0) | (s == 0)] == 0).all()
    import drjit as dr

    wi, wo = directions(i, s, turn)
    si = dr.zeros(mi.SurfaceInteraction3f, len(i))
    assert not material.scattering_strength(si, wi, wo, mi.Float(1e5), mi.Float(1500), mi.Bool(False)).numpy().any()


def along_u(values):
    """A texture of 1 x N pixels without interpolation."""
    pixels = np.asarray(values, np.float32)[None, :, None]
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True, "filter_type": "nearest",
            "wrap_mode": "clamp"}


def at_pixels(count):
    """Interactions in the middle of each of N pixels along u."""
    import drjit as dr

    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.uv = mi.Point2f(mi.Float((np.arange(count) + 0.5) / count), 0.5)
    return si


@pytest.mark.parametrize("name, values", [("density_ratio", [1.2, 1.9]), ("sound_speed_ratio", [0.985, 1.2]),
                                          ("loss", [0.003, 0.02]), ("volume_parameter", [0.0, 0.01]),
                                          ("w2", [1e-6, 3e-5]), ("gamma", [2.9, 3.4])])
def test_every_parameter_may_be_a_texture(variant, name, values):
    prepare()
    material = mi.load_dict({"type": "sediment", "sediment": "fine sand", "w2": 1e-5, name: along_u(values)})
    assert material.textured
    found = strength_db(material, (0.4, 0.6, 2.0 + np.zeros(2)), 50e3, si=at_pixels(2))
    expected = [bistatic_strength_db(Sediment.of("fine sand", **{"w2": 1e-5, name: value}), 0.4, 0.6, 2.0, 50e3)
                for value in values]
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


def test_textures_are_clipped_to_what_is_valid(variant):
    prepare()
    textures = {name: along_u([-5.0, 100.0]) for name in NAMES}
    found = strength(mi.load_dict({"type": "sediment", **textures}), (0.4, 0.6, np.zeros(2)), 1e4, si=at_pixels(2))
    assert np.isfinite(found.numpy()).all()


@pytest.mark.parametrize("scale", [1.0, 255.0])
def test_a_map_of_classes_carries_many_sediments(variant, scale):
    prepare()
    classes, numbers = ["clay", "medium sand", "sandy gravel"], [2, 0, 1, 1, 7]        # 7: the last there is
    material = mi.load_dict({"type": "sediment", "classes": ", ".join(classes), "class_scale": scale,
                             "sediment_class": along_u(np.array(numbers) / scale), "volume_parameter": 0.003})
    assert material.textured
    found = strength_db(material, (0.5, 0.5, np.full(5, np.pi)), 1e5, si=at_pixels(5))
    expected = [bistatic_strength_db("sediment", 0.5, 0.5, np.pi, 1e5, sediment=classes[min(number, 2)],
                                     volume_parameter=0.003) for number in numbers]
    np.testing.assert_allclose(found, expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize(("border", "shares"), [(0.0, [0, 0, 0, 1, 1, 1]), (2.0, [0, 0.02, 0.28, 0.72, 0.98, 1])])
def test_classes_of_a_picture_go_over_into_each_other(variant, border, shares):
    """Two pixels of 3 m, seen at six places from 1.5 m before their border to 1.5 m after it.

    The share of the other class at d from the border is (1 - 2 d / w)² / 2 within half the width w.
    """
    import drjit as dr

    prepare()
    clay, sand = (strength(mi.load_dict({"type": "sediment", "sediment": name}), (0.5, 0.5, np.full(1, np.pi)), 1e5)
                  .numpy()[0] for name in ("clay", "medium sand"))
    material = mi.load_dict({"type": "sediment", "classes": "clay, medium sand", "class_border": border / 3,
                             "sediment_class": along_u([0, 1])})
    count = 4000
    for at, wanted in zip((-1.5, -0.8, -0.25, 0.25, 0.8, 1.5), shares):
        si = dr.zeros(mi.SurfaceInteraction3f, count)
        si.uv = mi.Point2f(mi.Float(np.full(count, 0.5 + at / 6)), 0.5)
        si.p = mi.Point3f(mi.Float(np.full(count, at)), mi.Float(0.05 * np.arange(count) + 0.02), 0)
        found = (strength(material, (0.5, 0.5, np.full(count, np.pi)), 1e5, si=si).numpy() - clay) / (sand - clay)
        assert found.mean() == pytest.approx(wanted, abs=0.03)
        assert np.all(np.abs(found - np.round(found)) < 1e-3)


@pytest.mark.parametrize(("more", "words"), [
    ({"second_share": {"type": "mesh_attribute", "name": "face_share"}}, "second_share is written alone"),
    ({"second_class": 1.0}, "second_class is a number"),
    ({"class_border": 2.0, "sediment_class": {"type": "mesh_attribute", "name": "face_class"}}, "has no pixels"),
])
def test_borders_that_cannot_be(refusal, more, words):
    assert words in refusal("sediment", **{"classes": "clay, silt", "sediment_class": along_u([0, 1]), **more})


def test_the_edge_of_a_picture_is_no_border(variant):
    """A picture that repeats itself does not bring the class of its far side in."""
    import drjit as dr

    prepare()
    picture = {**along_u([0, 0, 1]), "wrap_mode": "repeat"}
    material = mi.load_dict({"type": "sediment", "classes": "clay, medium sand", "sediment_class": picture})
    si = dr.zeros(mi.SurfaceInteraction3f, 500)
    si.uv, si.p = mi.Point2f(0.01, 0.5), mi.Point3f(mi.Float(np.arange(500) * 0.05), 0, 0)
    assert np.ptp(strength(material, (0.5, 0.5, np.full(500, np.pi)), 1e5, si=si).numpy()) == 0


def test_facets_of_a_mesh_carry_classes_and_parameters(variant):
    """Facets' own class numbers and nodes' own roughness, seen by rays that a scene's materials are asked about."""
    from mitsonar.scene import materials

    prepare()
    mesh = mi.Mesh("bed", 4, 2, has_vertex_normals=False, has_vertex_texcoords=False)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0])
    parameters["faces"] = mi.UInt32([0, 1, 2, 0, 2, 3])
    parameters.update()
    mesh.add_attribute("face_sediment", 1, mi.Float([1, 0]))
    mesh.add_attribute("vertex_rough", 1, mi.Float([1e-5, 1e-5, 3e-5, 3e-5]))
    mesh.set_bsdf(mi.load_dict({
        "type": "sediment", "classes": "clay, medium sand",
        "sediment_class": {"type": "mesh_attribute", "name": "face_sediment"},
        "w2": {"type": "mesh_attribute", "name": "vertex_rough"}}))
    scene = mi.load_dict({"type": "scene", "bed": mesh})
    down = mi.Vector3f(float(np.cos(0.5)), 0, float(-np.sin(0.5)))
    target = mi.Point3f(mi.Float([0.5, -0.5]), mi.Float([-0.5, 0.0]), 0)
    si = scene.ray_intersect(mi.Ray3f(target - down, down))
    hits = SimpleNamespace(point=si.p, normal=si.n, arrival_direction=down, sound_speed=mi.Float(1500), uv=si.uv,
                           shape=si.shape, primitive=si.prim_index, smooth=None)
    found, _ = materials.scattering_strength(hits, si.is_valid(), 1e5)
    expected = [bistatic_strength_db("sediment", 0.5, 0.5, np.pi, 1e5, sediment=name, w2=w2)
                for name, w2 in (("medium sand", 1.5e-5), ("clay", 2e-5))]
    np.testing.assert_allclose(10 * np.log10(found.numpy()), expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("textured", [False, True], ids=["number", "texture"])
@pytest.mark.parametrize("name", NAMES)
def test_derivatives(variant, name, textured):
    import drjit as dr

    prepare()
    sand = Sediment.of("medium sand", w2=2e-5)
    value, step = getattr(sand, name), 1e-4 * getattr(sand, name)
    angles, frequency = (0.6, 0.9, np.array([0.1, 2.5])), 60e3
    above, below = (Sediment.of("medium sand", **{"w2": 2e-5, name: value + sign * step})
                    .scattering_strength(*angles, frequency, 1500.0) for sign in (1, -1))
    given = along_u([value, value]) if textured else value
    for k in range(2):
        material = mi.load_dict({"type": "sediment", "w2": 2e-5, name: given})
        parameters = mi.traverse(material)
        key = f"{name}.data" if textured else name
        dr.enable_grad(parameters[key])
        parameters.update()
        dr.backward(dr.gather(mi.Float, strength(material, angles, frequency, si=at_pixels(2)), k))
        gradient = np.sum(dr.grad(parameters[key]).numpy())
        assert gradient == pytest.approx((above - below)[k] / (2 * step), rel=5e-3, abs=1e-7)


def test_only_what_is_known_is_checked(variant):
    """Medium sand is too rough at 5 MHz; where its roughness is a texture's, only that is what counts."""
    prepare()
    with pytest.raises(ValueError, match="medium sand at 5000 kHz is too rough"):
        mi.load_dict({"type": "sediment", "loss": along_u([0.01, 0.02])}).check(5e6, 1450.0)
    mi.load_dict({"type": "sediment", "w2": along_u([1e-5, 2e-5])}).check(5e6, 1450.0)
    with pytest.warns(UserWarning, match="sandy gravel at 400 kHz is rougher than the law of small slopes is sure of"):
        mi.load_dict({"type": "sediment", "sediment": "sandy gravel"}).check(4e5, 1450.0)
    with pytest.raises(ValueError, match="rock at 200 kHz is not a fluid"):
        mi.load_dict({"type": "sediment", "sediment": "rock", "w2": along_u([1e-5, 2e-5])}).check(2e5, 1450.0)


def test_parameters_can_be_changed(make):
    material = make("sediment", sediment="medium sand")
    parameters = mi.traverse(material)
    parameters["gamma"], parameters["w2"] = mi.Float(3.0), mi.Float(4e-5)
    parameters.update()
    expected = bistatic_strength_db("sediment", 0.5, 0.7, 1.0, 3e4, sediment="medium sand", gamma=3.0, w2=4e-5)
    np.testing.assert_allclose(strength_db(material, (0.5, 0.7, 1.0), 3e4), expected, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("attributes, words", [
    (dict(sediment="porridge"), 'no sediment is called "porridge"; known are'),
    (dict(loss=0.0), "loss is the float 0.0; expected a number above 0"),
    (dict(gamma=4.5), "gamma is the float 4.5; expected a number above 2.4"),
    (dict(volume_parameter=-0.1), "volume_parameter is the float -0.1; expected a number at least 0"),
    (dict(w2="much"), 'w2 is the string "much"'),
    (dict(classes="clay, sand"), "classes is written without sediment_class"),
    (dict(sediment_class=1.0), "sediment_class is a number; give a texture of class numbers"),
    (dict(class_scale=255.0), "class_scale is written without sediment_class"),
    (dict(class_border=2.0), "class_border is written without sediment_class"),
    (dict(mesh_resolution=-0.1), "mesh_resolution is the float -0.1; expected a number [m] at least 0"),
    (dict(roughness=0.1), 'unknown attribute "roughness"'),
])
def test_refusals_say_why(refusal, attributes, words):
    assert words in refusal("sediment", **attributes)


def test_a_map_needs_its_classes(variant):
    prepare()
    number = along_u([0, 1])
    for attributes, words in (({}, "sediment_class is written without classes"),
                              ({"classes": "clay, sand", "sediment": "silt"}, "sediment and classes are written"),
                              ({"classes": "clay, gold"}, 'no sediment is called "gold"')):
        with pytest.raises(RuntimeError, match=words):
            mi.load_dict({"type": "sediment", "sediment_class": number, **attributes})


def test_what_a_mesh_holds_is_known_for_one_spectrum(variant):
    prepare()
    with pytest.raises(RuntimeError, match="gamma is a texture; give gamma as a number"):
        mi.load_dict({"type": "sediment", "mesh_resolution": 0.1, "gamma": along_u([3.0, 3.2])})


def test_lambert_takes_a_texture_of_decibels(variant):
    prepare()
    material = mi.load_dict({"type": "lambert", "mu_db": along_u([-30.0, -10.0, 20.0])})
    assert material.textured and not mi.load_dict({"type": "lambert"}).textured
    found = strength_db(material, (0.5, 0.7, np.zeros(3)), 1e5, si=at_pixels(3))
    shape = 10 * np.log10(np.sin(0.5) * np.sin(0.7))
    np.testing.assert_allclose(found, shape + np.array([-30, -10, 10 * np.log10(1 / np.pi)]), atol=1e-5)
