"""Passes over ground that keeps a part of its scatterers: the coherence between them is what the material says.

The coherence of n independent pairs of complex Gaussians, γ = <a b*> / √(<|a|²> <|b|²>), comes out within
(1 - γ²)/√(2n), and within 1/√n where γ is 0 (Touzi and others, 1999); a mean power within 1/√n. Tests allow 4 of that.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from sonar_scenes import array_sonar, bed, forward_looking, sidescan

import mitsonar
from mitsonar.device.arrays import compressed
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.echoes.scatterers.thinned_scatterers import Density, ThinnedScatterers
from mitsonar.scene.geometry import Geometry

DISTURBED = 0.6


def steady_bed(coherence=None):
    material = {"type": "lambert", **({} if coherence is None else {"coherence": coherence})}
    return bed(12.0, material, size=40.0)


def disturbed_patch(coherence=DISTURBED):
    place = mi.ScalarTransform4f().translate([0, 10, -11.9]).scale([5, 5, 1])
    return {"type": "rectangle", "to_world": place,
            "bsdf": {"type": "sediment", "sediment": "medium sand", "coherence": coherence}}


def between(one, other):
    """Coherence, and the tolerance of the module's text."""
    found = np.vdot(other, one) / np.sqrt(np.vdot(one, one).real * np.vdot(other, other).real)
    return found, 4 / np.sqrt(len(one))


def cells(geometry, number):
    """Amplitudes of a facet's cells, shape by shape."""
    scatterers, found = Scatterers(geometry, 0.15, number), {}
    for facet in np.flatnonzero(scatterers.scattering):
        count = min(int(scatterers.cuts[facet]) ** 2, 20_000)
        some = scatterers.at(mi.UInt32(int(facet)), dr.arange(mi.UInt32, count))
        name = geometry.labels[int(scatterers.label[facet])]
        found.setdefault(name, []).append(some.amplitude[0].numpy() + 1j * some.amplitude[1].numpy())
    return {name: np.concatenate(parts) for name, parts in found.items()}


def thinned(geometry, number):
    density = Density(origin=np.array([0, 0, -10.0]), axis=np.array([1.0, 0, 0]), per_cell=16.0, range_cell=0.05,
                      sine_cell=0.01, nearest=1.0, farthest=15.0)
    scatterers = ThinnedScatterers(Scatterers(geometry, np.inf, number), farthest=15.0,
                                   places=density.origin[None])
    all_of_them = scatterers.candidates(density, lambda direction, distance, wider: mi.Bool(True))
    some, exist = scatterers.at(*all_of_them, density)
    some = some.chosen(compressed(exist))
    amplitude, label = some.amplitude[0].numpy() + 1j * some.amplitude[1].numpy(), some.label.numpy()
    return {name: amplitude[label == key] for key, name in geometry.labels.items()}


@pytest.mark.parametrize("made", [cells, thinned])
def test_scatterers_keep_the_coherence_of_their_material(variant, made):
    geometry = Geometry(array_sonar({"bed": steady_bed(), "patch": disturbed_patch()}))
    passes = [made(geometry, number) for number in (0, 1, 7)]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        np.testing.assert_array_equal(passes[one]["bed"], passes[other]["bed"])
        found, slack = between(passes[one]["patch"], passes[other]["patch"])
        assert abs(found - DISTURBED) < (1 - DISTURBED ** 2) * slack
    for some in passes:
        power = np.mean(np.abs(some["patch"]) ** 2)
        assert power == pytest.approx(1, abs=4 / np.sqrt(len(some["patch"])))
    again = made(geometry, 7)
    np.testing.assert_array_equal(again["patch"], passes[2]["patch"])


def test_a_coherence_of_none_leaves_pass_0_as_it_is(variant):
    steady, other = (Geometry(array_sonar({"bed": steady_bed(c)})) for c in (None, 0.0))
    np.testing.assert_array_equal(cells(other, 0)["bed"], cells(steady, 0)["bed"])
    found, slack = between(cells(other, 1)["bed"], cells(other, 0)["bed"])
    assert abs(found) < slack


