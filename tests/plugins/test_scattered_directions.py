"""Directions that materials draw: distributed as they say (chi²), summing to one, carrying the surface's albedo.

The chi² test bins a million draws over the sphere in 201² cells against the density integrated over each, at the 1 %
level over all cases; seeds are fixed. Lobes narrower than a cell are left to the other two tests, whose integrals run
over the transverse wavenumber, polar about the specular direction, where every lobe is wide: the density to 0.2 % of
one (midpoint rule); the mean share of 400,000 draws against the integral of σ / sin θ_i to four standard errors and
0.2 % for the integral.
"""
import laws
import mitsuba as mi
import numpy as np
import pytest
from exhaustive import thinned

from mitsonar.scene.loading import prepare

MATERIALS = {
    **{name: material for name, (material, _) in laws.materials().items()},
    "sand": {"type": "sediment", "sediment": "medium sand"},
    "clay": {"type": "sediment", "sediment": "clay"},
    "gravel": {"type": "sediment", "sediment": "sandy gravel"},
    "resolved": {"type": "sediment", "mesh_resolution": 0.1},
    "steep spectrum": {"type": "sediment", "gamma": 3.8, "w2": 1e-4},
    "shallow spectrum": {"type": "sediment", "gamma": 2.5, "w2": 2e-6},
    "rock": {"type": "elastic", "sediment": "rock"},
    "cobble": {"type": "elastic", "sediment": "cobble"},
}
WIDE = [(name, khz, angle) for name in MATERIALS for khz, angle in ((100, 30), (100, 75), (300, 15))
        if name != "steep spectrum"]
ALL = [(name, khz, angle) for name in MATERIALS for khz in (10, 300) for angle in (3, 15, 40, 75, 90)
       if (name, khz) != ("shallow spectrum", 10)]              # a mirror to float32
DRAWS = 400_000


class Surface:
    """A material looked at from one direction, at one frequency."""

    def __init__(self, name, khz, angle):
        import drjit as dr

        prepare()
        self.material = mi.load_dict(MATERIALS[name])
        grazing, turn = np.radians(angle), 0.7
        self.wi = np.array([np.cos(grazing) * np.cos(turn), np.cos(grazing) * np.sin(turn), np.sin(grazing)])
        self.water = dr.opaque(mi.Float, khz * 1e3), dr.opaque(mi.Float, 1500.0)

    def _of(self, width):
        import drjit as dr

        return dr.zeros(mi.SurfaceInteraction3f, width), mi.Vector3f(*(dr.full(mi.Float, float(x), width)
                                                                       for x in self.wi))

    def draw(self, sample):
        si, wi = self._of(len(sample[0]))
        return self.material.drawn_direction(si, wi, *self.water, sample[0], mi.Point2f(sample[1], sample[2]))

    def density(self, wo):
        si, wi = self._of(len(wo[0]))
        return self.material.direction_density(si, wi, wo, *self.water)

    def strength(self, wo):
        si, wi = self._of(len(wo[0]))
        return self.material.scattering_strength(si, wi, wo, *self.water)

    def integral(self, function, radii=600, turns=160):
        """∫ function dΩ over the hemisphere: ln r = ln r_end - v², r the distance from the specular direction."""
        v, turn = np.meshgrid((np.arange(radii) + 0.5) * np.sqrt(22) / radii,
                              (np.arange(turns) + 0.5) * 2 * np.pi / turns, indexing="ij")
        x, y, z = self.wi
        along = x * np.cos(turn) + y * np.sin(turn)
        end = along + np.sqrt(z * z + along * along)
        back = z * z / end
        r = end * np.exp(-v * v)
        up = np.sqrt(end * -np.expm1(-v * v) * (back + r))
        wo = mi.Vector3f(*(mi.Float(part.ravel().astype(np.float32))
                           for part in (r * np.cos(turn) - x, r * np.sin(turn) - y, up)))
        cell = np.sqrt(22) / radii * 2 * np.pi / turns
        return float((function(wo).numpy().reshape(v.shape) / up * r * r * 2 * v).sum() * cell)


