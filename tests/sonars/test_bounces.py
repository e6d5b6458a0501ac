"""Echoes of two bounces in a sidescan, told apart by path, against brute force.

A flat Lambert bed meets a Lambert wall that faces the sonar; one sound speed. Both orders of both bounces together,
with one-way intensity patterns B_t, B_r of equal faces (omnidirectional in elevation), R distances to the sonar and D
between the two points:

    p² = 10^(SL/10) Σ_bed Σ_wall 2 B(u_b) B(u_w) (μ sin sin)(μ' sin sin) / (R_b² D² R_w²) 10^(-α (R_b + D + R_w)/10)

in gates of (R_b + D + R_w)/2. The sum is drawn evenly over both faces (standard error of gates below 0.1 dB), the
record over 40 pings (its own spread says its error); 4 joint standard errors are asked for, each below 7 % (0.3
dB). Gates begin behind the corner where both meet: the integrand has no variance there.
"""
import mitsuba as mi
import numpy as np
import pytest

import mitsonar
from mitsonar.io.records import exr
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, lambert, sidescan

ALPHA = 0.030
GATES = np.arange(52, 72, 4)


def scene(max_depth, *, pings=40, **more):
    T = mi.ScalarTransform4f
    wall = {"type": "rectangle", "bsdf": lambert(-8.0),
            "to_world": T().translate([35, 0, -32.5]).rotate([0, 1, 0], -90).scale([7.5, 200, 1])}
    return sidescan({"seabed": bed(40.0, lambert(-10.0)), "wall": wall}, rays=400_000,
                    sensor={"vertical_beam_width_deg": 180.0, "beam_width_deg": 20.0, "pings": pings, **more},
                    film={"bins": 100, "range": 80.0}, integrator={"max_depth": max_depth})


def brute_force(sonar):
    """Intensity [µPa²] summed over four bins each from GATES on, and its standard error."""
    random, source, runs = np.random.default_rng(0), np.array([[0.0], [0.0], [-20.0]]), []
    for _ in range(12):
        n = 500_000
        bed = np.stack([random.uniform(0, 35, n), random.uniform(-150, 150, n), np.full(n, -40.0)]) - source
        wall = np.stack([np.full(n, 35.0), random.uniform(-150, 150, n), random.uniform(-40, -25, n)]) - source
        across = wall - bed
        b, w, d = (np.linalg.norm(v, axis=0) for v in (bed, wall, across))
        sines = (20 / b) * (across[2] / d) * (across[0] / d) * (wall[0] / w)
        waves = sonar.transmit.length / sonar.wavelength
        beam = np.sinc(waves * bed[1] / b) ** 2 * np.sinc(waves * wall[1] / w) ** 2
        power = 2 * beam * 10 ** -1.8 * sines / (b * d * w) ** 2 * (35 * 300) * (300 * 15) / n
        power *= 10 ** (-0.1 * ALPHA * (b + d + w))
        runs.append(np.histogram((b + d + w) / 2, 0.8 * np.arange(101), weights=power)[0])
    runs = np.array(runs) * 10 ** (sonar.source_level_db / 10) * sonar.resolution / 0.8
    gates = np.stack([runs[:, g:g + 4].sum(1) for g in GATES])
    return gates.mean(1), gates.std(1, ddof=1) / np.sqrt(runs.shape[0])


def test_two_bounces_against_brute_force(variant):
    made = scene(2)
    dataset = mitsonar.render(made)
    assert list(dataset["path_name"].values) == ["b", "bb"]
    expected, error = brute_force(sonar_at(made.sensors()[0], 20.0))
    power = 10 ** (dataset["path_level"].sel(path_name="bb", side="starboard").values.astype(float) / 10)
    gates = np.stack([power[:, g:g + 4].sum(1) for g in GATES])
    spread = gates.std(1, ddof=1) / np.sqrt(gates.shape[1])
    joint = np.hypot(spread, error)
    assert (joint / expected < 0.07).all()
    assert (np.abs(gates.mean(1) - expected) < 4 * joint).all()
    # on the other side there is no wall, and a flat bed does not light itself
    assert dataset["path_level"].sel(path_name="bb", side="port").max() == -200


def test_paths_add_up_and_leave_the_direct_echo_alone(variant, tmp_path):
    one, two = mitsonar.render(scene(1, pings=2)), mitsonar.render(scene(2, pings=2))
    direct = two["path_level"].sel(path_name="b", drop=True)
    heard = one["mean_level"].values > -150
    np.testing.assert_allclose(direct.values[heard], one["mean_level"].values[heard], atol=1e-3)
    total = 10 * np.log10((10 ** (two["path_level"].astype(float) / 10)).sum("path_name"))
    np.testing.assert_allclose(total.values[heard], two["mean_level"].values[heard], atol=1e-3)
    strongest = two["path_level"].argmax("path_name").values + 1
    assert (two["path"].values[heard] == strongest[heard]).mean() > 0.99          # the pulse blurs borders
    exr.write(two, tmp_path / "two.exr")
    again = exr.read(tmp_path / "two.exr")
    np.testing.assert_array_equal(again["path_level"].values, two["path_level"].values)


@pytest.mark.parametrize("threads", [2, 5])
def test_ghosts_do_not_depend_on_threads_or_blocks(variant, monkeypatch, threads):
    import drjit as dr
    whole = mitsonar.render(scene(2, pings=3), 7)["path_level"].values
    before = dr.thread_count()
    monkeypatch.setattr("mitsonar.survey.energy.sides.RAYS_PER_BLOCK", 1)
    try:
        dr.set_thread_count(threads)
        parts = mitsonar.render(scene(2, pings=3), 7)["path_level"].values
    finally:
        dr.set_thread_count(before)
    np.testing.assert_array_equal(parts, whole)


def test_paths_count_in_the_memory_that_a_record_takes(variant, monkeypatch):
    made = scene(2, pings=4)
    monkeypatch.setattr("mitsonar.survey.limits.memory", lambda: (90 + 13 * 2) * 4 * 2 * 100 + 1)
    with pytest.raises(ValueError, match="4 pings with 2 x 100 bins and 2 paths takes .* fewer pings, bins or bounces"):
        made.integrator().survey(made, made.sensors()[0])
    made = scene(1, pings=4)
    made.integrator().survey(made, made.sensors()[0])
