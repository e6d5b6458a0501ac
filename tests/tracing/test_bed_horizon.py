"""The bed's horizon against rays: what it hides of itself and of what stands on it.

In water of one speed Mitsuba's own straight rays are the truth. Of points on a rippled bed they may differ in 1 of 100,
where a crest's silhouette lies within the grid's step; a wall's shadow ends where the straight line over its edge does.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.shadows.bed_horizon import BedHorizon
from mitsonar.validation import scenes

REACH, DEPTH = 40.0, 17.0
ORIGIN = np.array([1.3, -2.1, -DEPTH])


def straight(x, height):
    return height * dr.rsqrt(height * height + x * x)


def rippled(**changes):
    return {"type": "seabed", "depth": 20.0, "length": 100.0, "width": 100.0, "spacing": 0.2, "ripple_wavelength": 3.0,
            "ripple_height": 0.5, "ripple_heading_deg": 30.0, "bsdf": scenes.lambert(), **changes}


def hidden(horizon, point, on_bed=True, origin=ORIGIN):
    """What a horizon says of points (R, 3)."""
    d = point - origin
    x = np.hypot(d[:, 0], d[:, 1])
    columns = [upload(mi.Float, column.astype(np.float32)) for column in
               (d[:, 0] / x, d[:, 1] / x, x, d[:, 2] / np.hypot(x, d[:, 2]))]
    return horizon.hidden(mi.Vector2f(*columns[:2]), *columns[2:], mi.Bool(on_bed)).numpy()


def test_a_rippled_bed_hides_what_rays_do_not_reach():
    geometry = Geometry(scenes.array_sonar({"seabed": rippled()}))
    horizon = BedHorizon(geometry, REACH).around(ORIGIN, straight, 1.0)
    random = np.random.default_rng(2)
    x, phi = random.uniform(2, 39, 20000), random.uniform(0, 2 * np.pi, 20000)
    top = mi.Point3f(*(upload(mi.Float, v.astype(np.float32)) for v in
                       (ORIGIN[0] + x * np.cos(phi), ORIGIN[1] + x * np.sin(phi), 0 * x)))
    met = geometry.scene.ray_intersect(mi.Ray3f(top, mi.Vector3f(0, 0, -1)))
    point, normal = met.p.numpy().T.astype(float), met.n.numpy().T.astype(float)
    lifted = mi.Point3f(*(upload(mi.Float, v.astype(np.float32)) for v in (point + 2e-3 * normal).T))
    towards = mi.Point3f(*ORIGIN.tolist()) - lifted
    distance = dr.norm(towards)
    free = ~geometry.scene.ray_test(mi.Ray3f(mi.Ray3f(lifted, towards / distance), distance))
    truth = ~free.numpy() | (np.sum((ORIGIN - point) * normal, 1) < 0)
    found = hidden(horizon, point) | (np.sum((ORIGIN - point) * normal, 1) < 0)
    assert 0.2 < truth.mean() < 0.8
    assert (found != truth).mean() < 0.01


@pytest.mark.parametrize("depth, ratio", [(17.0, 1.0), (12.0, 1.0), (12.0, 1.04), (5.0, 1.0), (20.4, 1.0)])
def test_nothing_is_hidden_before_the_horizon_begins(monkeypatch, depth, ratio):
    """The same points on the bed and over it are hidden as by a horizon that is known from the sonar on."""
    geometry, above = Geometry(scenes.array_sonar({"seabed": rippled()})), np.array([1.3, -2.1, -depth])
    random = np.random.default_rng(5)
    point = np.stack([*random.uniform(-40, 40, (2, 40000)), np.zeros(40000)], 1)
    down = geometry.scene.ray_intersect(mi.Ray3f(mi.Point3f(*(upload(mi.Float, v.astype(np.float32)) for v in point.T)),
                                                 mi.Vector3f(0, 0, -1)))
    point[:, 2] = down.p.numpy()[2]
    some = np.hypot(*(point - above)[:, :2].T) < REACH
    point, bed = point[some], BedHorizon(geometry, REACH)
    short = bed.around(above, straight, ratio)
    monkeypatch.setattr(BedHorizon, "_first", lambda *_: 0)
    whole = bed.around(above, straight, ratio)
    assert whole.first == 0 and (short.first > 0) == (depth < 19)
    for height in (0.0, 0.3):
        found = [hidden(one, point + [0, 0, height], height == 0, above) for one in (short, whole)]
        np.testing.assert_array_equal(*found)
        assert height or found[0].any()


def test_points_well_under_the_bed_are_told():
    """Against vertical rays; heights between nodes are bilinear there, which differs from facets by 1 cm at most."""
    bed = BedHorizon(geometry := Geometry(scenes.array_sonar({"seabed": rippled()})), REACH)
    bed.around(ORIGIN, straight, 1.0)
    random = np.random.default_rng(7)
    point = random.uniform([-38, -38, -20.6], [38, 38, -19.6], (20000, 3))
    point[:50, 0] = 51.0
    there = mi.Point3f(*(upload(mi.Float, column.astype(np.float32)) for column in point.T))
    down = geometry.scene.ray_intersect(mi.Ray3f(mi.Point3f(there.x, there.y, 0), mi.Vector3f(0, 0, -1)))
    under = down.p.numpy()[2] - point[:, 2]
    told = bed.deep(there, mi.Bool(True)).numpy()
    assert told[50:][under[50:] > 0.06].all() and not told[under < 0.04].any() and not told[:50].any()
    assert not bed.deep(there, mi.Bool(False)).numpy().any()


def test_windows_do_not_matter():
    """The same place seen after sampling another part of the bed gives the same bits."""
    bed = BedHorizon(Geometry(scenes.array_sonar({"seabed": rippled(length=300.0)})), REACH)
    first = bed.around(ORIGIN, straight, 1.0).sine.numpy()
    bed.around(ORIGIN + [0.0, 90.0, 0.0], straight, 1.0)
    assert (bed.around(ORIGIN, straight, 1.0).sine.numpy() == first).all()


def test_a_flat_bed_hides_nothing_of_itself():
    horizon = BedHorizon(Geometry(scenes.array_sonar({"seabed": scenes.bed(20.0, size=100.0)})), REACH).around(
        ORIGIN, straight, 1.0)
    x, phi = np.linspace(0.3, 39, 500), np.linspace(0, 20, 500)
    point = np.stack([ORIGIN[0] + x * np.cos(phi), ORIGIN[1] + x * np.sin(phi), -20 + 0 * x], 1)
    assert not hidden(horizon, point).any()
    assert hidden(horizon, point - [0, 0, 0.5], on_bed=False)[x > 5].all()
    of_a_grid = BedHorizon(Geometry(scenes.array_sonar({"seabed": rippled(ripple_height=0.0)})), REACH).around(
        ORIGIN, straight, 1.0)
    assert of_a_grid.places == 1 and not hidden(of_a_grid, point).any()


def test_without_a_seabed_there_is_no_horizon():
    bed = BedHorizon(Geometry(scenes.array_sonar({"rock": scenes.bed(20.0)})), REACH)
    assert bed.around(ORIGIN, straight, 1.0) is None


def test_points_known_to_lie_under_the_bed_are_those_that_rays_do_not_reach():
    """None of them is free, few that lie deep are missed, and none is known where rays may pass beside the bed."""
    bed = BedHorizon(geometry := Geometry(scenes.array_sonar({"seabed": rippled()})), REACH)
    point = np.random.default_rng(3).uniform([-60, -60, -24], [60, 60, -10], (20000, 3))
    on_device = mi.Point3f(*(upload(mi.Float, column.astype(np.float32)) for column in point.T))
    known = bed.under(ORIGIN)(on_device).numpy()
    towards = mi.Point3f(*ORIGIN.tolist()) - on_device
    distance = dr.norm(towards)
    blocked = geometry.scene.ray_test(mi.Ray3f(mi.Ray3f(on_device, towards / distance), distance)).numpy()
    over_the_bed = (np.abs(point[:, :2]) < 50).all(1)
    assert (known & ~blocked).sum() <= 2                       # a ray may slip between two facets
    assert known[over_the_bed & (point[:, 2] < -20.7)].mean() > 0.98
    assert not known[~over_the_bed].any()
    assert bed.under(ORIGIN + [80.0, 0.0, 0.0]) is None and bed.under(ORIGIN - [0.0, 0.0, 4.0]) is None


def test_nothing_is_known_under_a_bed_with_a_hole():
    whole = Geometry(scenes.array_sonar({"seabed": rippled()}))
    index, shape, first, count = whole.meshes[0]
    bed = BedHorizon(whole, REACH)
    assert bed._lowest([(index, shape, first, count)]) is not None
    assert bed._lowest([(index, shape, first, count - 2)]) is None


def test_a_field_without_targets_leaves_the_horizon_as_it_is():
    """The same bits: its buried speck is no part of the bed, for which a bed of a grid would be sampled by rays."""
    empty = {"type": "targets", "species": "rounded_stone", "count": 0, "bed": {"type": "ref", "id": "seabed"}}
    sines = [BedHorizon(Geometry(scenes.array_sonar({"seabed": rippled(), **more})), REACH).around(
        ORIGIN, straight, 1.0).sine.numpy() for more in ({}, {"stones": empty})]
    assert (sines[0] == sines[1]).all()
