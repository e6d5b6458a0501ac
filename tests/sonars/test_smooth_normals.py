"""Coarse beds that scatter by normals between their nodes, against the same bed made of fine facets.

The bed is a sine of 0.5 m height and 16 m length under a sidescan 12 m above, Lambert's law; compared are bins of
0.2 m from 22 to 40 m, beyond the layover of the nadir and before the first shadow. A facet of 2 m is four to ten bins
long: at its edges levels leap by 0.26 dB rms (second differences), on fine facets they bend by 0.06 dB. What a coarse
mesh has in its places stays: 0.2 dB rms in a bin, 0.05 dB in all.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.validation import scenes

NEAR, FAR = 22.0, 40.0


def wavy(spacing, smooth, length=120.0):
    return {"type": "seabed", "depth": 30.0, "length": length, "width": 100.0, "spacing": spacing, "sine_height": 0.5,
            "sine_wavelength": 16.0, "sine_heading_deg": 70.0, "smooth_normals": smooth, "bsdf": scenes.lambert()}


@pytest.fixture(scope="module")
def levels():
    """Return mean levels (side, bin) [dB] of a bed by its node distance and whether it is smooth, once each."""
    known = {}

    def run(spacing, smooth):
        if (spacing, smooth) not in known:
            scene = scenes.sidescan({"bed": wavy(spacing, smooth)}, depth=18.0, pings=2, rays=150_000,
                                    film={"range": FAR, "range_min": NEAR, "bins": 90})
            known[spacing, smooth] = mitsonar.render(scene, 1)["mean_level"].values.mean(0)
        return known[spacing, smooth]
    return run


def kinks(level):
    return np.sqrt(np.mean(np.diff(level, 2, axis=-1) ** 2))


def test_facets_do_not_show(levels):
    fine, facets, smooth = levels(0.25, False), levels(2.0, False), levels(2.0, True)
    assert kinks(facets) > 3 * kinks(fine)
    assert kinks(smooth) < 1.5 * kinks(fine)


def test_levels_are_those_of_the_fine_bed(levels):
    fine, facets, smooth = levels(0.25, False), levels(2.0, False), levels(2.0, True)
    error = [np.sqrt(np.mean((some - fine) ** 2)) for some in (facets, smooth)]
    assert error[1] < 0.8 * error[0] and error[1] < 0.25
    total = [10 * np.log10(np.sum(10 ** (some / 10))) for some in (fine, smooth)]
    assert total[1] == pytest.approx(total[0], abs=0.1)
    assert np.abs(levels(0.25, True) - fine).max() < 0.15         # where facets are small, there is nothing to smooth


def test_a_flat_bed_is_as_before(variant):
    def level(smooth):
        bed = {**wavy(2.0, smooth, 60.0), "sine_height": 0.0}
        scene = scenes.sidescan({"bed": bed}, depth=18.0, pings=1, rays=5000, film={"range": FAR, "bins": 50})
        return mitsonar.render(scene, 1)["mean_level"].values
    np.testing.assert_allclose(level(True), level(False), atol=1e-4)


def test_other_shapes_keep_their_facets(variant):
    """A tilted rectangle and a cube of facets beside a smooth bed send back what they do beside one of facets."""
    import mitsuba as mi

    cube = {"type": "cube", "bsdf": scenes.lambert(-10.0),
            "to_world": mi.ScalarTransform4f().translate([26, 0, -26]).rotate([0, 0, 1], 30.0)}

    def level(smooth):
        scene = scenes.sidescan({"bed": {**wavy(2.0, smooth, 60.0), "bsdf": scenes.lambert(-190.0)}, "cube": cube},
                                depth=18.0, pings=1, rays=30_000, film={"range": 35.0, "range_min": 22.0, "bins": 50})
        return mitsonar.render(scene, 1)["mean_level"].values
    smooth, facets = level(True), level(False)
    heard = facets > np.nanmax(facets) - 40
    np.testing.assert_allclose(smooth[heard], facets[heard], atol=1e-3)


def test_cells_of_arrays_scatter_by_them_too(variant):
    """The same scatterers, each by another grazing angle, of 30 degrees and more: the sum stays within 5 %."""
    def energy(smooth):
        scene = scenes.array_sonar({"bed": wavy(4.0, smooth, 60.0)}, depth=18.0, film={"range": 26.0},
                                   integrator={"ensonification": "scatterers", "cell": 0.5})
        return np.abs(mitsonar.impulse_response(scene, seed=1).values[0, 0, 0]) ** 2

    facets, smooth = energy(False), energy(True)
    assert not np.allclose(facets, smooth, rtol=0.01, atol=0)
    assert smooth.sum() == pytest.approx(facets.sum(), rel=0.05)


@pytest.mark.parametrize("grazing", [0.3, 0.1, 0.01])
def test_no_normal_looks_away_from_the_sound(variant, grazing):
    import drjit as dr
    import mitsuba as mi

    from mitsonar.scene.tracing.hits import LEAST_SINE, towards_sound

    tilt = np.linspace(-1.2, 1.2, 49)
    arrival = mi.Vector3f(float(np.cos(grazing)), 0, -float(np.sin(grazing)))
    smooth = 0.9 * mi.Vector3f(mi.Float(np.sin(tilt)), 0, mi.Float(np.cos(tilt)))
    flat = mi.Vector3f(0, 0, 1) + dr.zeros(mi.Vector3f, 49)
    bent = towards_sound(smooth, flat, arrival)
    sine = -dr.dot(bent, arrival).numpy()
    assert sine.min() >= 0.99 * min(LEAST_SINE, np.sin(grazing))
    np.testing.assert_allclose(dr.norm(bent).numpy(), 1, atol=1e-6)
    expected = -np.sin(tilt) * np.cos(grazing) + np.cos(tilt) * np.sin(grazing)
    free = expected > LEAST_SINE + 1e-3
    np.testing.assert_allclose(sine[free], expected[free], atol=1e-5)
    turned = towards_sound(-smooth, flat, arrival)
    np.testing.assert_allclose(turned.z.numpy(), bent.z.numpy(), atol=1e-6)
    none = towards_sound(mi.Vector3f(0, 0, 0) + dr.zeros(mi.Vector3f, 49), flat, arrival)
    np.testing.assert_allclose(none.z.numpy(), 1)
    assert towards_sound(None, flat, arrival) is None
