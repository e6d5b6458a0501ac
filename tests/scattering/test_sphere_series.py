"""Spheres by their series: published tables, conservation of energy, limits.

Tables of Jech et al. 2015 (J. Acoust. Soc. Am. 138, 3742) are rounded to 0.01 dB: 0.006 dB allows for that alone. They
stand in ../shared, and are left out where it is not.
"""
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import simpson

from mitsonar.scattering import MATERIALS, Solid, SphereBody, sphere_form, sphere_target_strength_db

TABLE = Path(__file__).resolve().parents[3] / "shared/data/measured/benchmarks/Benchmark_Frequency_TS.csv"
WEAK = Solid(density=1028.9, compressional_speed=1480.3)
INNER = Solid(density=1031.0, compressional_speed=1483.3)
BODIES = {"Sphere_Rigid": SphereBody(inside="rigid"), "Sphere_PressureRelease": SphereBody(inside="soft"),
          "Sphere_Gas": SphereBody(inside=Solid(density=1.24, compressional_speed=345.0)),
          "Sphere_WeaklyScattering": SphereBody(inside=WEAK),
          "ShellSphere_PressureRelease": SphereBody(inside="soft", shell=WEAK, shell_thickness=0.001),
          "ShellSphere_WeaklyScattering": SphereBody(inside=INNER, shell=WEAK, shell_thickness=0.001)}
ELASTIC = {name: SphereBody(inside=solid) for name, solid in MATERIALS.items()}


def strength(body, radius, frequency, speed=1500.0, **rest):
    """Target strength [dB]."""
    return 20 * np.log10(np.abs(sphere_form(radius, frequency, speed, body=body, **rest)))


@pytest.mark.skipif(not TABLE.exists(), reason="the benchmark tables are not beside the checkout")
@pytest.mark.parametrize("name", BODIES)
def test_spheres_are_those_of_the_published_benchmark(name):
    """Radius 10 mm, 12 to 400 kHz: ka 0.5 to 17."""
    table = pd.read_csv(TABLE)
    got = strength(BODIES[name], 0.01, table["Frequency_kHz"].to_numpy() * 1e3, 1477.3, density=1026.8)
    np.testing.assert_allclose(got, table[name].to_numpy(), atol=0.006)


@pytest.mark.parametrize("material, diameter, kilohertz, expected", [
    ("tungsten_carbide", 0.0381, 38, -42.4), ("copper", 0.060, 38, -33.6), ("copper", 0.023, 120, -40.4)])
def test_calibration_spheres_have_their_nominal_strength(material, diameter, kilohertz, expected):
    """Foote 1983 (copper) and manuals (tungsten carbide), at 1490 m/s: to 0.1 dB, as they change with temperature."""
    assert strength(ELASTIC[material], diameter / 2, kilohertz * 1e3, 1490.0) == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("ka", [0.5, 3.0, 20.0, 200.0])
@pytest.mark.parametrize("name", ["tungsten_carbide", "copper", "Sphere_Rigid", "Sphere_PressureRelease", "Sphere_Gas"])
def test_what_a_sphere_scatters_is_what_the_forward_wave_lacks(name, ka):
    """∫|f|² dΩ = -(4π / k) Im f(0) for time e^(+iωt): no body here absorbs. Simpson's rule errs by less than 1e-4."""
    body = {**BODIES, **ELASTIC}[name]
    cosine_side = np.linspace(0, np.pi, 6001)
    form = sphere_form(1.0, ka * 1500 / (2 * np.pi), body=body, angle=cosine_side)
    scattered = 2 * np.pi * simpson(np.abs(form) ** 2 * np.sin(cosine_side), x=cosine_side)
    assert scattered == pytest.approx(-4 * np.pi / ka * form[0].imag, rel=1e-4)


