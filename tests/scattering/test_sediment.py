"""The fluid sediment: tables printed for it, limits in closed form, and what any law must keep.

Numbers: the rough, volume and total strengths computed once, independently, for parameters of TR 9407 in water of
1500 m/s, to the 0.001 dB printed; tolerance 0.0006 dB, half a digit and the 1e-6 of the interpolated integral. The
integral I(q, α): α = 1/2 has the closed form q/(1 + q²)^(3/2); others by direct quadrature of the definition.
Bias: none. The energy test has one, of the law itself: small slopes conserve energy only to 0.2 dB above 45 degrees
at up to 100 kHz, and lose up to 2.3 dB below the critical angle. Its quadrature, and the one compared to, are good to
0.1 %.
"""
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, j0

from mitsonar.scattering import (
    SEDIMENTS,
    LambertSeabed,
    RoughnessSpectrum,
    Sediment,
    backscatter_strength_db,
    bistatic_strength_db,
)
from mitsonar.scattering.surfaces.rough_interface import lobe_integral

REFERENCE = Path(__file__).resolve().parents[2] / ".." / "shared" / "reference" / "physics_checkpoints.json"
ANGLES = np.radians([10, 20, 30, 45, 60, 75, 85, 90])
TOLERANCE = 0.0006
VOLUME_DB = {
    "coarse sand": (-45.344, -37.692, -33.802, -25.548, -24.491, -24.020, -23.890, -23.873),
    "medium sand": (-43.598, -35.126, -29.610, -24.814, -24.031, -23.611, -23.490, -23.476),
    "fine sand": (-40.606, -30.922, -25.566, -24.464, -23.758, -23.353, -23.235, -23.221),
    "coarse silt": (-32.050, -27.874, -26.395, -24.998, -24.157, -23.698, -23.568, -23.552),
    "silt": (-35.725, -31.788, -29.930, -28.331, -27.419, -26.932, -26.795, -26.778),
    "clay": (-36.386, -32.036, -30.070, -28.417, -27.487, -26.993, -26.854, -26.837),
}
TOTAL_DB = {
    ("sandy gravel", 30): (-29.852, -22.489, -19.377, -17.450, -15.032, -10.155, -7.655, -7.295),
    ("coarse sand", 30): (-33.124, -25.615, -22.455, -20.995, -18.335, -11.461, -5.317, -4.168),
    ("medium sand", 30): (-36.533, -28.373, -24.676, -23.028, -21.011, -14.675, -5.530, -3.185),
    ("fine sand", 30): (-38.597, -29.306, -25.120, -24.083, -22.952, -19.311, -8.445, -3.769),
    ("coarse silt", 30): (-32.018, -27.856, -26.381, -24.980, -24.114, -23.379, -17.813, -2.632),
    ("silt", 30): (-35.714, -31.780, -29.923, -28.321, -27.394, -26.749, -22.724, -3.641),
    ("clay", 30): (-36.378, -32.030, -30.064, -28.409, -27.466, -26.838, -23.212, -4.424),
    ("sandy gravel", 100): (-25.943, -18.473, -15.244, -13.842, -13.554, -13.274, -13.279, -13.284),
    ("coarse sand", 100): (-29.339, -21.774, -18.553, -17.852, -15.362, -11.891, -10.482, -10.294),
    ("medium sand", 100): (-33.138, -24.984, -21.570, -21.140, -18.478, -13.120, -9.833, -9.330),
    ("fine sand", 100): (-36.708, -27.657, -24.523, -23.543, -21.889, -16.954, -11.076, -9.887),
    ("coarse silt", 100): (-31.970, -27.831, -26.361, -24.953, -24.048, -22.905, -15.487, -8.794),
    ("silt", 100): (-35.698, -31.768, -29.912, -28.306, -27.358, -26.474, -20.028, -9.847),
    ("clay", 100): (-36.366, -32.020, -30.055, -28.397, -27.435, -26.602, -20.651, -10.618),
    ("medium sand", 300): (-29.757, -21.540, -18.188, -18.626, -16.729, -15.137, -14.676, -14.620),
}
BISTATIC_DB = {  # medium sand: (kHz, θ_i, θ_s, φ) -> surface, volume
    (30, 30, 30, 90): (-25.3379, -29.6103), (30, 30, 30, 20): (-11.7347, -29.6103),
    (30, 30, 60, 180): (-26.5123, -29.3601), (30, 20, 70, 45): (-22.8705, -33.7161),
    (30, 45, 45, 5): (-0.3071, -24.8143), (30, 10, 40, 150): (-32.8494, -37.6480),
    (100, 30, 30, 90): (-21.2382, -29.6103), (100, 30, 60, 180): (-22.3412, -29.3601),
    (100, 45, 45, 5): (-5.8279, -24.8143), (100, 10, 40, 150): (-28.8398, -37.6480),
}


