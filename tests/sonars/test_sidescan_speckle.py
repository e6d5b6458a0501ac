"""Speckle of a sidescan stays with the ground: pings share as much of it as their apertures overlap.

Two faces of length L send and receive. Two points of them that are d apart, with their phase centre at x, send to and
hear from a scatterer at the range R and along-track distance s over the way 2R + (s - x)²/R + d²/4R. So the two-way
aperture is

    a(x) = ∫ exp(ik d²/4R) dd,    |d| <= L - 2|x|                     far from the sonar a triangle

and for phase centres Δ apart and a yaw of δ, amplitudes correlate by

    ρ = ∫ a(x) a*(x - Δ) exp(2ik δ x) dx / ∫ |a|² dx,                 intensities by |ρ|²

Some 1e4 independent cells a case: standard error 0.01. Scatterers that leave the gate between pings, as the beam is
wide, cost up to 0.02 more.
"""
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from track_files import write_track

from mitsonar.imaging.sidescan import realisation
from mitsonar.scene.loading import prepare
from mitsonar.signal.gates import pulse_shares
from mitsonar.survey.sidescan.kind import plan
from mitsonar.survey.sidescan.speckle import SideSpeckle
from mitsonar.units import metres_per_second_from_knots
from mitsonar.validation.scenes import bed, sidescan

RATE = 4.0
BED = {"bed": bed(40.0, size=2000.0)}


def speckle_of(seed=1, pings=40, film=None, **sensor):
    """The speckle of some pings: complex (ping, side, gate), and the plan of the run."""
    film = {"range": 75.0, "bins": 1000, **(film or {})}
    scene = sidescan(BED, rays=100, sensor={"pings": pings, **sensor}, film=film)
    survey = plan(scene, scene.sensors()[0], replace(scene.integrator().settings, seed=seed))
    return SideSpeckle(survey).of(np.arange(survey.track.pings))[..., 0], survey


def overlap(sonar, apart, yaw=0.0, ranges=(1e6,)):
    """|ρ|² of the aperture, the mean over ranges [m]."""
    length, wavenumber = sonar.transmit.length, 2 * np.pi / sonar.wavelength
    x = np.linspace(-length, length, 4001)
    d = np.linspace(-length, length, 2001)
    moved, found = round(apart / (x[1] - x[0])), []
    for away in ranges:
        inner = np.append(0, np.cumsum(np.exp(0.25j * wavenumber * (d[1:] + d[:-1]) ** 2 / 4 / away) * (d[1] - d[0])))
        reach = np.maximum(length - 2 * np.abs(x), 0)
        aperture = np.interp(reach, d, inner) - np.interp(-reach, d, inner)
        other = np.concatenate([np.zeros(moved), aperture[:len(x) - moved]])
        turned = aperture * other.conj() * np.exp(2j * wavenumber * np.sin(yaw) * x)
        found.append(abs(turned.sum() / (np.abs(aperture) ** 2).sum()) ** 2)
    return float(np.mean(found))


def between(speckle, low, high, farthest=75.0):
    """The gates between two slant ranges [m]."""
    gates = speckle.shape[-1]
    return speckle[:, :, round(low / farthest * gates):round(high / farthest * gates)]


def stepping(step, rate=RATE):
    """Attributes of a sonar that makes steps [m] from ping to ping."""
    return {"speed_knots": step * rate / metres_per_second_from_knots(1.0), "ping_rate_hz": rate}


def correlation(one, other):
    """Of intensities, whose mean is 1 and whose variance is 1."""
    return float(np.mean((np.abs(one) ** 2 - 1) * (np.abs(other) ** 2 - 1)))


@pytest.fixture(scope="module", autouse=True)
def ready():
    prepare()


@pytest.mark.parametrize("step", [0.05, 0.1, 0.25])
@pytest.mark.parametrize("preset", ["towed_100khz", "towed_400khz"])
def test_pings_correlate_as_the_two_way_aperture_overlaps(preset, step):
    speckle, survey = speckle_of(pings=120, preset=preset, **stepping(step))
    far = between(speckle, 37.5, 75.0)
    for lag in (1, 2):
        expected = overlap(survey.sonar, lag * step, ranges=np.linspace(37.5, 75, 9))
        assert correlation(far[lag:], far[:-lag]) == pytest.approx(expected, abs=0.05)


