"""A sidescan's shadows are filled by side lobes, which rays of their own sample evenly and without bias."""
import mitsuba as mi
import numpy as np
import pytest
from track_files import write_track

import mitsonar
import mitsonar.scene.loading
from mitsonar.survey.energy.energy import EnergyBlock
from mitsonar.survey.energy.sides import Sides
from mitsonar.validation.scenes import bed, lambert, sidescan

LOBES = {"preset": "auv_450khz", "sidelobe_db": -25.0, "vertical_sidelobe_db": -14.0, "back_db": -30.0}
PINGS, RAYS = 8, 30_000


def quay(half_length, pings=PINGS, rays=RAYS):
    """Starboard of a flat bed 7 m below the sonar, with a wall 20 m away as high as 1 m below it."""
    mitsonar.scene.loading.prepare()
    place = mi.ScalarTransform4f().translate([21.0, 0, -9.0]).scale([1.0, half_length, 3.0])
    scene = sidescan({"seabed": bed(12.0), "wall": {"type": "cube", "to_world": place, "bsdf": lambert(-27.0)}},
                     depth=5.0, pings=pings, rays=rays, sensor=LOBES, film={"range": 60.0, "bins": 600})
    return mitsonar.render(scene, 1).sel(side="starboard", range=slice(23.0, None))


@pytest.fixture(scope="module")
def long_quay():
    return quay(200.0)


def test_no_bin_behind_a_quay_is_without_rays(long_quay):
    """Rays drawn by the beam alone leave 74 of 100 bins without any; those along side lobes are ten in the median.
    They light no bin: it stays in shadow, and has no label."""
    assert long_quay["rays"].values.min() > 0
    assert np.median(long_quay["rays"]) >= 8
    assert long_quay["mean_level"].values.min() > -199
    assert (long_quay["shadow"].values == 1).all() and (long_quay["label"].values == 0).all()


def test_the_mean_level_behind_a_wall_is_smooth_and_that_of_many_rays():
    """A wall of 16 m: the bed beside it fills the shadow by side lobes. Bins scatter by 0.32 of their mean at most, so
    that speckle has a contrast of 1.1; the mean over 8 pings and 150 bins of 30 groups has a standard error of 2 %."""
    few, many = (10 ** (0.1 * quay(8.0, pings, rays)["mean_level"].sel(range=slice(25, 40)).values.astype(float))
                 for pings, rays in ((PINGS, 2 * RAYS), (2, 1_500_000)))
    ratio = few / many.mean(0)
    assert ratio.std() < 0.32
    assert abs(ratio.mean() - 1) < 0.06


def test_rays_stand_for_the_half_space_of_their_side(variant):
    """Solid angles sum to 2 π, and u², y and z² over them to 2 π/3, π and 2 π/3, whatever the attitude and the
    shares of rays aside: within 4 standard errors of the rows' mean, which are below 3 %."""
    scene = sidescan({"seabed": bed(30.0), "wall": {"type": "sphere", "center": [25.0, 0.0, -28.0], "radius": 4.0}},
                     pings=60, rays=24_000, sensor={**LOBES, "roll_deg": 6.0, "pitch_deg": 4.0, "motion_period": 3.0})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    rows = Sides(survey)
    block = EnergyBlock(survey, rows, 2)
    place = block._places.of(np.arange(60))
    rays, = rows.passes(place, 2, block._bins_of)
    body = place.body(rays.ping, rays.direction)
    weight, row = rays.solid_angle.numpy().astype(float), rays.row.numpy()
    x, y, z = (part.numpy().astype(float) for part in (body.x, body.y, body.z))
    for moment, expected in ((1 + 0 * x, 2 * np.pi), (x * x, 2 * np.pi / 3), (abs(y), np.pi), (z * z, 2 * np.pi / 3)):
        found = np.bincount(row, weight * moment) / expected
        error = found.std() / np.sqrt(len(found))
        assert abs(found.mean() - 1) < 4 * error < 0.12
    assert (y * rays.side.numpy() > -1e-5).all()


def test_a_rolling_sidescan_starves_no_far_bin(tmp_path):
    """Pings of a group ask one of them where rays are needed: what it found is carried to their own roll. In a summer's
    water, rolling 0.6 degrees a ping, its angles as they were left 1 to 30 rays of 41 in the least bin."""
    time = 0.11 * np.arange(-10, 24)
    rows = np.stack([time, 0 * time, 2 * time, 0 * time - 8, 5.7 * np.sin(2 * np.pi * time / 6), 0 * time, 0 * time], 1)
    scene = sidescan({"seabed": bed(18.0)}, pings=None, rays=60_000, film={"range": 80.0, "bins": 300},
                     water={"profile": "0:1515, 7:1514, 11:1502, 18:1494, 40:1491"},
                     sensor={**LOBES, "track": write_track(tmp_path / "roll.csv", rows)})
    rays = mitsonar.render(scene).sel(range=slice(30, 79))["rays"].values
    assert rays.min() > 0.5 * np.median(rays)
