"""Kirchhoff facets against closed forms of plates, and their parts: phase integral, reflection, spheres.

Far field, k = 2π / 0.015 m. The integral over a flat facet is exact, so plates of two facets agree to rounding; a disc
of n sides lacks (2π²/3n²) of its area: 0.002 dB with 180. Physical optics of a sphere errs by about 1/ka, and facets
of sagitta s by (ks)².
"""
import drjit as dr
import numpy as np
import pytest
from scipy.special import j1

from mitsonar.scattering import sphere_target_strength_db
from mitsonar.scattering.surfaces import facets
from mitsonar.scattering.surfaces.facets import phase_mean, scattering_length, triangle_integral
from mitsonar.scattering.surfaces.reflection import fluid_reflection

WAVELENGTH = 0.015
K = 2 * np.pi / WAVELENGTH
CORNERS = np.array([(0, 0, 0), (0.3, 0.02, 0.01), (0.05, 0.25, -0.03)])


def strength_db(corners, towards):
    return 20 * np.log10(abs(scattering_length(corners, K, towards)))


def tilted(tilt):
    return np.array([np.sin(tilt), 0.0, np.cos(tilt)])


def rectangle(a, b):
    corner = 0.5 * np.array([(-a, -b, 0), (a, -b, 0), (a, b, 0), (-a, b, 0)])
    return corner[[[0, 1, 2], [0, 2, 3]]]


def grid(point, s, t):
    """Triangles between the points of a surface at parameters s, t."""
    p = point(*np.meshgrid(s, t, indexing="ij"))
    a, b, c, d = p[:-1, :-1], p[1:, :-1], p[1:, 1:], p[:-1, 1:]
    return np.concatenate([np.stack(abc, -2).reshape(-1, 3, 3) for abc in ((a, b, c), (a, c, d))])


def test_the_phase_integral_at_its_checked_value():
    got = triangle_integral(CORNERS, [30.0, -20.0, 50.0])
    assert got == pytest.approx(1.8922275594673947e-3 - 1.2013699573538774e-3j, rel=1e-12)


def test_series_and_sum_over_edges_meet(rng):
    phases = 0.3 * rng.standard_normal((3, 20000))
    limit = facets.SMALL
    try:
        facets.SMALL = 1e9
        series = phase_mean(*phases)
        facets.SMALL = 0.0
        edges = phase_mean(*phases)
    finally:
        facets.SMALL = limit
    spread = (phases[1] - phases[0]) ** 2 + (phases[2] - phases[0]) ** 2
    both = (spread > 0.01) & (spread < limit)
    assert np.abs(np.array(series) - edges)[:, both].max() < 3e-8


def test_device_and_numpy_agree(rng):
    # float32: the sum over edges loses a few times 1e-7 / |w|, phases of 100 rad another 1e-5
    import mitsonar.device.llvm

    mitsonar.device.llvm.check()
    from drjit.llvm import Float

    phases = np.concatenate([scale * rng.standard_normal((3, 3000)) for scale in (1e-4, 0.1, 1.0, 30.0)], 1)
    device = phase_mean(*(Float(row.astype(np.float32)) for row in phases))
    for mine, exact in zip(device, phase_mean(*phases)):
        assert np.abs(mine.numpy() - exact).max() < 2e-5
    dr.flush_malloc_cache()


@pytest.mark.parametrize("phases", [(0, 0, 0), (5, 5, 5), (3, 3, -1), (-1, 3, 3), (3, -1, 3), (1e-9, 0, 2e-9)])
def test_the_mean_stays_finite_and_right_where_corners_share_a_phase(phases):
    i, j = (np.arange(400) + 0.5)[:, None] / 400, (np.arange(400) + 0.5)[None] / 400
    u, v = i, (1 - i) * j                                               # weight 1 - u over the unit square
    a, b, c = phases
    brute = np.sum(2 * (1 - u) * np.exp(1j * (a + (b - a) * u + (c - a) * v))) / 400 ** 2
    assert complex(*phase_mean(*map(np.float64, phases))) == pytest.approx(brute, abs=2e-5)


@pytest.mark.parametrize("tilt_deg, expected_db", [(0, 24.436975), (1, 7.005065)])
def test_square_plate_at_its_checked_values(tilt_deg, expected_db):
    assert strength_db(rectangle(0.5, 0.5), tilted(np.radians(tilt_deg))) == pytest.approx(expected_db, abs=1e-6)