@pytest.mark.parametrize("preset, step, published", [("towed_100khz", 0.25, 0.32), ("towed_400khz", 0.1, 0.63)])
def test_far_away_the_correlation_is_the_far_fields(preset, step, published):
    """The squared Fourier transform of the two-way power pattern: 0.32 and 0.63."""
    speckle, survey = speckle_of(pings=60, preset=preset, film={"range": 300.0, "bins": 2000}, **stepping(step, 2.0))
    far = between(speckle, 150.0, 300.0, 300.0)
    assert overlap(survey.sonar, step) == pytest.approx(published, abs=0.01)
    assert correlation(far[1:], far[:-1]) == pytest.approx(published, abs=0.03)


def test_far_away_shaded_faces_correlate_by_their_pattern():
    """|∫ b⁴ exp(2ikΔu) du|² / |∫ b⁴ du|²: a shaded face is longer for its beam, but its ends count for less."""
    step = 0.1
    speckle, survey = speckle_of(pings=60, preset="towed_400khz", shading="hann", sidelobe_db=-200.0,
                                 film={"range": 300.0, "bins": 2000}, **stepping(step, 2.0))
    sonar, u = survey.sonar, np.linspace(-0.05, 0.05, 20001)
    power = sonar.along_intensity(u)
    expected = abs((power * np.exp(4j * np.pi / sonar.wavelength * step * u)).sum() / power.sum()) ** 2
    far = between(speckle, 150.0, 300.0, 300.0)
    assert correlation(far[1:], far[:-1]) == pytest.approx(expected, abs=0.03)


def test_near_the_sonar_faces_that_do_not_focus_share_less():
    speckle, survey = speckle_of(pings=400, preset="towed_400khz", **stepping(0.1))
    near = between(speckle, 10.5, 14.3)                          # L²/λ is 60 m
    expected = overlap(survey.sonar, 0.1, ranges=np.linspace(10.5, 14.3, 9))
    assert expected < 0.45
    assert correlation(near[1:], near[:-1]) == pytest.approx(expected, abs=0.06)


@pytest.mark.parametrize("yaw_deg", [0.05, 0.15])
def test_yaw_turns_the_aperture(tmp_path, yaw_deg):
    """A sonar that only turns."""
    time = np.arange(60) / RATE
    rows = np.zeros((60, 7))
    rows[:, 0], rows[:, 2], rows[:, 3], rows[:, 6] = time, 1e-6 * time, -20, yaw_deg * np.arange(60)
    speckle, survey = speckle_of(preset="towed_400khz", track=write_track(tmp_path / "track.csv", rows),
                                 ping_rate_hz=RATE, pings=60)
    far = between(speckle, 37.5, 75.0)
    expected = overlap(survey.sonar, 0.0, np.deg2rad(yaw_deg), np.linspace(37.5, 75, 9))
    assert correlation(far[1:], far[:-1]) == pytest.approx(expected, abs=0.06)


def test_a_sonar_that_rests_hears_the_same_again():
    speckle, _ = speckle_of(pings=3, speed_knots=0.0)
    assert np.array_equal(speckle[0], speckle[2])


def test_the_same_line_again_brings_the_same_speckle():
    """Another run that begins 10 pings earlier, and one the opposite way, with the sides exchanged."""
    step = {"preset": "towed_100khz", **stepping(0.25)}
    first, _ = speckle_of(start=[5.0, 10.0, -20.0], heading_deg=30.0, **step)
    ahead = 0.25 * np.array([np.sin(np.deg2rad(30.0)), np.cos(np.deg2rad(30.0))])
    earlier, _ = speckle_of(start=[*(np.array([5.0, 10.0]) - 10 * ahead), -20.0], heading_deg=30.0, **step)
    assert correlation(first[:30], earlier[10:]) > 0.9
    # 39 pings and the way within a ping further on, and back
    back, survey = speckle_of(start=[*(np.array([5.0, 10.0]) + 39 * ahead), -20.0], heading_deg=210.0, **step)
    assert correlation(first, back[::-1, ::-1]) > 0.75          # phase centres, under way, are 7 cm apart or less
    other_seed, _ = speckle_of(seed=2, start=[5.0, 10.0, -20.0], heading_deg=30.0, **step)
    assert abs(correlation(first, other_seed)) < 0.03


def test_heave_moves_the_ground_through_the_record():
    """0.2 m higher, ground 20 m below at the slant range r is 0.2 · 20/r further away: 11 gates of 5 mm at 71.5 m."""
    film = {"bins": 7500}
    low, _ = speckle_of(pings=1, start=[0.0, 0.0, -20.0], film=film)
    high, _ = speckle_of(pings=1, start=[0.0, 0.0, -19.8], film=film)
    part = slice(14000, 14600)                                   # half bins of 5 mm: 70 to 73 m
    found = [correlation(high[:, :, part.start + lag:part.stop + lag], low[:, :, part]) for lag in range(25)]
    assert int(np.argmax(found)) == pytest.approx(0.2 * 19.9 / 71.5 / 0.005, abs=2)
    assert max(found) > 0.5