def test_a_texture_of_coherence_is_read_where_scatterers_lie(variant):
    texture = {"type": "bitmap", "raw": True, "filter_type": "nearest", "wrap_mode": "clamp",
               "data": mi.TensorXf(np.array([0.25, 1.0], np.float32).reshape(1, 2, 1))}
    place = mi.ScalarTransform4f().translate([0, 0, -12]).scale([20, 20, 1])
    geometry = Geometry(array_sonar({"bed": {"type": "rectangle", "to_world": place,
                                             "bsdf": {"type": "lambert", "coherence": texture}}}))
    sides = []
    for number in (0, 3):
        scatterers = Scatterers(geometry, 0.2, number)
        facets = np.flatnonzero(scatterers.scattering)
        some = scatterers.at(mi.UInt32(int(facets[0])), dr.arange(mi.UInt32, int(scatterers.cuts[facets[0]]) ** 2))
        x, amplitude = some.point.x.numpy(), some.amplitude[0].numpy() + 1j * some.amplitude[1].numpy()
        sides.append([amplitude[x < 0], amplitude[x > 0]])
    (west, east), (west_later, east_later) = sides
    np.testing.assert_allclose(east, east_later, atol=1e-6)
    found, slack = between(west, west_later)
    assert abs(found - 0.25) < slack


def of_elements(shapes, number):
    line = {"receive": "line", "receive_elements": 48, "receive_pitch": 0.06, "frequency_khz": 100.0}
    scene = array_sonar(shapes, sensor={**line, "pass": number, "receive_normal": "down"},
                        film={"range": 8.0, "range_min": 3.0, "sample_rate_khz": 10.0}, integrator={"cell": 0.05})
    return mitsonar.impulse_response(scene).values.ravel()


def test_element_signals_of_two_passes_are_as_coherent_as_the_bed(variant):
    """About 30 samples of 48 elements, four wavelengths apart: a thousand independent numbers, a little fewer."""
    first, second = (of_elements({"bed": steady_bed(DISTURBED)}, number) for number in (0, 1))
    found, _ = between(first, second)
    assert abs(found - DISTURBED) < 0.1
    steady, later = of_elements({"bed": steady_bed()}, 0), of_elements({"bed": steady_bed(1.0)}, 5)
    np.testing.assert_allclose(steady, later, rtol=0, atol=1e-6 * np.abs(steady).max())


def test_pictures_of_two_passes_agree_as_the_square_of_the_bed_s_coherence(variant):
    """Intensities of Gaussians of coherence γ have the correlation γ² (Siegert)."""
    def power(number, coherence):
        scene = forward_looking({"bed": steady_bed(coherence)}, film={"range": 12.0},
                                sensor={"pass": number, "pings": 1, "beams": 64, "receive_elements": 64})
        image = mitsonar.render(scene)
        return 10 ** (image["level"].values[0].astype(float) / 10)[:, image["range"].values > 4.0]

    first, second = (power(number, 0.8) for number in range(2))
    mean = np.mean([power(number, 0.0) for number in range(2, 7)], axis=0)
    smooth = gaussian_filter(mean, 5)
    lit = smooth > 1e-3 * smooth.max()
    one, other = (some[lit] / smooth[lit] for some in (first, second))
    assert np.corrcoef(one, other)[0, 1] == pytest.approx(0.64, abs=0.05)


def test_noise_is_another_in_every_pass(variant):
    def signals(number):
        loud = {"noise": True, "noise_level_db": 90.0, "source_level_db": 0.0}
        scene = array_sonar({"bed": steady_bed()}, sensor={"pass": number, **loud}, film={"range": 10.0},
                            integrator={"cell": 1.0})
        return mitsonar.element_signals(scene).values.ravel().astype(complex)

    found, slack = between(signals(0), signals(1))
    assert abs(found) < slack


def test_a_sidescan_takes_no_pass(variant):
    with pytest.raises(Exception, match='unknown attribute "pass"'):
        sidescan({"bed": steady_bed()}, sensor={"pass": 1})


def test_a_coherent_material_within_another_is_refused(variant):
    blend = {"type": "blendbsdf", "weight": 0.5, "one": {"type": "diffuse"},
             "two": {"type": "lambert", "coherence": 0.5}}
    scene = array_sonar({"bed": bed(12.0, blend, size=40.0)})
    with pytest.raises(ValueError, match="coherence"):
        mitsonar.impulse_response(scene)