@pytest.mark.parametrize("tilt_deg", [0.3, 5.0, 31.0, 72.0])
def test_rectangle_at_any_tilt(tilt_deg):
    a, b, tilt = 0.31, 0.2, np.radians(tilt_deg)
    expected = a * b / WAVELENGTH * np.sinc(K * a * np.sin(tilt) / np.pi) * np.cos(tilt)
    assert strength_db(rectangle(a, b), tilted(tilt)) == pytest.approx(20 * np.log10(abs(expected)), abs=1e-6)


@pytest.mark.parametrize("tilt_deg", [0.0, 1.0, 3.3])
def test_disc(tilt_deg):
    a, tilt = 0.25, np.radians(tilt_deg)
    disc = grid(lambda r, phi: np.stack([r * np.cos(phi), r * np.sin(phi), 0 * r], -1), [0, a],
                np.linspace(0, 2 * np.pi, 181))
    x = 2 * K * a * np.sin(tilt)
    expected = np.pi * a ** 2 / WAVELENGTH * (2 * j1(x) / x if x else 1.0) * np.cos(tilt)
    assert strength_db(disc, tilted(tilt)) == pytest.approx(20 * np.log10(abs(expected)), abs=0.05)


def test_lit_half_of_a_sphere():
    # ka = 50: the closed form of physical optics, f = (a/2)(e^(2ika) - (e^(2ika) - 1)/(2ika)), lies 0.0439 dB above a/2
    a = 50 / K
    lit = grid(lambda theta, phi: a * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi),
                                                np.cos(theta)], -1),
               np.linspace(0, np.pi / 2, 181), np.linspace(0, 2 * np.pi, 361))
    assert strength_db(lit, [0.0, 0.0, 1.0]) - 20 * np.log10(a / 2) == pytest.approx(0.0439, abs=0.01)
    assert strength_db(lit, [0.0, 0.0, 1.0]) == pytest.approx(sphere_target_strength_db(a, K * 1500 / (2 * np.pi)),
                                                              abs=0.1)


def test_a_rigid_plate_keeps_the_phase_of_a_mirror_but_for_a_quarter_turn():
    # an area that sends back all it gets radiates i/λ times its area: e^(+iωt), Huygens
    assert scattering_length(rectangle(0.5, 0.5), K, tilted(0)) == pytest.approx(1j * 0.25 / WAVELENGTH)


def test_source_and_receiver_change_places():
    # mirror direction apart: the two cosines and w are symmetric in both
    a, b = tilted(0.4), np.array([-0.2, 0.3, 0.933])
    b /= np.linalg.norm(b)
    assert scattering_length(rectangle(0.1, 0.2), K, a, b) == pytest.approx(
        scattering_length(rectangle(0.1, 0.2), K, b, a), rel=1e-12)


@pytest.mark.parametrize("grazing_deg, expected", [
    (5, -0.807628 - 0.548352j), (15, 0.029855 - 0.946250j), (30, 0.808088 - 0.337365j), (60, 0.399224 - 0.010450j),
    (90, 0.369801 - 0.007009j)])
def test_reflection_of_medium_sand(grazing_deg, expected):
    got = complex(*fluid_reflection(np.sin(np.radians(grazing_deg)), 1.845, 1.1782, 0.01624))
    assert got == pytest.approx(np.conj(expected), abs=1e-6)


@pytest.mark.parametrize("surface, deviations_db", [
    ("rigid", (-0.554811, -2.363791, 0.339076, -0.188087, -0.226047, -0.017897, -0.006580)),
    ("soft", (1.290642, 0.613920, 0.181879, 0.049374, 0.013307, 0.002164, 0.000542))])
def test_exact_spheres(surface, deviations_db):
    a, ka = 0.5, np.array([1, 2, 5, 10, 20, 50, 100.0])
    got = sphere_target_strength_db(a, ka / a * 1500 / (2 * np.pi), surface=surface)
    assert got - 20 * np.log10(a / 2) == pytest.approx(deviations_db, abs=1e-6)


def test_an_unknown_surface_is_refused():
    with pytest.raises(ValueError, match="rigid or soft"):
        sphere_target_strength_db(0.5, 1e5, surface="steel")