@pytest.mark.parametrize("shift", [0.005, 0.02])
def test_pulses_of_several_gates_keep_the_ground_that_heave_moves_by_parts_of_a_gate(shift):
    """Bins of 2.5 cm, pulses of 7.5 cm: moved by s in slant range they share 1 - s/7.5 cm of the ground, squared.

    Heave s · r/20 moves ground at r by s; from 58 to 70 m it is shifted by 10 % less to more.
    """
    bins, levels = 3000, []
    for height in (-20.0, -20.0 + shift * 64 / 20):
        speckle, survey = speckle_of(pings=1, seed=5, start=[0.0, 0.0, height], heading_deg=37.0, film={"bins": bins})
        shares = pulse_shares(survey.bin_length, survey.sonar.pulse_length)
        level = realisation(np.ones((1, 2, bins)), shares, speckle, 0.0, np.random.default_rng(0))
        levels.append(level[..., 58 * bins // 75:70 * bins // 75].ravel())
    expected = (1 - shift / survey.sonar.resolution) ** 2
    assert np.corrcoef(*levels)[0, 1] == pytest.approx(expected, abs=0.12)       # some 320 cells: 0.06 by chance


def test_speckle_has_unit_variance_whatever_the_course():
    """24 courses, 8000 gates each; variance of the mean of intensities: 1/8000 where gates are independent."""
    for heading in np.arange(0, 360, 15.0):
        speckle, _ = speckle_of(pings=2, heading_deg=heading, yaw_deg=3.0, pitch_deg=5.0, speed_knots=100.0)
        assert np.mean(np.abs(speckle) ** 2) == pytest.approx(1, abs=0.06)
        assert correlation(speckle[0, 0], speckle[0, 1]) == pytest.approx(0, abs=0.12)


def test_triangles_of_every_size_are_added_by_one_kernel():
    """Facets are met whole, as quarters, and as quarters of these; each round adds what need be cut no further."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        speckle_of(pings=4)
        added = [kernel["hash"] for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT
                 and "scatterers of a triangle" in kernel["ir"].getvalue()]
    assert len(added) > 2 and len(set(added)) == 1


def test_pings_may_be_asked_for_in_any_order():
    scene = sidescan(BED, rays=100, sensor={"pings": 9, "speed_knots": 4.0})
    survey = plan(scene, scene.sensors()[0], scene.integrator().settings)
    source = SideSpeckle(survey)
    together = source.of(np.arange(9))
    assert np.array_equal(source.of(np.array([7, 2])), together[[7, 2]])


@pytest.mark.parametrize("steps", [2, 4])
def test_gates_that_begin_later_share_ground_with_two_gates(steps):
    """A gate that begins s of a gate later shares 1 - s of its scatterers with one gate and s with the next.

    These are the correlations of amplitudes, and their squares those of intensities. Some 7 scatterers a gate are
    scattered unevenly over it, which adds their variance, 0.04 at most; 20,000 gates leave 0.01 by chance.
    """
    scene = sidescan(BED, rays=100, sensor={"pings": 12, "speed_knots": 40.0}, film={"range": 75.0, "bins": 1000})
    survey = plan(scene, scene.sensors()[0], replace(scene.integrator().settings, seed=3))
    source, ping = SideSpeckle(survey), np.arange(12)
    fine = source.of(ping, steps)
    assert np.array_equal(fine[..., 0], source.of(ping)[..., 0])
    bed = np.stack([between(one, 30.0, 74.0) for one in np.moveaxis(fine, -1, 0)])
    assert np.mean(np.abs(bed) ** 2) == pytest.approx(1, abs=0.03)
    for step in range(1, steps):
        share = step / steps
        assert correlation(bed[step], bed[0]) == pytest.approx((1 - share) ** 2, abs=0.05)
        assert correlation(bed[step][..., :-1], bed[0][..., 1:]) == pytest.approx(share ** 2, abs=0.05)


def test_echoes_of_the_water_column_have_speckle_too():
    """Above the first bottom return scatterers are those of the water, which move no more than the bed's do."""
    speckle, survey = speckle_of(pings=200, preset="towed_100khz", **stepping(0.25))
    water = between(speckle, 5.0, 18.0)
    expected = overlap(survey.sonar, 0.25, ranges=np.linspace(5, 18, 19))
    assert correlation(water[1:], water[:-1]) == pytest.approx(expected, abs=0.05)
