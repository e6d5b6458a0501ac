"""Scattering functions between their nodes, and as taps over the band of a pulse."""
import numpy as np
import pytest

from mitsonar.scattering import MATERIALS, ScatteringTable, SphereBody, SphereScattering
from mitsonar.scattering.bodies.echo_taps import EchoTaps, ReceivedBand

SPEED = 1500.0
AHEAD = np.array([[1.0, 0.0, 0.0]])


def fan(azimuth):
    """Directions of travel of sound that comes from azimuths."""
    return -np.stack([np.cos(azimuth), np.sin(azimuth), 0 * azimuth], -1)


def pair_of_points(frequency, towards):
    """f of points 0.3 m ahead and 0.2 m behind the origin: 0.05 e^(2ikd) and 0.02 e^(-2ikd')."""
    k = 2 * np.pi * frequency / SPEED
    along = towards[:, :1]
    return 0.05 * np.exp(0.6j * k * along) + 0.02 * np.exp(-0.4j * k * along)


def table(frequency, azimuth):
    """The pair's table."""
    return ScatteringTable(frequency=frequency, axes={"incident_azimuth": azimuth},
                           values=pair_of_points(frequency, -fan(azimuth)))


def test_a_moved_point_is_right_between_nodes_whose_phases_differ_by_cycles():
    """One point 2 m off the origin, nodes of 100 Hz and 2 degrees: 9 cycles from angle to angle at 100 kHz, abeam.

    Amplitude and delay are exact between frequencies; between angles the delay is linear, 2 (d / c) (1° in rad)² / 2
    off at most: 4e-7 s, 0.04 of a cycle.
    """
    frequency, azimuth = np.arange(80e3, 120e3, 100.0), np.radians(np.arange(-180, 180, 2.0))
    k = 2 * np.pi * frequency / SPEED
    one = ScatteringTable(frequency=frequency, axes={"incident_azimuth": azimuth},
                          values=0.1 * np.exp(4j * k * np.cos(azimuth)[:, None]))
    at, wanted = np.radians([0.0, 88.0, -179.0, 33.0, 179.3]), np.array([100.05e3, 90e3])
    got = one.form(wanted, fan(at), -fan(at), SPEED)
    expected = 0.1 * np.exp(8j * np.pi * wanted / SPEED * np.cos(at)[:, None])
    np.testing.assert_allclose(np.abs(got), 0.1, rtol=1e-6)
    assert np.max(np.abs(np.angle(got / expected))) < 2 * np.pi * 0.045
    np.testing.assert_allclose(got[:2], expected[:2], rtol=1e-6)       # at nodes of the angle


def test_without_angles_of_the_receiver_the_direction_half_way_counts():
    """A source at 10 and a receiver at 50 degrees see what both would see at 30."""
    frequency, azimuth = np.arange(80e3, 120e3, 300.0), np.radians(np.arange(-180, 180, 2.0))
    one, middle = table(frequency, azimuth), fan(np.radians([30.0]))
    got = one.form(frequency, fan(np.radians([10.0])), -fan(np.radians([50.0])), SPEED)
    np.testing.assert_allclose(got, one.form(frequency, middle, -middle, SPEED), rtol=1e-9)


def test_angles_of_source_and_receiver_are_told_apart():
    """f = 1 + azimuth of the source + 10 times the receiver's elevation, linear in both."""
    source, receiver = np.radians([0.0, 90.0]), np.radians([-30.0, 60.0])
    values = 1 + source[:, None] + 10 * receiver[None, :] + 0j
    one = ScatteringTable(frequency=np.array([1e5]), values=values[..., None],
                          axes={"incident_azimuth": source, "scattered_elevation": receiver})
    up = np.array([[np.cos(0.5), 0.0, np.sin(0.5)]])
    got = one.form(np.array([1e5]), fan(np.array([0.7])), up, SPEED)
    assert got[0, 0] == pytest.approx(1 + 0.7 + 5.0, rel=1e-9)
    beyond = one.form(np.array([2e5]), fan(np.array([-0.7])), AHEAD, SPEED)     # the nearest that there is
    assert beyond[0, 0] == pytest.approx(1.0 + 0.0, rel=1e-9)


