"""Every law is there as a material, and the material is the law: float32 on the device against float64 in NumPy.

Tolerance 0.005 dB: what float32 leaves of laws with narrow lobes, here at most 1e-3 dB.
"""
import laws
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scattering import LAWS, ElasticSediment, SeaSurface, Sediment
from mitsonar.scene.loading import prepare

TABLE = "grazing, 30 kHz, 300 kHz\n8, -32, -28\n20, -26, -22\n45, -20, -18\n75, -14, -14\n90, -4, -9\n"


def materials(folder):
    """The material of each law, and its object."""
    from mitsonar.io.scene_files import backscatter

    (folder / "measured.csv").write_text(TABLE, encoding="utf-8")
    return {**laws.materials(),
            "sediment": ({"type": "sediment", "sediment": "fine sand"}, Sediment.of("fine sand")),
            "elastic": ({"type": "elastic", "sediment": "cobble"}, ElasticSediment.of("cobble")),
            "empirical": ({"type": "empirical", "filename": str(folder / "measured.csv")},
                          backscatter.read(folder / "measured.csv")),
            "sea_surface": ({"type": "windy_sea", "wind_speed": 8.0}, SeaSurface(wind_speed=8))}


@pytest.mark.parametrize("name", LAWS)
def test_material_is_the_law(variant, tmp_path, rng, name):
    import drjit as dr

    prepare()
    description, law = materials(tmp_path)[name]
    material = mi.load_dict(description)
    i, s = rng.uniform(0.01, np.pi / 2 - 1e-3, (2, 4000))
    azimuth = rng.uniform(0, 2 * np.pi, 4000)
    s[:1000], azimuth[:1000] = i[:1000], np.pi
    wi = mi.Vector3f(mi.Float(np.cos(i)), 0, mi.Float(np.sin(i)))
    wo = mi.Vector3f(mi.Float(-np.cos(s) * np.cos(azimuth)), mi.Float(-np.cos(s) * np.sin(azimuth)),
                     mi.Float(np.sin(s)))
    si = dr.zeros(mi.SurfaceInteraction3f, 4000)
    for frequency in (20e3, 90e3, 250e3):
        found = material.scattering_strength(si, wi, wo, dr.opaque(mi.Float, frequency), dr.opaque(mi.Float, 1490.0))
        expected = law.scattering_strength(i, s, azimuth, frequency, 1490.0)
        np.testing.assert_allclose(10 * np.log10(found.numpy() / expected), 0, atol=5e-3)


@pytest.mark.parametrize("name", LAWS)
def test_mitsuba_sees_the_law_from_both_sides(variant, tmp_path, name):
    """Its value times sin θ_i is σ at 100 kHz and 1500 m/s; nothing passes through."""
    prepare()
    description, law = materials(tmp_path)[name]
    material, context = mi.load_dict(description), mi.BSDFContext()
    si = mi.SurfaceInteraction3f()
    si.wi = mi.Vector3f([0.8, 0.8, 0.8], 0, [0.6, -0.6, 0.6])
    wo = mi.Vector3f([0.6, 0.6, 0.6], 0, [0.8, -0.8, -0.8])
    found = material.eval(context, si, wo)[0].numpy()
    expected = law.scattering_strength(np.arcsin(0.6), np.arcsin(0.8), np.pi, 100e3, 1500.0) / 0.6
    np.testing.assert_allclose(found, [expected, expected, 0], rtol=2e-3)


def test_empirical_says_what_is_wrong_with_its_table(variant, tmp_path):
    prepare()
    (tmp_path / "loud.csv").write_text("angle, strength\n5, -3\n90, -3\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="loud.csv: more comes back than arrives"):
        mi.load_dict({"type": "empirical", "filename": str(tmp_path / "loud.csv")})
    with pytest.raises(RuntimeError, match="which is not there"):
        mi.load_dict({"type": "empirical", "filename": "none.csv"})
    with pytest.raises(RuntimeError, match="attribute filename is missing"):
        mi.load_dict({"type": "empirical"})
