"""Eigenrays read from a table against the exact ones.

Truth is the connector, whose rays are held to the eigenrays of `propagation`. In water of one speed the table is exact
but for rounding in float32 (asked: 1e-9 s, 1e-6, 0.001 dB). In a summer's water it errs by the curvature of what it
holds over a cell; asked is what a picture can tell: 1 mm of way over 60 m (0.7 µs), 1 mrad of direction, 0.05 dB.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from summer import SUMMER_TABLE

from mitsonar.device.arrays import upload
from mitsonar.echoes.sights.eigenray_table import EigenrayTable
from mitsonar.echoes.sonar_equation import leg_gain, speed_ratio
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.validation import scenes
from mitsonar.water import SoundSpeedProfile

DEPTH, REACH = 16.0, 60.0
EXPECTED = {"constant": (1e-9, 1e-6, 0.001), "summer": (7e-7, 1e-3, 0.05)}
PROFILES = {"constant": ([0.0], [1500.0]), "summer": SUMMER_TABLE}


@pytest.fixture(scope="module", params=PROFILES)
def case(request):
    geometry = Geometry(scenes.array_sonar({"seabed": scenes.bed(21.0, size=150.0, tilt=0.03)}))
    water = DeviceWater(SoundSpeedProfile(*PROFILES[request.param]), deepest=25.0)
    return Connector(geometry, water), EXPECTED[request.param]


def points(count=4000, seed=5):
    """Offsets from the source (count, 3), up to REACH away, at the depths of the scene."""
    random = np.random.default_rng(seed)
    x, phi = random.uniform(0.5, REACH, count), random.uniform(0, 2 * np.pi, count)
    return np.stack([x * np.cos(phi), x * np.sin(phi), DEPTH - random.uniform(18.8, 23.2, count)], 1)


def test_legs_are_those_of_the_exact_rays(case):
    connector, (seconds, radians, decibels) = case
    table = EigenrayTable(connector, depth=DEPTH, farthest=REACH)
    offset = table.lib.Array3f64(*(upload(mi.Float64, column) for column in points().T))
    start = table.lib.Array3f64(*(dr.full(mi.Float64, v, 4000) for v in (0, 0, -DEPTH)))
    legs, nothing = table.legs(offset), mi.Vector3f(0, 0, 0)
    way = connector.join(start, nothing, start + offset, nothing, occlusion=False)
    exists = way.exists.numpy()
    assert (legs.exists.numpy() == exists).all() and exists.all()
    assert np.abs(legs.travel_time.numpy() - way.travel_time.numpy()).max() < seconds
    for mine, exact in ((legs.launch_direction, way.launch_direction), (legs.arrival_direction, way.arrival_direction)):
        assert np.abs(mine.numpy() - exact.numpy()).max() < radians
    gain = leg_gain(spreading_area=way.spreading_area, loss_db=connector.water.loss_db(start, start + offset, way),
                    speed_ratio=speed_ratio(way.sound_speed, mi.Float64(table.sound_speed)))
    assert np.abs(10 * np.log10(legs.gain.numpy() / gain.numpy())).max() < decibels


def test_points_that_are_not_numbers_or_lie_outside_are_looked_up_nowhere(case):
    table = EigenrayTable(case[0], depth=DEPTH, farthest=REACH)
    bad = np.array([np.nan, np.inf, -np.inf, 1e30, 0.0])
    legs = table.legs(table.lib.Array3f64(upload(mi.Float64, bad), mi.Float64(0), upload(mi.Float64, bad[::-1].copy())))
    assert len(legs.gain.numpy()) == len(bad)
