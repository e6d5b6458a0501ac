"""Volume scattering against depth, in NumPy and on the device, and the closed form of its reverberation.

Closed forms: straight lines in decibels between nodes, powers of layers on top. Float32 leaves 1e-5 dB.
"""
import numpy as np
import pytest
from scipy.integrate import quad

from mitsonar.water import VolumeScattering, volume_reverberation_db
from mitsonar.water.volume import LAYERS, Layer


@pytest.fixture
def volume():
    return VolumeScattering([0, 30, 100], [-60, -75, -70], [Layer("fish", 20, 40, -70), Layer("wake", 35, 50, -50)])


def power(*levels_db):
    return sum(10 ** (level / 10) for level in levels_db)


@pytest.mark.parametrize("depth, levels_db", [
    (-3, [-60]), (0, [-60]), (10, [-65]), (25, [-72.5, -70]), (37, [-74.5, -70, -50]), (45, [-75 + 15 / 14, -50]),
    (65, [-72.5]), (100, [-70]), (4000, [-70]),
])
def test_strength_between_nodes_and_in_layers(volume, depth, levels_db):
    assert volume.at(depth) == pytest.approx(power(*levels_db), rel=1e-12)
    assert volume.strength_db_at(depth) == pytest.approx(10 * np.log10(power(*levels_db)), abs=1e-9)


def test_layers_hold_their_top_and_not_their_bottom(volume):
    assert volume.at(20.0) == pytest.approx(power(-70, -70)) and volume.at(50.0) == pytest.approx(power(-75 + 20 / 14))


def test_layers_alone_leave_the_water_silent():
    volume = VolumeScattering(layers=[Layer("wake", 1, 4, -50)])
    np.testing.assert_allclose(volume.at([0.5, 2.0, 4.5]), [0, 1e-5, 0], rtol=1e-12)
    assert volume.strength_db_at(0.5) == -np.inf


def test_one_number_is_the_strength_everywhere():
    np.testing.assert_allclose(VolumeScattering(0.0, -80.0).at([[-5.0, 0.0], [10.0, 6000.0]]), 1e-8, rtol=1e-12)


def test_device_agrees(variant, volume):
    import mitsuba as mi

    from mitsonar.water.volume_table import volume_table

    depth = np.concatenate([np.linspace(-10, 120, 100_001), volume.edges]).astype(np.float32)
    for some in (volume, VolumeScattering(0.0, -80.0), VolumeScattering(layers=volume.layers)):
        found = volume_table(some, mi.Float).at(mi.Float(depth)).numpy()
        np.testing.assert_allclose(found, some.at(depth.astype(float)), rtol=1e-5)


def test_layers_are_read_from_text():
    assert Layer.read("kelp 5 12 -55") == Layer("kelp", 5, 12, -55)
    assert Layer.read(" fish 20, 35 ") == Layer("fish", 20, 35, LAYERS["fish"][2])
    assert Layer.read("bubbles") == Layer("bubbles", *LAYERS["bubbles"])


@pytest.mark.parametrize("text, said", [
    ("kelp 5 12", "is not \"name top bottom dB\""), ("fish a b", "is not \"name"), ("fish 1 2 3 4", "is not \"name"),
    ("fish 30 20 -60", "reaches from 30 to 20 m"), ("fish 20 30 60", "strength is 60 dB"),
])
def test_what_is_no_layer(text, said):
    with pytest.raises(ValueError, match=said):
        Layer.read(text)


@pytest.mark.parametrize("arguments, said", [
    ((), "neither strengths nor layers"), (([0.0],), "both depth and strength_db"),
    (([0, 1], [-60]), "2 depths but 1 strengths"), (([1, 0], [-60, -60]), "increase downwards"),
    (([0, 1], [-60, np.nan]), "strength is nan"),
])
def test_what_is_no_volume(arguments, said):
    with pytest.raises(ValueError, match=said):
        VolumeScattering(*arguments)


def test_reverberation_is_the_integral_over_a_gate():
    """RL against ∫ s_v ψ r² dr 10^(-2 α r/10)/r⁴ over a gate of 0.075 m at 100 m: 1e-6 dB of curvature."""
    alpha, near, far = 0.0334, 100 - 0.0375, 100 + 0.0375
    whole, _ = quad(lambda r: 0.01 * 1e-8 * r**-2 * 10 ** (-0.2 * alpha * r), near, far)
    level = volume_reverberation_db(220.0, 100.0, -80.0, 0.01, 1e-4, alpha)
    assert level == pytest.approx(220 + 10 * np.log10(whole), abs=1e-5)
