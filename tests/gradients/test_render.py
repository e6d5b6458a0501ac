"""`mi.render` with parameters that carry gradients: forward and backward, as of any Mitsuba integrator."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from inputs.gradient_scenes import sidescan

import mitsonar

KEY = "bed.bsdf.strength"


@pytest.fixture
def scene(tmp_path, variant):
    path = tmp_path / "scene.xml"
    path.write_text(sidescan(sonar='<boolean name="speckle" value="false"/> <boolean name="noise" value="false"/>'))
    return mitsonar.load_file(path)


def attached(scene, value):
    parameters = mi.traverse(scene)
    leaf = mi.Float(value)
    dr.enable_grad(leaf)
    parameters[KEY] = leaf
    parameters.update()
    return parameters, leaf


def test_a_loss_of_levels_is_sent_back(scene):
    parameters, leaf = attached(scene, 0.004)
    image = mi.render(scene, parameters, seed=1)
    dr.backward(dr.sum(image))
    lit = np.count_nonzero(np.array(dr.detach(image)) > -100)
    # dL / dµ = 10 / (ln 10 µ) in every bin that an echo falls into
    assert dr.grad(leaf)[0] == pytest.approx(lit * 10 / np.log(10) / 0.004, rel=2e-2)


def test_a_tangent_is_sent_forward(scene):
    parameters, leaf = attached(scene, 0.004)
    dr.set_grad(leaf, 1.0)
    image = mi.render(scene, parameters, seed=1)
    dr.forward_to(image)
    moved = np.array(dr.grad(image))
    assert moved.shape == image.shape
    assert np.median(moved[moved > 0]) == pytest.approx(10 / np.log(10) / 0.004, rel=1e-4)


def test_the_image_is_that_of_smooth_beds_where_gradients_are_wanted(scene):
    parameters, _ = attached(scene, 0.004)
    smooth = np.array(dr.detach(mi.render(scene, parameters, seed=1)))
    parameters[KEY] = mi.Float(0.004)
    parameters.update()
    facets = np.array(mi.render(scene, seed=1))
    assert 0.01 < np.abs(smooth - facets)[facets > -100].mean() < 1
