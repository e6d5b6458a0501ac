"""Echoes by way of a rough sea and the bed: their noise is small, nothing stands out, nothing is biased.

Both are level, the sonar stands still and the water has one sound speed, so that every ping and side is a run of the
same experiment. Partners that are drawn without a look are the reference: they need no weights but their own chance.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.echoes.bounces import chosen_partners
from mitsonar.validation.scenes import bed, lambert, sidescan, water_of
from mitsonar.water import SoundSpeedProfile

RUNS = 60                          # pings, of two sides


def ghosts(shapes, path, *, pings=RUNS, **more):
    """Powers (runs, bins) of a path, of 20,000 rays a ping."""
    scene = sidescan({"seabed": bed(30.0, lambert(-10.0)), **shapes}, rays=20_000, pings=pings,
                     sensor={"vertical_beam_width_deg": 60.0, "beam_width_deg": 1.0}, film={"bins": 100, "range": 60.0},
                     integrator={"max_depth": 2}, **more)
    level = mitsonar.render(scene)["path_level"].sel(path_name=path).values.astype(float)
    return (10 ** (level / 10)).reshape(-1, 100)


SEA = {"sea": {"type": "sea_surface", "wind_speed": 6.0, "size": 400.0}}


@pytest.fixture(scope="module")
def by_the_sea():
    return ghosts(SEA, "bs")


def heard(power):
    mean = power.mean(0)
    return power[:, mean > 1e-4 * mean.max()]


def test_no_bin_stands_out(variant, by_the_sea):
    # of rays drawn for the two-way beam and partners drawn without a look, the brightest bin is 14 times the mean
    power = heard(by_the_sea)
    assert power.shape[1] > 40
    assert (power / power.mean(0)).max() < 8


def test_chosen_partners_save_noise_and_bias_nothing(variant, monkeypatch, by_the_sea):
    monkeypatch.setattr(chosen_partners, "CANDIDATES", 1)
    unseen, chosen = ghosts(SEA, "bs"), by_the_sea
    quiet, noisy = (float((heard(power).var(0) / heard(power).mean(0) ** 2).mean()) for power in (chosen, unseen))
    assert quiet < 0.6 * noisy
    totals = [power[:, some].sum(1) for some in (slice(0, 75), slice(75, 100)) for power in (chosen, unseen)]
    for one, other in (totals[:2], totals[2:]):
        error = np.hypot(*(total.std(ddof=1) / np.sqrt(len(total)) for total in (one, other)))
        assert error < 0.05 * one.mean()
        assert abs(one.mean() - other.mean()) < 4 * error


def by_a_box(*, rays, pings, seed):
    """Powers (pings, bins) of a metre of what goes to and fro between a box and the bed before and beside it."""
    import mitsuba as mi

    to_world = mi.ScalarTransform4f().translate([25, 0, -28]).rotate([0, 0, 1], 20.0).scale([3, 6, 2])
    shapes = {"seabed": bed(30.0, lambert(-15.0), size=300.0),
              "box": {"type": "cube", "to_world": to_world, "bsdf": lambert(-10.0)}}
    scene = sidescan(shapes, rays=rays, pings=pings, sensor={"vertical_beam_width_deg": 60.0, "beam_width_deg": 2.0},
                     film={"bins": 60, "range": 60.0}, integrator={"max_depth": 2})
    level = mitsonar.render(scene, seed)["path_level"].sel(path_name="bb").values[:, 1].astype(float)
    return 10 ** (level / 10)


def test_bins_that_hear_faint_pairs_alone_get_their_share(variant):
    """40 dB under what the foot of the box brings. Partners in proportion to power made the spread 3.6 of the mean."""
    power = by_a_box(rays=16_000, pings=200, seed=6)[:, 28:36].sum(1)
    assert power.std() < 1.4 * power.mean()


def test_few_rays_do_not_dim_the_corner_at_the_foot_of_a_box(variant):
    """It is 7 % darker with 4000 rays, whose patches are large: `passed_on` keeps the area above them."""
    few = np.concatenate([by_a_box(rays=4000, pings=200, seed=seed)[:, 22:25].sum(1) for seed in (1, 2, 3, 4)])
    many = by_a_box(rays=64_000, pings=160, seed=1)[:, 22:25].sum(1)
    error = np.hypot(*(power.std() / power.mean() / np.sqrt(len(power)) for power in (few, many)))
    assert error < 0.025
    assert few.mean() / many.mean() == pytest.approx(1, abs=0.09)


def test_a_level_bed_lights_itself_where_rays_bulge_upwards(variant):
    """Straight lines between its points graze it: only bent rays connect them, and they are candidates all the same."""
    bulging, sagging = (ghosts({}, "bb", pings=4, water=water_of(SoundSpeedProfile([0.0, 40.0], speeds))).max()
                        for speeds in ([1540.0, 1480.0], [1480.0, 1540.0]))
    assert bulging > 1e-12
    assert sagging < 1e-19
