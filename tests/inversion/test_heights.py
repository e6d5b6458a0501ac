"""Heights of a bed from one image of it.

The data have facets' normals, other rays, speckle of four looks and a bed 1 dB stronger than the model's. The bed's
waves are 0.28 m rms about their mean. Of eleven pings at 2 m a node the answer is 0.18 m off; 0.75 of the start is
asked for, and of the mean depth, that the first return tells, the start's error at most.
"""
import numpy as np
import pytest
from scenes import BED, STRENGTH, looked, model, scene, vertices

from mitsonar.inversion.heights import fit_heights
from mitsonar.inversion.image_fit import Stage
from mitsonar.inversion.smooth_field import grid_of

STAGES = Stage(bins=6, steps=4, products=6, first_only=True), Stage(bins=6, steps=3, products=12)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("heights")
    bed = scene(folder, speckle="true", bump="0.8", mu_db="-19", rays=20000)
    started = model(scene(folder), BED, STRENGTH)
    fit = fit_heights(started, looked(bed, 4), BED, strength=STRENGTH, looks=4, stages=STAGES, farthest=21, modes=6)
    positions = vertices(bed)
    return fit, positions[grid_of(positions)[2], 2]


def rms(values, fit):
    seen = (np.abs(fit["x"]) < 10) & (np.abs(fit["y"]) < 18)
    return float(np.sqrt((values ** 2).where(seen).mean()))


def test_shapes_are_nearer_than_the_start_and_the_depth_no_farther(found):
    fit, truth = found
    before, after = fit["height_start"] - truth, fit["height"] - truth
    assert rms(after - after.mean(), fit) < 0.75 * rms(before - before.mean(), fit)
    assert rms(after, fit) < 0.8 * rms(before, fit)


def test_a_level_that_is_off_is_told_from_the_bed(found):
    assert found[0].gain_db == pytest.approx(1, abs=0.6)


def test_uncertainty_is_less_where_rays_are(found):
    fit, _ = found
    assert np.all(fit["height_deviation"] <= fit["height_prior_deviation"] + 1e-12)
    assert fit["height_deviation"].sel(x=0, y=10) < 0.7 * fit["height_deviation"].sel(x=0, y=-24)
    assert "directions" in fit.observable and fit["misfit"][-1] < fit["misfit"][0]


def test_parameters_that_are_not_there_are_named(tmp_path):
    started = model(scene(tmp_path, rays=50), BED)
    image = looked(scene(tmp_path, rays=50), 1)
    with pytest.raises(ValueError, match="has no parameter 'bed.heights'; make it with that key: it has bed.vertex"):
        fit_heights(started, image, "bed.heights")
    with pytest.raises(ValueError, match="no parameter 'bed.bsdf.strength'"):
        fit_heights(started, image, BED, strength=STRENGTH)
