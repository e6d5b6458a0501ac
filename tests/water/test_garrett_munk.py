"""Internal waves of the deep sea against their spectrum (Munk 1981).

Closed forms: <η²> = E b² N_0 / 2N, averaged over depth in units of the modes; shares of waves above a frequency, of the
integral of √(ω² - f²)/ω³, in closed form arccos(f/ω)/2f - √(ω² - f²)/2ω²; shares of modes; dispersion; derivatives by
differences.
"""
import numpy as np
import pytest

from mitsonar.water.garrett_munk import BANDWIDTH, BUOYANCY, ENERGY, SCALE, GarrettMunk

LATITUDE = np.radians(30.0)
INERTIAL = 7.292e-5                # 2 Ω sin 30°


def test_the_variance_is_that_of_the_spectrum():
    """Over 400 seas of 32 waves, at even places between the ends of the modes; deviation of such a mean 2 %."""
    share = (np.arange(40) + 0.5) / 40
    depth = -SCALE * np.log(1 - share)
    squares = np.zeros(40)
    for seed in range(400):
        value = GarrettMunk.of(latitude=LATITUDE, seed=seed).displacement(np.zeros(40), np.zeros(40), depth)[0]
        squares += value**2 / 400
    wanted = 0.5 * ENERGY * SCALE**2 * np.exp(depth / SCALE)
    assert np.mean(squares / wanted) == pytest.approx(1, abs=0.06)
    assert 0.5 * ENERGY * SCALE**2 == pytest.approx(53, abs=0.5)                      # Munk's 7.3 m


def test_frequencies_modes_and_wavenumbers_are_those_of_the_model():
    made = GarrettMunk.of(latitude=LATITUDE, waves=4000)
    rate, mode = np.array(made.rates), np.array([wave[3] for wave in made.waves]) / np.pi
    k = np.hypot(*np.array([wave[:2] for wave in made.waves]).T)
    np.testing.assert_allclose(k, np.pi * mode * np.sqrt(rate**2 - INERTIAL**2) / (SCALE * BUOYANCY), rtol=1e-9)

    def above(omega):
        return np.arccos(INERTIAL / omega) / (2 * INERTIAL) - np.sqrt(omega**2 - INERTIAL**2) / (2 * omega**2)

    for factor in (1.5, 3.0, 10.0):
        wanted = (above(BUOYANCY) - above(factor * INERTIAL)) / (above(BUOYANCY) - above(INERTIAL))
        assert np.mean(rate > factor * INERTIAL) == pytest.approx(wanted, abs=0.002)
    by_mode = 1 / (np.arange(1, 101) ** 2 + BANDWIDTH**2)
    assert np.mean(mode <= 3) == pytest.approx(by_mode[:3].sum() / by_mode.sum(), abs=0.002)


def test_the_surface_stays_and_waves_move():
    made = GarrettMunk.of(latitude=LATITUDE)
    x = np.linspace(0, 5e3, 50)
    assert not np.any(made.displacement(x, 0 * x, 0 * x)[0])
    later = made.at(3600.0, 0.0)
    assert made.moves and not later.moves
    first, second = (one.displacement(x, 0 * x, 0 * x + 300.0)[0] for one in (made.at(0.0, 0.0), later))
    assert np.max(abs(second - first)) > 0.3
    np.testing.assert_allclose(made.at(0.0, 0.0).displacement(x, 0 * x, 0 * x + 300.0)[0], first)


def test_derivatives_are_those_of_the_change(rng):
    made = GarrettMunk.of(latitude=LATITUDE, level=2.0, seed=3)
    x, y, z = rng.uniform(0, 2000, 40), rng.uniform(0, 2000, 40), rng.uniform(50, 900, 40)

    def profile(depth):
        return 1500 - 8 * np.tanh((depth - 300) / 200), -8 / 200 / np.cosh((depth - 300) / 200) ** 2

    change = made.change(x, y, z, profile)
    for slope, step in ((change.east, (1, 0, 0)), (change.north, (0, 1, 0)), (change.down, (0, 0, 1))):
        ends = [made.change(*(place + sign * 1e-2 * one for place, one in zip((x, y, z), step)), profile).value
                for sign in (1, -1)]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / 2e-2, atol=1e-8)


def test_a_deep_sounding_sees_the_waves(variant):
    """The phase of a target 900 m away differs from that in still water: by hundredths of a turn in gentle waves."""
    import mitsonar
    from mitsonar.validation.scenes import array_sonar, buried_bed, point_target

    where = np.array([300.0, 500.0, -700.0])
    profile = "0:1520, 100:1518, 300:1500, 900:1485"

    def heard(**field):
        signal = mitsonar.impulse_response(array_sonar(
            {"bed": buried_bed(1500.0, size=6000.0), "ball": point_target(where)}, film={"range": 1000.0,
                                                                                         "range_min": 850.0},
            sensor={"frequency_khz": 12.0}, integrator={"cell": 60.0}, water={"profile": profile, **field}))
        return signal.values[0, 0, 0]

    still = heard()
    gentle, rough = (heard(field="garrett_munk", field_level=level, field_bending_ns=1e9) for level in (0.01, 1.0))
    assert 1e-3 < abs(np.angle(np.vdot(still, gentle))) < 0.5 * np.pi
    assert np.linalg.norm(gentle - rough) > 0.1 * np.linalg.norm(still)