@pytest.mark.parametrize("name, khz, angle", thinned(WIDE, *(one for one in WIDE if one[2] != 75)))
def test_draws_are_distributed_as_they_say(variant, tmp_path, monkeypatch, name, khz, angle):
    from mitsuba import chi2

    monkeypatch.chdir(tmp_path)         # a test that fails leaves a file behind
    surface = Surface(name, khz, angle)
    test = chi2.ChiSquareTest(domain=chi2.SphericalDomain(), sample_func=surface.draw, pdf_func=surface.density,
                              sample_dim=3, sample_count=1_000_000, res=201, ires=32)
    assert test.run(significance_level=0.01, test_count=len(WIDE), quiet=True), test.messages


@pytest.mark.parametrize("name, khz, angle", thinned(ALL, *(one for one in ALL if one[2] in (3, 40, 90))))
def test_density_sums_to_one_and_draws_carry_the_albedo(variant, name, khz, angle):
    surface = Surface(name, khz, angle)
    assert surface.integral(surface.density) == pytest.approx(1, abs=2e-3)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(7, DRAWS)
    wo = surface.draw((sampler.next_1d(), *sampler.next_2d()))
    np.testing.assert_allclose(np.linalg.norm(wo.numpy(), axis=0), 1, atol=2e-6)
    density, strength = surface.density(wo).numpy().astype(float), surface.strength(wo).numpy().astype(float)
    assert (density > 0).mean() > 0.9999
    share = strength[density > 0] / density[density > 0] / surface.wi[2]
    albedo = surface.integral(surface.strength) / surface.wi[2]
    assert share.mean() == pytest.approx(albedo, abs=4 * share.std() / np.sqrt(DRAWS) + 2e-3 * albedo)
    assert share.std() < 3 * share.mean()           # few draws carry much more than the others


@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_directions_near_the_beam_are_many_and_carry_no_more_than_their_share(variant, turn):
    """Of Lambert's law μ sin θ_i sin θ_s, ∫ σ / sin θ_i dΩ = πμ, and with the azimuth as weight, ∫ ... cos 2φ dΩ = 0.

    The law alone draws 0.2 / π = 0.064 of the directions within 0.1 rad of the plane of the beam. Of the half drawn
    near it, ln(1 + 0.1 / 0.02) / ln(1 + π / 0.04) = 0.408 lie there. Means to four standard errors.
    """
    from types import SimpleNamespace

    import drjit as dr

    from mitsonar.scene.materials import next_direction

    prepare()
    shape = mi.load_dict({"type": "rectangle", "bsdf": {"type": "lambert", "mu_db": -10.0}})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(3, DRAWS)
    hits = SimpleNamespace(
        point=dr.zeros(mi.Point3f, DRAWS), normal=mi.Vector3f(0, 0, 1), smooth=None, uv=mi.Point2f(0.5),
        arrival_direction=dr.zeros(mi.Vector3f, DRAWS) + mi.Vector3f(0.8, 0, -0.6), sound_speed=mi.Float64(1500.0),
        primitive=mi.UInt32(0), shape=dr.full(mi.ShapePtr, shape, DRAWS))
    beam = dr.zeros(mi.Vector3f, DRAWS) + mi.Vector3f(0.6 * float(np.cos(turn)), 0.6 * float(np.sin(turn)), -0.8)
    towards, share, mirrored = next_direction(hits, mi.Bool(True), 100e3, beam, sampler.next_1d(), sampler.next_2d(),
                                              sampler.next_1d())
    x, y, _ = towards.numpy().astype(float)
    share, aside = share.numpy().astype(float), np.arctan2(y, x) - turn
    assert not mirrored.numpy().any()
    for value, expected in ((share, 0.1 * np.pi), (share * np.cos(2 * aside), 0.0), (share * np.sin(aside), 0.0)):
        assert value.mean() == pytest.approx(expected, abs=4 * value.std() / np.sqrt(DRAWS))
    near = np.abs(np.sin(aside)) < np.sin(0.1)
    assert near.mean() == pytest.approx(0.5 * (0.064 + 0.408), abs=4 * near.std() / np.sqrt(DRAWS) + 1e-3)
