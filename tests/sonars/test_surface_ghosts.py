"""Ghosts by way of a flat sea surface, and echoes of more bounces, through the whole chain of an array.

A point target under a mirror, R = -1, sends back along four ways. With T, A, L of the eigenray straight there and of
that in water unfolded about the surface (`SoundSpeedProfile.mirrored`, an independent solver in NumPy), its response at
a frequency f off the carrier is

    H(f) = (c_h / c_0) Σ (-1)^m 10^(-α (L_out + L_back)/20) / √(A_out A_back) e^(-i 2π (f_0 + f)(T_out + T_back))

over (direct, direct), (direct, folded), (folded, direct), (folded, folded); the surface straight above adds half of
what a point there would. Tolerance: the kernel's -55 dB in band.
"""
import numpy as np
import pytest
from summer import SUMMER_TEXT

import mitsonar
from mitsonar.propagation import eigenray
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.units import KNOT
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, lambert, point_target

MIRROR = {"type": "sea_surface", "wind_speed": 0.0, "size": 400.0}
WHERE = np.array([4.0, 18.0, -15.0])


def legs(profile, source_depth, where):
    """(T, A, L) straight there, and by way of the surface."""
    x = float(np.hypot(*where[:2]))
    rays = eigenray(profile, source_depth, -where[2], x), eigenray(profile.mirrored(), -source_depth, -where[2], x)
    return [(float(ray.travel_time), float(ray.spreading_area), float(ray.arc_length)) for ray in rays]


@pytest.mark.parametrize("profile", ["0:1500", SUMMER_TEXT])
def test_a_target_under_a_mirror_is_heard_along_four_ways(variant, profile):
    scene = array_sonar({"bed": buried_bed(40.0), "sea": MIRROR, "ball": point_target(WHERE)}, film={"range": 45.0},
                        water={"profile": profile}, integrator={"max_depth": 3, "cell": 2.0, "rays": 64})
    response = mitsonar.impulse_response(scene)
    water = scene.sensors()[0].water.profile
    rate, carrier = response.attrs["sampling_rate"], response.attrs["frequency"]
    off = np.linspace(-rate / 4, rate / 4, 41)
    ways = legs(water, 10.0, WHERE)
    ratio = float(water.at(15.0) / water.at(10.0))
    expected = 0
    for i, (t, a, length) in enumerate(ways):
        for j, (t2, a2, length2) in enumerate(ways):
            expected = expected + (-1) ** (i + j) * ratio * 10 ** (-0.030 * (length + length2) / 20) / np.sqrt(
                a * a2) * np.exp(-2j * np.pi * (carrier + off) * (t + t2))
    up = eigenray(water, 10.0, 1e-4, 0.0)
    expected = expected - 0.5 / np.sqrt(up.spreading_area) * 10 ** (-0.030 * up.arc_length / 10) * np.exp(
        -4j * np.pi * (carrier + off) * up.travel_time)
    time = response["time"].values
    found = (response.values[0, 0, 0].astype(complex) * np.exp(-2j * np.pi * off[:, None] * time)).sum(-1)
    assert np.abs(found - expected).max() < 10 ** (-50 / 20) * np.abs(expected).max()


def test_ghosts_reach_the_elements_of_a_moving_array_when_they_should(variant):
    """Vector approximation against an eigenray for every ghost and element, for the image of the array too."""
    scene = array_sonar({"bed": buried_bed(40.0), "sea": MIRROR, "ball": point_target(WHERE)}, film={"range": 45.0},
                        water={"profile": SUMMER_TEXT}, integrator={"max_depth": 3, "cell": 2.0, "rays": 64},
                        sensor={"receive": "line", "receive_elements": 7, "receive_pitch": 0.1,
                                "receive_axis": "0.6, 0.5, 0.62", "transmit": "line", "transmit_elements": 2,
                                "transmit_pitch": 0.3,
                                "speed_knots": 3.0 / KNOT})
    exact, vector = (mitsonar.impulse_response(scene, return_path=path).values for path in ("eigenray", "vector"))
    assert np.abs(vector - exact).max() < 10 ** (-75 / 20) * np.abs(exact).max()


def test_without_depth_nothing_comes_by_way_of_the_surface(variant):
    shapes = {"bed": buried_bed(40.0), "ball": point_target(WHERE)}
    still = {"film": {"range": 45.0}, "integrator": {"cell": 2.0}}
    alone = mitsonar.impulse_response(array_sonar(shapes, **still))
    mirrored = mitsonar.impulse_response(array_sonar({**shapes, "sea": MIRROR}, **still))
    late = alone["time"].values > 0.02
    np.testing.assert_allclose(mirrored.values[..., late], alone.values[..., late], atol=1e-7)


