"""The material `windy_sea` and the shape `sea_surface` as Mitsuba sees them: the law in float32, and its sampling."""
import numpy as np
import pytest

from mitsonar.scattering.laws.sea_surface import roughness, strength


@pytest.fixture
def mi(variant):
    import mitsuba

    return mitsuba


def directions(rng, count):
    z, turn = rng.uniform(0.03, 1, count) ** 2, rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z]).astype(np.float32)


@pytest.mark.parametrize("wind", [2.0, 8.0, 20.0])
def test_device_gives_the_law_to_a_thousandth_of_a_decibel(make, mi, rng, wind):
    import drjit as dr

    material = make("windy_sea", wind_speed=wind)
    wi, wo = directions(rng, 100_000), directions(rng, 100_000)
    wo[:, :50_000] = wi[:, :50_000]
    si = dr.zeros(mi.SurfaceInteraction3f, 100_000)
    for frequency in (30e3, 100e3, 400e3):
        got = material.scattering_strength(si, mi.Vector3f(wi), mi.Vector3f(wo), mi.Float(frequency), mi.Float(1500))
        wanted = strength(None, roughness(wind), wi.astype(float), wo.astype(float), frequency, 1500.0)
        seen = wanted > 1e-12
        assert np.abs(10 * np.log10(got.numpy()[seen] / wanted[seen])).max() < 1e-3
        assert got.numpy()[~seen].max(initial=0) < 2e-12


@pytest.mark.parametrize("wind", [3.0, 12.0])
@pytest.mark.parametrize("grazing_deg", [8.0, 40.0, 90.0])
def test_drawn_directions_follow_their_density(make, mi, wind, grazing_deg):
    angle = np.radians(grazing_deg)
    wi = mi.ScalarVector3f(float(np.cos(angle)), 0.0, float(np.sin(angle)))
    sample, pdf = mi.chi2.BSDFAdapter("windy_sea", f'<float name="wind_speed" value="{wind}"/>', wi=wi)
    test = mi.chi2.ChiSquareTest(domain=mi.chi2.SphericalDomain(), sample_func=sample, pdf_func=pdf, sample_dim=3,
                                 sample_count=300_000, res=150, ires=16)
    assert test.run(), test.messages


@pytest.mark.parametrize("grazing_deg", [15.0, 50.0])
def test_shares_of_drawn_directions_add_up_to_the_albedo(make, mi, rng, grazing_deg):
    """<σ / (sin θ density)> over 10^6 draws is the integral of σ over the hemisphere, to 4 standard errors."""
    import drjit as dr

    material = make("windy_sea", wind_speed=6.0)
    count, angle = 1_000_000, np.radians(grazing_deg)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    wi = mi.Vector3f(float(np.cos(angle)), 0.0, float(np.sin(angle)))
    given = mi.Float(50e3), mi.Float(1500)
    first, *second = (mi.Float(rng.random(count, np.float32)) for _ in range(3))
    wo = material.drawn_direction(si, wi, *given, first, mi.Point2f(*second))
    density = material.direction_density(si, wi, wo, *given)
    sigma = material.scattering_strength(si, wi, wo, *given)
    share = dr.select(density > 0, sigma / density, 0).numpy() / np.sin(angle)
    grazing = (np.arange(500) + 0.5) / 500 * np.pi / 2
    root = (np.arange(1000) + 0.5) / 1000
    grazing, root = np.meshgrid(grazing, root, indexing="ij")
    turn = np.pi * root**2
    out = np.cos(grazing) * np.cos(turn), np.cos(grazing) * np.sin(turn), np.sin(grazing)
    whole = strength(None, roughness(6.0), (-np.cos(angle), 0, np.sin(angle)), out, 50e3, 1500.0)
    albedo = (whole * np.cos(grazing) * 4 * np.pi * root).sum() * np.pi / 2 / 500 / 1000 / np.sin(angle)
    assert share.mean() == pytest.approx(albedo, abs=4 * share.std() / np.sqrt(count) + 1e-3 * albedo)


def test_without_wind_it_is_a_mirror(make, mi):
    import drjit as dr

    calm, windy = make("windy_sea", wind_speed=0.0), make("windy_sea")
    assert calm.mirror and not windy.mirror
    si = dr.zeros(mi.SurfaceInteraction3f, 1)
    wi = mi.Vector3f([0.6], [0.0], [0.8])
    assert calm.scattering_strength(si, wi, wi, mi.Float(1e5), mi.Float(1500)).numpy() == 0
    wo = calm.drawn_direction(si, wi, mi.Float(1e5), mi.Float(1500), mi.Float(0.5), mi.Point2f(0.5, 0.5))
    np.testing.assert_allclose(np.ravel(wo.numpy()), [-0.6, 0.0, 0.8], rtol=1e-6)


def test_shape_is_a_level_square_at_the_surface(make):
    surface = make("sea_surface", size=100.0, wind_speed=7.0)
    np.testing.assert_array_equal(np.array([surface.bbox().min, surface.bbox().max]), [[-50, -50, 0], [50, 50, 0]])
    assert surface.sea_surface and surface.bsdf().wind_speed == 7
    assert make("sea_surface", skin={"type": "lambert"}).bsdf().mu_db == -27


@pytest.mark.parametrize("attributes, said", [
    ({"wind_speed": 3.0, "skin": {"type": "lambert"}}, "wind_speed is given beside a nested bsdf; give it to the bsdf"),
    ({"wind_speed": -1.0}, "wind_speed is the float -1.0; expected a number"),
    ({"size": 0.0}, "size is the float 0.0; expected a number"),
])
def test_what_a_shape_refuses(refusal, attributes, said):
    assert said in refusal("sea_surface", **attributes)