def test_the_elastic_sphere_satisfies_the_boundary_conditions():
    """Faran's quotients beside the three conditions solved as they stand, wave by wave (n = 2, ka = 7).

    Radial displacement and stress continuous, no shear stress: potentials φ ~ j_n(k1 r) P_n, ψ ~ j_n(k2 r) dP_n/dθ.
    """
    from scipy.special import spherical_jn as j, spherical_yn as y

    n, ka, c, rho, solid = 2, 7.0, 1500.0, 1026.0, MATERIALS["copper"]
    x, x1, x2 = ka, ka * c / solid.compressional_speed, ka * c / solid.shear_speed
    square = n * (n + 1)
    hankel, slope = j(n, x) + 1j * y(n, x), j(n, x, True) + 1j * y(n, x, True)
    # unit radius and frequency; displacement = p' / (ρ ω²) in water, shear modulus μ = ρ1 / k2²
    mu = solid.density / (x2 / 1.0) ** 2
    second1, second2 = -2 / x1 * j(n, x1, True) - (1 - square / x1 ** 2) * j(n, x1), x2 * j(n, x2, True) - j(n, x2)
    lame = solid.density / x1 ** 2 - 2 * mu
    stress1 = -lame * x1 ** 2 * j(n, x1) + 2 * mu * x1 ** 2 * second1
    stress2 = 2 * mu * square * second2
    shear1 = 2 * (x1 * j(n, x1, True) - j(n, x1))
    shear2 = x2 ** 2 * (-2 / x2 * j(n, x2, True) - (1 - square / x2 ** 2) * j(n, x2)) + (square - 2) * j(n, x2)
    matrix = np.array([[-x * slope / rho, x1 * j(n, x1, True), square * j(n, x2)], [hankel, stress1, stress2],
                       [0, shear1, shear2]])
    wave = np.linalg.solve(matrix, [x * j(n, x, True) / rho, -j(n, x), 0])[0]
    # the same wave out of f: its projection on P_2
    nodes, weight = np.polynomial.legendre.leggauss(80)
    form = sphere_form(1.0, ka * c / (2 * np.pi), c, body=ELASTIC["copper"], density=rho, angle=np.arccos(nodes))
    projected = np.sum(weight * form * (3 * nodes ** 2 - 1) / 2) / 2
    assert projected == pytest.approx(1j / ka * np.conj(wave), rel=1e-9)


def test_the_series_holds_to_large_spheres():
    """Finite to ka 200 in steps of 0.1, and rigid and soft within 0.03 dB of a/2 from ka 60 (Franz waves decay)."""
    ka = np.arange(0.1, 200, 0.1)
    assert all(np.isfinite(sphere_form(1.0, ka * 1500 / (2 * np.pi), body=body)).all() for body in ELASTIC.values())
    for surface in ("rigid", "soft"):
        large = sphere_target_strength_db(1.0, ka[ka > 60] * 1500 / (2 * np.pi), surface=surface)
        np.testing.assert_allclose(large, 20 * np.log10(0.5), atol=0.03)


def test_the_phase_is_that_of_the_front():
    """A soft sphere answers with -(a/2) e^(2ika), to 1 / 2ka."""
    form = sphere_form(1.0, 100.0 * 1500 / (2 * np.pi), body=BODIES["Sphere_PressureRelease"])
    assert form == pytest.approx(-0.5 * np.exp(200j), rel=0.01)


@pytest.mark.parametrize("radius, frequency", [(0.0, 1e5), (1.0, 0.0), (1e3, 1e6), (np.nan, 1e5)])
def test_spheres_of_no_or_boundless_size_are_refused(radius, frequency):
    with pytest.raises(ValueError, match="spheres are computed"):
        sphere_form(radius, frequency, body=BODIES["Sphere_Rigid"])


def test_solids_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="shear"):
        Solid(density=1e3, compressional_speed=1000.0, shear_speed=900.0)
    with pytest.raises(ValueError, match="above 0"):
        Solid(density=0.0, compressional_speed=1000.0)
    with pytest.raises(ValueError, match="rigid, soft"):
        SphereBody(inside="hard")
