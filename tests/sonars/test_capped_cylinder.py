"""The shape `capped_cylinder`: closed, round, and with the target strengths of a cylinder and of a disc.

RL of one omnidirectional element in water without loss, as in `test_smooth_targets`: broadside a L² / 2λ, from its end
that of the disc, (π a² / λ)², both of the far field (Urick 1983, ch. 9). Bodies so small and far that the near field
takes under 0.05 dB; 0.3 dB for what facets leave of round bodies.
"""
import numpy as np
import pytest

import mitsonar
import mitsonar.scene.loading
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, lambert

WAVELENGTH, RADIUS, LENGTH = 0.015, 0.1, 0.5
AT = np.array([0.0, 150.0, -10.0])                                      # the sonar at the origin, 10 m deep


def drum(axis, *, near=0.0, **more):
    """With its middle `near` [m] behind AT."""
    middle, along = AT + [0, near, 0], 0.5 * LENGTH * np.asarray(axis, float)
    return {"type": "capped_cylinder", "p0": list(middle - along), "p1": list(middle + along), "radius": RADIUS,
            "bsdf": {"type": "rigid"}, **more}


def strength_db(shape):
    scene = array_sonar({"bed": buried_bed(900.0), "drum": shape}, water={"absorption_db_per_km": 0.0},
                        sensor={"pulse": "cw", "pulse_ms": 1.0}, film={"range": 158.0, "range_min": 142.0})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    return 20 * np.log10(abs(PressureRecord(survey).at(0).responses()[0, 0].astype(complex).sum()) * 150.0 ** 2)


@pytest.mark.parametrize("axis, near, wanted", [
    ((1, 0, 0), RADIUS, RADIUS * LENGTH ** 2 / (2 * WAVELENGTH)),
    ((0, 1, 0), 0.5 * LENGTH, (np.pi * RADIUS ** 2 / WAVELENGTH) ** 2),
    ((0, -1, 0), 0.5 * LENGTH, (np.pi * RADIUS ** 2 / WAVELENGTH) ** 2)])
def test_target_strength_broadside_and_end_on(variant, axis, near, wanted):
    assert strength_db(drum(axis, near=near)) == pytest.approx(10 * np.log10(wanted), abs=0.3)


def test_highlight_between_side_and_cap(variant):
    """Askew, neither glints: what is left are its rims, far below both."""
    askew = np.array([np.sin(0.6), np.cos(0.6), 0])
    assert strength_db(drum(askew)) < -20


def test_it_is_closed_and_smooth_from_rim_to_rim(variant):
    import mitsuba as mi

    from mitsonar.echoes.smooth.facets import SmoothFacets
    from mitsonar.scene.geometry import Geometry

    mitsonar.scene.loading.prepare()
    shape = drum((1, 0, 0), to_world=mi.ScalarTransform4f().rotate([0, 0, 1], 30).scale(2.0))
    scene = mi.load_dict({"type": "scene", "drum": shape}, optimize=False)
    facets = SmoothFacets(Geometry(scene), WAVELENGTH)
    assert (facets.outward == 1).all() and facets.convex
    # facets lie on chords: a little less than the true body, twice as large as it was written
    sides = facets.bent
    assert facets.area[sides].sum() == pytest.approx(4 * 2 * np.pi * RADIUS * LENGTH, rel=1e-3)
    assert facets.area[~sides].sum() == pytest.approx(4 * 2 * np.pi * RADIUS ** 2, rel=3e-3)
    # no slivers: each side is longer than a tenth of the longest
    side = np.linalg.norm(facets.corner - np.roll(facets.corner, 1, axis=1), axis=-1)
    assert (side.min(1) > 0.1 * side.max(1)).all()
    axis = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0])
    normals = np.array(mi.traverse(scene.shapes()[0])["vertex_normals"]).reshape(-1, 3)
    lean = np.abs(normals @ axis)
    np.testing.assert_allclose(lean[lean > 0.5], 1, atol=1e-6)
    np.testing.assert_allclose(lean[lean < 0.5], 0, atol=1e-6)


def test_it_scatters_from_its_cap(variant):
    """A Lambert drum upright on the bed sends back from its top, where an open tube lets sound in."""
    levels = []
    for kind in ("capped_cylinder", "cylinder"):
        pipe = {"type": kind, "p0": [0.0, 0.0, -20.5], "p1": [0.0, 0.0, -18.0], "radius": 2.0,
                "bsdf": {"type": "lambert", "mu_db": -5.0}}
        response = mitsonar.impulse_response(array_sonar(
            {"bed": bed(20.0, lambert(-60.0), size=20.0), "pipe": pipe}, film={"range": 9.0, "range_min": 7.0},
            integrator={"cell": 0.05}))
        early = response["time"].values < 2 * 8.2 / 1500
        levels.append(np.sum(np.abs(response.values[..., early]) ** 2))
    assert levels[0] > 100 * levels[1]


@pytest.mark.parametrize("wrong, said", [
    ({"radius": 0.0}, "radius is the float 0.0"), ({"facets": 2}, "facets is the integer 2"),
    ({"p1": list(AT - [0.25, 0, 0])}, "p0 and p1 are the same point"),
    ({"facets": 4096, "p1": [3000.0, 150.0, -10.0]}, "give fewer facets"),
    ({"to_world": "stretched"}, "scales it unevenly")])
def test_what_is_no_cylinder_is_refused(variant, wrong, said):
    import mitsuba as mi

    from mitsonar.scene.errors import plain

    if "to_world" in wrong:
        wrong = {"to_world": mi.ScalarTransform4f().scale([1, 1, 2])}
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({**drum((1, 0, 0)), **wrong})
    assert said in plain(caught.value)