def test_paths_can_be_heard_one_by_one(variant):
    scene = array_sonar({"bed": bed(20.0, size=200.0), "sea": MIRROR, "ball": point_target(WHERE)},
                        water={"profile": SUMMER_TEXT, "volume_strength_db": -60.0},
                        integrator={"max_depth": 2, "cell": 1.0, "rays": 500})
    whole = mitsonar.impulse_response(scene).values
    parts = {path: mitsonar.impulse_response(scene, paths=[path]).values for path in ("b", "s", "v", "bb", "sb")}
    assert np.abs(sum(parts.values()) - whole).max() < 1e-5 * np.abs(whole).max()
    assert all(part.any() for name, part in parts.items() if name != "bb")        # a flat bed does not light itself
    with pytest.raises(ValueError, match="'bsb' was asked for, but the scene has b, s, bb, bs, ss, v"):
        mitsonar.impulse_response(scene, paths=["bsb"])


def test_energy_of_two_bounces_between_bed_and_wall(variant):
    """Rays that find ghosts of an array against those of a sidescan's sums: see test_bounces for the sum itself.

    An omnidirectional element above a bed beside a wall, all Lambert. Brute force over both faces, u = w = uniform:
    e² = Σ_bed Σ_wall 2 (1/R_b²) μ sin sin (1/D²) μ' sin sin (1/R_w²), time (R_b + D + R_w)/c. The totals from 16 to 20
    and 24 m has a Monte-Carlo error of 2 % (0.1 dB) here, most of it from speckle-free ray energies.
    """
    import mitsuba as mi
    T = mi.ScalarTransform4f
    wall = {"type": "rectangle", "bsdf": {"type": "lambert", "mu_db": -8.0},
            "to_world": T().translate([12, 0, -15]).rotate([0, 1, 0], -90).scale([5, 40, 1])}
    scene = array_sonar({"bed": bed(20.0, lambert(-10.0), size=200.0), "wall": wall}, film={"range": 40.0},
                        integrator={"max_depth": 2, "cell": 3.0, "rays": 400_000})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    origin = survey.track.position[0]
    total = np.zeros(2)
    for key in range(4):
        for echoes in ensonification.echoes(origin, survey.track.rotation()[0], 10.0, key):
            if echoes.path == "bb":
                half = 0.75e3 * (echoes.arrival + echoes.back.travel_time).numpy()
                total += np.histogram(half, [16, 20, 24], weights=echoes.energy.numpy())[0] / 4
    random = np.random.default_rng(5)
    n = 4_000_000
    b = np.stack([random.uniform(-60, 12, n), random.uniform(-60, 60, n), np.full(n, -10.0)])
    w = np.stack([np.full(n, 12.0), random.uniform(-40, 40, n), random.uniform(-10, 0, n)])
    across = w - b
    r, s, d = (np.linalg.norm(v, axis=0) for v in (b, w, across))
    energy = 2 * 0.1 * (10 / r) * (across[2] / d) * 10 ** -0.8 * (across[0] / d) * (w[0] / s) / (r * d * s) ** 2
    energy *= (72 * 120) * (80 * 10) / n * 10 ** (-0.003 * (r + d + s))
    expected = np.histogram((r + d + s) / 2, [16, 20, 24], weights=energy)[0]
    assert np.abs(10 * np.log10(total / expected)).max() < 0.3


@pytest.mark.parametrize("fans", ["elements", "interpolated"])
def test_transmit_elements_share_what_is_drawn_by_chance(variant, fans):
    """Paths of more bounces and the water add over transmit elements as they do where all have one fan: exactly."""
    def signals(fans, path):
        sea = {"type": "sea_surface", "wind_speed": 8.0, "size": 200.0}
        scene = array_sonar({"bed": bed(20.0, size=200.0), "sea": sea},
                            film={"range": 25.0}, water={"volume_strength_db": -50.0},
                            sensor={"transmit": "line", "transmit_elements": 4, "transmit_pitch": 0.0075,
                                    "transmit_axis": "1, 0, 0"},
                            integrator={"max_depth": 2, "cell": 2.0, "rays": 2000, "fans": fans})
        return mitsonar.element_signals(scene, paths=[path]).values

    for path in ("bs", "v"):
        expected = signals("centre", path)
        assert np.abs(expected).max() > 0
        np.testing.assert_allclose(signals(fans, path), expected, atol=1e-5 * np.abs(expected).max())
