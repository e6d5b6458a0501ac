"""The water on the device: losses along straight and folded ways, its layers, and what it has not got.

In water of one speed and one absorption α the two-way loss of a way of length L is 2 α L, by way of the mirror too.
"""
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import arrays_of
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile, VolumeScattering
from mitsonar.water.column import AbsorptionColumn

ALPHA = 0.04


def point(z):
    return arrays_of(mi.Float).Array3f64(0, 0, z)


def way(length):
    """A level enough way of a length [m]."""
    return SimpleNamespace(arc_length=mi.Float(length), ray_parameter=mi.Float64(1 / 1500 / 2))


def even_column():
    return AbsorptionColumn(np.array([0.0, 50.0]), np.array([ALPHA, ALPHA]))


@pytest.mark.parametrize("folded", [False, True])
def test_losses_of_even_water_are_those_of_its_length(variant, folded):
    water = DeviceWater(SoundSpeedProfile.constant(1500.0), even_column(), deepest=50.0)
    loss = water.loss_db(point(-10), point(-40), way(60.0), folded)
    assert float(loss.numpy()[0]) == pytest.approx(2 * ALPHA * 60, rel=1e-4)


def test_water_without_absorption_loses_nothing(variant):
    water = DeviceWater(SoundSpeedProfile.constant(1500.0))
    assert not water.loss_db(point(-10), point(-40), way(60.0)).numpy().any()


def test_folded_layers_are_those_of_the_water_upside_down_as_well(variant):
    water = DeviceWater(SoundSpeedProfile([0.0, 20.0, 40.0], [1510.0, 1500.0, 1490.0]))
    up, down = (water.layers(folded=True).at(mi.Float64(depth))[0].numpy() for depth in ([-5.0, -30.0], [5.0, 30.0]))
    np.testing.assert_allclose(up, down, rtol=1e-12)
    np.testing.assert_allclose(down, water.profile.at(np.array([5.0, 30.0])), rtol=1e-12)


def test_only_water_that_scatters_has_a_strength(variant):
    volume = VolumeScattering([0.0, 10.0, 30.0], [-80.0, -70.0, -75.0])
    water = DeviceWater(SoundSpeedProfile.constant(1500.0), None, volume)
    assert water.scatters
    assert 10 * np.log10(water.volume.at(mi.Float(10.0)).numpy()[0]) == pytest.approx(-70.0, abs=1e-3)
    still = DeviceWater(SoundSpeedProfile.constant(1500.0))
    assert not still.scatters
    with pytest.raises(ValueError, match="without volume scattering"):
        still.volume