def decibels(value):
    return 10 * np.log10(value)


def wavenumber(khz):
    return 2e3 * np.pi * khz / 1500


# ---------------------------------------------------------------------------------------------- reference numbers

@pytest.mark.parametrize("sediment, khz", TOTAL_DB)
def test_backscatter_of_the_tables(sediment, khz):
    found = backscatter_strength_db("sediment", ANGLES, khz * 1e3, sediment=sediment)
    np.testing.assert_allclose(found, TOTAL_DB[sediment, khz], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("sediment", VOLUME_DB)
def test_volume_of_the_tables(sediment):
    found = decibels(Sediment.of(sediment).volume_strength(ANGLES, ANGLES))
    np.testing.assert_allclose(found, VOLUME_DB[sediment], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("case", BISTATIC_DB)
def test_bistatic_of_the_tables(case):
    khz, *angles = case
    angles, (surface, volume) = np.radians(angles), BISTATIC_DB[case]
    sand = Sediment.of("medium sand")
    assert decibels(sand.rough_strength(*angles, wavenumber(khz))) == pytest.approx(surface, abs=6e-5)
    assert decibels(sand.volume_strength(*angles[:2])) == pytest.approx(volume, abs=6e-5)
    together = decibels(10 ** (surface / 10) + 10 ** (volume / 10))
    assert bistatic_strength_db(sand, *angles, khz * 1e3) == pytest.approx(together, abs=1e-4)


@pytest.mark.parametrize("sediment, angle, expected", [
    ("rock", 5, -0.891028 - 0.451316j), ("coarse sand", 15, 0.060281 - 0.963162j),
    ("medium sand", 30, 0.808088 - 0.337365j), ("fine sand", 60, 0.251055 - 0.010819j),
    ("silt", 90, 0.062968 - 0.001922j)])
def test_reflection_of_the_tables(sediment, angle, expected):
    assert Sediment.of(sediment).reflection(np.radians(angle)) == pytest.approx(expected, abs=1e-6)


def checkpoints(formula):
    if not REFERENCE.is_file():
        pytest.skip(f"the reference numbers are not beside the checkout ({REFERENCE})")
    found = [(case["inputs"], case["output"]) for case in json.loads(REFERENCE.read_text())
             if case["topic"] == "5 seabed" and case["formula"].startswith(formula)]
    assert found
    return found


def sediment_of(inputs):
    return Sediment.of(inputs["sediment"].split("/")[0].strip())


def test_every_checkpoint_of_backscatter():
    for inputs, expected in checkpoints("backscatter strength"):
        sediment, angle = sediment_of(inputs), np.radians(inputs["grazing_deg"])
        surface = sediment.rough_strength(angle, angle, np.pi, wavenumber(inputs["f_Hz"] / 1e3))
        volume = sediment.volume_strength(angle, angle)
        assert decibels(surface) == pytest.approx(expected["rough_SSA_dB"], abs=1e-5)
        assert decibels(volume) == pytest.approx(expected["vol_dB"], abs=1e-9)
        assert decibels(surface + volume) == pytest.approx(expected["total_dB"], abs=1e-5)


def test_every_checkpoint_of_bistatic_scattering():
    sand = Sediment.of("medium sand")
    for inputs, expected in checkpoints("bistatic sigma"):
        angles = np.radians([inputs[name] for name in ("ti", "ts", "phi")])
        surface = sand.rough_strength(*angles, wavenumber(inputs["f_Hz"] / 1e3))
        assert decibels(surface) == pytest.approx(expected["SSA_dB"], abs=1e-5)
        assert decibels(sand.volume_strength(*angles[:2])) == pytest.approx(expected["vol_dB"], abs=1e-9)


def test_every_checkpoint_of_reflection():
    for inputs, expected in checkpoints("Rayleigh reflection"):
        found = sediment_of(inputs).reflection(np.radians(inputs["grazing_deg"]))
        assert found == pytest.approx(expected["R_re"] + 1j * expected["R_im"], abs=1e-12)
        assert -20 * np.log10(abs(found)) == pytest.approx(expected["loss_dB"], abs=1e-9)


def test_every_checkpoint_of_the_integral():
    for inputs, expected in checkpoints("I(q,alpha)"):
        if inputs["alpha"] < 1:  # γ = 4 is no roughness this law takes
            assert lobe_integral(inputs["q"], inputs["alpha"]) == pytest.approx(expected, rel=1e-6)


def test_every_checkpoint_of_energy():
    for inputs, expected in checkpoints("energy check"):
        found = scattered_share(sediment_of(inputs), np.radians(inputs["ti_deg"]), inputs["f_Hz"] / 1e3)
        assert found == pytest.approx(expected["albedo"], rel=0.001)


# ---------------------------------------------------------------------------------------------- the integral

def test_integral_in_closed_form():
    q = np.logspace(-9, 9, 400)
    np.testing.assert_allclose(lobe_integral(q, 0.5), q / (1 + q * q) ** 1.5, rtol=1e-6)


@pytest.mark.parametrize("alpha, q", [(0.3, 3.0), (0.45, 1.0), (0.625, 0.3), (0.625, 3.0), (0.8, 0.2), (0.95, 1.0)])
def test_integral_by_direct_quadrature(alpha, q):
    end = (40 / q) ** (1 / (2 * alpha))  # where the integrand has fallen to exp(-40)
    edges = np.append(np.arange(0, end, 20.0), end)
    parts = [quad(lambda u: j0(u) * np.exp(-q * u ** (2 * alpha)) * u, *ends, epsabs=1e-13)[0]
             for ends in zip(edges[:-1], edges[1:])]
    assert lobe_integral(q, alpha) == pytest.approx(sum(parts), rel=2e-6)


@pytest.mark.parametrize("alpha", [0.2, 0.4, 0.625, 0.9, 0.95])
def test_integral_reaches_its_limits_and_is_smooth(alpha):
    few, many = 1e-10, 1e12
    limit = few * alpha * 2 ** (1 + 2 * alpha) * gamma(1 + alpha) / gamma(1 - alpha)
    assert lobe_integral(few, alpha) == pytest.approx(limit, rel=1e-6)
    assert lobe_integral(many, alpha) == pytest.approx(many ** (-1 / alpha) * gamma(1 / alpha) / (2 * alpha), rel=1e-6)
    step = 1e-2
    slope = np.gradient(np.log(lobe_integral(np.exp(np.arange(-30, 30, step)), alpha)), step)
    assert np.abs(np.diff(slope)).max() < 3 * step     # curvature stays of order 1: no kink, at the ends neither


# ---------------------------------------------------------------------------------------------- what must hold

@pytest.mark.parametrize("sediment", SEDIMENTS)
def test_reciprocal_finite_and_positive(sediment):
    rng = np.random.default_rng(5)
    i, s = rng.uniform(0.001, np.pi / 2, (2, 200))
    azimuth = rng.uniform(0, 2 * np.pi, 200)
    there = bistatic_strength_db("sediment", i, s, azimuth, 5e3, sediment=sediment)
    back = bistatic_strength_db("sediment", s, i, -azimuth, 5e3, sediment=sediment)
    assert np.isfinite(there).all()
    np.testing.assert_allclose(there, back, rtol=0, atol=1e-9)


def scattered_share(sediment, grazing, khz):
    """Return ∫ σ dΩ / sin θ_i of the surface, over the shift of the transverse wavenumber about the specular one.

    Polar about it, ln r = ln r_end - v² with r_end at the horizon: dense towards r = 0, where the lobe peaks, and
    smooth at the horizon, where σ / sin θ_s has a square root. Midpoint rule in v and the direction.
    """
    v = (np.arange(400) + 0.5) * np.sqrt(20) / 400
    v, turn = np.meshgrid(v, (np.arange(120) + 0.5) * np.pi / 120, indexing="ij")
    centre = np.cos(grazing)
    r = (np.sqrt(1 - (centre * np.sin(turn)) ** 2) - centre * np.cos(turn)) * np.exp(-v * v)
    x, y = centre + r * np.cos(turn), r * np.sin(turn)
    cosine = np.hypot(x, y)
    sigma = sediment.rough_strength(grazing, np.arccos(cosine), np.arctan2(y, x), wavenumber(khz))
    cell = 2 * np.sqrt(20) / 400 * np.pi / 120     # twice: the half planes y > 0 and y < 0 are alike
    return (sigma * 2 * v * r**2 / np.sqrt(1 - cosine**2)).sum() * cell / np.sin(grazing)


@pytest.mark.parametrize("sediment, khz, degrees, expected", [
    ("medium sand", 30, 45, 0.22971), ("medium sand", 100, 60, 0.16163), ("medium sand", 30, 90, 0.13626),
    ("fine sand", 30, 30, 0.22443), ("coarse sand", 30, 60, 0.27122)])
def test_energy_is_that_of_the_reflection(sediment, khz, degrees, expected):
    seabed, angle = Sediment.of(sediment), np.radians(degrees)
    share = scattered_share(seabed, angle, khz)
    assert share == pytest.approx(expected, rel=0.001)
    assert abs(decibels(share / abs(seabed.reflection(angle)) ** 2)) < 0.2


def test_energy_lost_below_the_critical_angle():
    sand, angle = Sediment.of("medium sand"), np.radians(30)
    lost = [decibels(scattered_share(sand, angle, khz) / abs(sand.reflection(angle)) ** 2) for khz in (30, 100, 300)]
    assert all(-2.4 < loss < -0.8 for loss in lost)


@pytest.mark.parametrize("sediment", ["sandy gravel", "medium sand", "silt"])
def test_smooth_in_angle_and_azimuth_through_specular(sediment):
    """Central slopes at two steps agree to their h² error: no kink at the ends of the table, nadir or specular."""
    def level(angle):
        return bistatic_strength_db("sediment", angle, np.radians(50), 0.3, 30e3, sediment=sediment)

    angle = np.radians(np.linspace(1, 89, 500))
    coarse, fine = [(level(angle + h) - level(angle - h)) / (2 * h) for h in (1e-4, 5e-5)]
    assert np.abs(coarse - fine).max() < 1e-4 * np.abs(fine).max()
    steps = np.radians(np.linspace(-2e-3, 2e-3, 81))
    near = bistatic_strength_db("sediment", 0.8, 0.8, steps, 30e3, sediment=sediment)
    assert np.isfinite(near).all()
    assert near.max() - near[40] < 1e-9 and np.ptp(near) < 1e-3     # a flat top, no pole and no gap


def test_perturbation_limit():
    """Far from specular and nearly smooth: σ = k⁴/4 |1 + R_i|² |1 + R_s|² |G|² w2 ΔK^-γ, monostatic form of TR 9407."""
    sand = Sediment.of("medium sand", w2=1e-9, volume_parameter=0.0)
    angle, k = np.radians(30), wavenumber(30)
    rho, kappa = sand.density_ratio, (1 + 1j * sand.loss) / sand.sound_speed_ratio
    down = np.sqrt(kappa**2 - np.cos(angle) ** 2)
    shape = ((rho - 1) ** 2 * np.cos(angle) ** 2 + rho**2 - kappa**2) / (rho * np.sin(angle) + down) ** 2
    spectrum = sand.w2 * (2 * k * np.cos(angle)) ** -sand.gamma
    expected = 4 * k**4 * np.sin(angle) ** 4 * abs(shape) ** 2 * spectrum
    assert sand.rough_strength(angle, angle, np.pi, k) == pytest.approx(expected, rel=1e-5)


def test_grazing_and_shapes():
    assert backscatter_strength_db("sediment", [], [], sediment="sand").shape == (0,)
    found = backscatter_strength_db("sediment", [[0.0], [0.3]], [30e3, 60e3, 90e3], sediment="Fine_sand")
    assert found.shape == (2, 3)
    assert np.isneginf(found[0]).all() and np.isfinite(found[1]).all()


# ---------------------------------------------------------------------------------------------- parameters, refusals

def test_sediments_are_those_of_the_roughness_table():
    assert len({(s.density_ratio, s.sound_speed_ratio, s.loss, s.w2) for s in SEDIMENTS.values()}) == 23
    for name, sediment in SEDIMENTS.items():
        assert (sediment.w2, sediment.gamma) == (RoughnessSpectrum.of_sediment(name).w2, 3.25)


def test_free_parameters_are_those_of_a_named_sediment():
    free = dict(density_ratio=1.845, sound_speed_ratio=1.1782, loss=0.01624, volume_parameter=0.002, w2=1.405949e-4)
    found = backscatter_strength_db("sediment", 0.5, 30e3, **free)
    assert found == pytest.approx(backscatter_strength_db("sediment", 0.5, 30e3, sediment="sand"), abs=1e-4)
    louder = backscatter_strength_db("sediment", 0.5, 30e3, sediment="sand", volume_parameter=0.02)
    assert louder > found + 3


def test_lambert_in_decibels():
    angles = np.radians([10, 30, 60])
    np.testing.assert_allclose(backscatter_strength_db("lambert", angles, 1e5, mu_db=-27),
                               [-42.20660, -33.02060, -28.24939], rtol=0, atol=5e-6)
    both = bistatic_strength_db(LambertSeabed(mu_db=-27), 0.2, 0.9, [0.0, 3.0], 1e5)
    np.testing.assert_allclose(both, -27 + decibels(np.sin(0.2) * np.sin(0.9)), rtol=1e-12)


@pytest.mark.parametrize("arguments, parameters, words", [
    (("sediment", 0.5, 30e3), dict(sediment="rough rock"), "rough rock at 30 kHz is too rough"),
    (("sediment", 0.5, 400e3), dict(sediment="cobble"), "cobble at 400 kHz is not a fluid"),
    (("sediment", 0.5, [20e3, 100e3]), dict(sediment="cobble"), "cobble at 100 kHz is not a fluid"),
    (("sediment", 0.5, 120e3), dict(sediment="rock"), "rock at 120 kHz is not a fluid"),
    (("sediment", 0.5, 30e3), dict(sediment="porridge"), 'no sediment is called "porridge"'),
    (("sediment", 0.5, 30e3), dict(sediment="sand", loss=0.0), "sand: loss is 0.0"),
    (("sediment", 0.5, 30e3), dict(sediment="sand", mu_db=-27), "sediment has no parameter mu_db"),
    (("sediment", 0.5, 30e3), dict(w2=1e-4), "sediment is given too little"),
    (("lambert", 0.5, 30e3), dict(mu_db=-3), "mu_db is -3"),
    (("lamberd", 0.5, 30e3), {}, 'no law of scattering is called "lamberd"'),
    ((3, 0.5, 30e3), {}, "the law is 3; give a law's name, one of lambert, sediment,"),
    ((LambertSeabed(mu_db=-27), 0.5, 30e3), dict(mu_db=-20), "mu_db must not be given besides"),
    (("lambert", 30, 30e3), dict(mu_db=-27), "grazing angle is 30 rad"),
    (("lambert", 0.5, -1), dict(mu_db=-27), "frequency is -1 Hz"),
])
def test_refusals_say_why(arguments, parameters, words):
    with pytest.raises(ValueError, match=words):
        backscatter_strength_db(*arguments, **parameters)