def test_the_aspect_is_the_angle_off_the_axis():
    one = ScatteringTable(frequency=np.array([1e5]), axes={"aspect": np.radians([0.0, 180.0])},
                          values=np.array([[1.0], [2.0]]) + 0j)
    side = np.array([[0.0, 0.6, 0.8]])
    assert one.form(np.array([1e5]), side, -side, SPEED)[0, 0] == pytest.approx(1.5)


@pytest.mark.parametrize("body, radius, most", [("rigid", 0.1, 67), ("soft", 0.5, 60),
                                                ("tungsten_carbide", 0.01905, 600)])
def test_taps_over_the_band_are_the_sphere(body, radius, most):
    """Within 0.1 dB from the strongest down to 20 dB below, over 40 kHz; no more taps than the echo is long."""
    sphere = SphereScattering(radius=radius, body=SphereBody(inside=MATERIALS.get(body, body)))
    band = ReceivedBand(frequency=100e3, low=80e3, high=120e3, width=61.5e3)
    taps, frequency = EchoTaps.of(sphere, band, SPEED), np.linspace(80e3, 120e3, 2001)
    weight = taps.weights(AHEAD, -AHEAD)[0]
    got = np.exp(-2j * np.pi * frequency[:, None] * taps.delay) @ weight
    form = sphere.form(frequency, AHEAD, -AHEAD, SPEED)[0]
    strong = np.abs(form) > 0.1 * np.abs(form).max()
    assert np.max(np.abs(20 * np.log10(np.abs(got / form)[strong]))) < 0.1
    assert np.max(np.abs(got - form)) < 0.01 * np.abs(form).max()
    assert len(weight) <= most
    assert np.sum(taps.share) == pytest.approx(1)
    assert taps.strength == pytest.approx(np.mean(np.abs(form) ** 2), rel=0.02)


def test_the_first_tap_that_matters_is_the_front_of_the_sphere():
    """A soft sphere of 0.5 m: the front 2 a / c = 0.667 ms before the middle, within a tap."""
    sphere = SphereScattering(radius=0.5, body=SphereBody(inside="soft"))
    taps = EchoTaps.of(sphere, ReceivedBand(frequency=100e3, low=80e3, high=120e3, width=61.5e3), SPEED)
    weight = np.abs(taps.weights(AHEAD, -AHEAD)[0])
    assert taps.delay[np.argmax(weight)] == pytest.approx(-2 * 0.5 / SPEED, abs=1 / 61.5e3)


def test_a_table_that_ends_within_the_band_is_refused():
    one = table(np.arange(85e3, 120e3, 300.0), np.radians(np.arange(0, 360, 30.0)))
    with pytest.raises(ValueError, match="covers 85 to 119.8 kHz, and the pulse's band is 80 to 120 kHz"):
        EchoTaps.of(one, ReceivedBand(frequency=100e3, low=80e3, high=120e3, width=61.5e3), SPEED)


@pytest.mark.parametrize("values, axes, said", [
    (np.ones((2, 3)), {"colour": np.arange(2.0)}, "no angle colour"),
    (np.ones((3, 3)), {"aspect": np.arange(2.0)}, "ask"),
    (np.ones((2, 3)), {"aspect": np.array([1.0, 1.0])}, "does not rise"), (np.zeros(3), {}, "no value above 0"),
    (np.ones((1, 1, 3)), {"aspect": np.zeros(1), "incident_azimuth": np.zeros(1)}, "the aspect or the others")])
def test_tables_that_make_no_sense_are_refused(values, axes, said):
    with pytest.raises(ValueError, match=said):
        ScatteringTable(frequency=np.array([1e5, 2e5, 3e5]), values=values + 0j, axes=axes)
