"""Transmission loss to soundings: closed forms in uniform water, eigenrays' tubes in layers."""
import numpy as np
import pytest
from sounded_line import SUMMER

from mitsonar.hydrography.detection.bottom_backscatter import mean_absorption, transmission_loss_db
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.reduction import Installation, Measured, located
from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water import SoundSpeedProfile
from mitsonar.water.column import AbsorptionColumn

REST = PlatformMotion(time=0.0, x=0, y=0, depth=5.0, roll=0, pitch=0, heading=0)
ANGLES = np.linspace(-1.15, 1.15, 24)


def sounded(profile):
    measured = Measured(ping_time=0.0, transmit_time=0.0, travel_time=0.15, angle=ANGLES, transmit_angle=0.0,
                        head_sound_speed=profile.at(5.0))
    return located(measured, REST, Installation(), profile, node=False)


def test_uniform_water_spreads_as_a_sphere():
    places = sounded(SoundSpeedProfile.constant(1500.0))
    range_ = 0.075 * 1500
    np.testing.assert_allclose(transmission_loss_db(places, 0.05), 20 * np.log10(range_) + 0.05 * range_, rtol=1e-9)
    np.testing.assert_allclose(np.sin(places.grazing), np.cos(ANGLES), rtol=1e-9)


def test_layers_spread_and_lengthen_as_eigenrays_do():
    # The last step of the search is shorter than 1e-5 m: 1e-6 of a hundred metres, of steps that were not taken.
    places = sounded(SUMMER)
    ray = eigenray(SUMMER, 5.0, places.depth, np.abs(places.across_track))
    np.testing.assert_allclose(places.spreading_area, ray.spreading_area, rtol=1e-6)
    np.testing.assert_allclose(places.path_length, ray.arc_length, rtol=1e-6)
    np.testing.assert_allclose(places.grazing, ray.arrival_angle, rtol=1e-6)


@pytest.mark.parametrize("top, bottom", [(0.0, 100.0), (5.0, 7.0), (25.0, 80.0), (150.0, 160.0), (30.0, 30.0)])
def test_mean_absorption_is_the_integral_over_depth(top, bottom):
    column = AbsorptionColumn([3, 10, 30, 120], [0.03, 0.05, 0.04, 0.045])
    edges = np.linspace(top, bottom, 100001)
    wanted = column.at(0.5 * (edges[1:] + edges[:-1])).mean()
    assert mean_absorption(column, np.array(top), np.array(bottom)) == pytest.approx(wanted, rel=1e-7)
    assert transmission_loss_db(sounded(SUMMER), column).shape == ANGLES.shape
