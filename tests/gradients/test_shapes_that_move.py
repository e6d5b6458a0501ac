"""Spheres, cylinders, disks and rectangles that move, turn and grow, by their ``to_world``.

Differences are of the same rays at steps of 2 or 5 cm, in groups of eight bins of 0.17 m: 100,000 rays leave 1 to 6 %
of noise in what outlines pass.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scene_text import lit_bed
from scipy.integrate import quad
from scipy.linalg import expm

from mitsonar.verbs.gradients import scene_model

KEY, TOGETHER = "ball.to_world", 8
THERMOCLINE = "0:1492, 18:1490, 24:1478, 30:1474, 50:1474"
HARD = '<bsdf type="lambert" id="hard"><float name="mu_db" value="-15"/></bsdf>'
TILTED = '<rotate y="1" angle="-50"/><rotate z="1" angle="25"/>'
SHAPES = {
    "sphere": '<scale value="1.2"/>',
    "cylinder": '<translate z="-0.5"/><scale x="0.7" y="0.7" z="2.5"/><rotate x="1" angle="70"/>'
                '<rotate z="1" angle="25"/>',
    "disk": '<scale value="1.3"/>' + TILTED,
    "rectangle": '<scale x="1" y="1.4" z="1"/>' + TILTED,
}


def shape(kind, place=(16, 0.3, -28), turned=None):
    x, y, z = place
    return f"""<shape type="{kind}" id="ball"><transform name="to_world">{SHAPES[kind] if turned is None else turned}
        <translate x="{x}" y="{y}" z="{z}"/></transform>{HARD}</shape>"""


def moved(matrix, motion=(0, 0, 0), turn=(0, 0, 0), grow=0.0):
    """The generator (4, 4) of a motion, a turn about the shape's origin, and growth from there."""
    east, north, up = turn
    found = np.zeros((4, 4))
    found[:3, :3] = np.array([[0, -up, north], [up, 0, -east], [-north, east, 0]]) + grow * np.eye(3)
    found[:3, 3] = np.array(motion) - found[:3, :3] @ matrix[:3, 3]
    return found


def together(change, shape):
    return change.reshape(shape).sum(0).reshape(shape[1], -1, TOGETHER).sum(-1)


@pytest.mark.parametrize("kind, profile, step, limits", [
    ("sphere", THERMOCLINE, 0.02, (0.05, 0.1, 0.05)), ("cylinder", "0:1500, 50:1500", 0.05, (0.03, 0.08, 0.03, 0.03)),
    ("disk", THERMOCLINE, 0.05, (0.03, 0.03, 0.03, 0.03)),
    ("rectangle", "0:1500, 50:1500", 0.05, (0.03, 0.03, 0.03, 0.03))])
def test_products_agree_with_differences(load, kind, profile, step, limits):
    """North, up, growth, and a turn about east and the vertical at once, which a sphere does not notice."""
    model = scene_model(load(lit_bed(shape(kind), profile=profile, pings=2)), [KEY])
    start, found = model.start[KEY], []
    about = model.linearised({})
    for ways in ({"motion": (0, 1, 0)}, {"motion": (0, 0, 1)}, {"grow": 1.0}, {"turn": (0.6, 0, 0.8)}):
        way = moved(start, **ways)
        product = about.forward({KEY: way @ start})
        ahead, back = (model.value({KEY: expm(sign * step * way) @ start}) for sign in (1, -1))
        if kind == "sphere" and "turn" in ways:
            assert not product.any()
            continue
        difference = together((ahead - back) / (2 * step), model.shape)
        found.append(np.linalg.norm(together(product, model.shape) - difference) / np.linalg.norm(difference))
    assert np.all(np.array(found) < limits[:len(found)]), found


def test_a_ball_that_grows_away_from_the_sonar_comes_later_and_fainter(load):
    """Scaled about the sonar by 1 + s, a ball looks the same. Each ray has (1 + s) of its time, 1 / (1 + s)² of its
    energy: dΣI/ds = -2 ΣI and dΣtI/ds = -ΣtI over bins before the bed's, exact but for float32 and the sonar's way of
    millimetres while the ping comes in."""
    model = scene_model(load(lit_bed(shape("sphere", (9, 0, -18), '<scale value="0.5"/>'), pings=1, rays=20_000,
                                     start=(0, 0, -18), speed_knots=0.01,
                                     water='<float name="absorption_db_per_km" value="0"/>')), [KEY])
    start = model.start[KEY]
    about = model.linearised({})
    product = about.forward({KEY: moved(start, motion=start[:3, 3] - (0, 0, -18), grow=1.0) @ start})
    early = np.arange(model.shape[2]) < 60                             # 10.2 m; the bed is 12 m below
    change, intensity = (one.reshape(model.shape)[0, 1, early] for one in (product, about.value))
    time = np.arange(60) + 0.5
    assert change.sum() == pytest.approx(-2 * intensity.sum(), rel=2e-3)
    assert time @ change == pytest.approx(-(time @ intensity), rel=2e-3)


def test_a_ball_sends_back_more_and_earlier_as_it_grows(load):
    """A Lambert ball of radius r at R, seen by a wide beam: E ~ ∫ w(ρ) cos²θ dA / ρ⁴ over what is lit,

        cos θ = (R cos β - r) / ρ,    ρ² = R² + r² - 2 R r cos β,    dA = 2π r² sin β dβ

    and dE/dr / E from it; w falls from 1 in front to 0 towards the limb, where slopes have 1 / cos θ, and few rays meet
    it. 200,000 rays and the pulse of a bin know it to 2 %; the beam falls by 1 % over the ball."""
    distance, radius = 9.0, 0.5
    still = '<float name="absorption_db_per_km" value="0"/>'
    model = scene_model(load(lit_bed(shape("sphere", (distance, 0, -18), f'<scale value="{radius}"/>'), pings=1,
                                     start=(0, 0, -18), rays=200_000, bins=1000, beam_width_deg=40.0, speed_knots=0.01,
                                     water=still)), [KEY])
    start = model.start[KEY]
    about = model.linearised({})
    product = about.forward({KEY: moved(start, grow=1 / radius) @ start})

    def weight(rho):
        return np.maximum(1 - (rho - distance + radius) / (0.7 * radius), 0) ** 2 * (rho < 10.2)

    of_bin = weight((np.arange(1000) + 0.5) * 34 / 1000) * (np.arange(1000) > 220)
    change, intensity = (one.reshape(model.shape)[0, 1] @ of_bin for one in (product, about.value))

    def energy(r):
        def part(beta):
            square = distance ** 2 + r ** 2 - 2 * distance * r * np.cos(beta)
            lit = weight(np.sqrt(square)) * (distance * np.cos(beta) - r) ** 2
            return lit / square ** 3 * r ** 2 * np.sin(beta)

        return quad(part, 0, np.arccos(r / distance))[0]

    expected = (energy(radius + 1e-3) - energy(radius - 1e-3)) / 2e-3 / energy(radius)
    assert change / intensity == pytest.approx(expected, rel=0.03)


def test_forward_is_the_transpose_of_backward_and_nothing_stands_still(load):
    model = scene_model(load(lit_bed(shape("cylinder"), rays=40_000)), [KEY])
    about, start = model.linearised({}), model.start[KEY]
    way = moved(start, motion=(1, 2, 0.5), turn=(0.3, 0.2, 1), grow=0.3) @ start
    weights = np.random.default_rng(0).uniform(0.5, 1.5, about.value.size)
    pulled = about.backward(weights)[KEY]
    assert pulled.shape == (4, 4) and not pulled[3].any()
    assert np.sum(pulled * way) == pytest.approx(weights @ about.forward({KEY: way}), rel=1e-4)
    assert set(about.told) == {"bins in shadow"}


def test_a_sonar_that_moves_past_a_ball_sees_its_round_side(load):
    """Along the track, at which a ball's normals turn under the rays."""
    key = "sonar.position_offset"
    model = scene_model(load(lit_bed(shape("sphere"), pings=2)), [key])
    way = np.broadcast_to(np.eye(3)[1], model.start[key].shape)
    product = together(model.linearised({}).forward({key: way}), model.shape)
    ahead, back = (model.value({key: sign * 0.05 * way}) for sign in (1, -1))
    difference = together((ahead - back) / 0.1, model.shape)
    assert np.linalg.norm(product - difference) < 0.05 * np.linalg.norm(difference)


def test_a_transform_that_carries_a_gradient_is_rendered(load):
    """As users of Mitsuba do it."""
    loaded = load(lit_bed(shape("sphere"), rays=20_000, pings=1))
    parameters = mi.traverse(loaded)
    grows = mi.Float(1.0)
    dr.enable_grad(grows)
    parameters[KEY] = type(parameters[KEY])(mi.Transform4f().translate([16, 0.3, -28]).scale(1.2 * grows).matrix)
    parameters.update()
    dr.backward(dr.sum(mi.render(loaded, parameters, seed=1)))
    assert abs(float(dr.grad(grows)[0])) > 1


def test_bad_transforms_are_refused(load):
    loaded = load(lit_bed(shape("sphere"), rays=1000, pings=1))
    model = scene_model(loaded, [KEY])
    flat, shifted = model.start[KEY].copy(), model.start[KEY].copy()
    flat[2, :3], shifted[3, 0] = 0, 1
    for matrix, message in ((flat, "no inverse"), (shifted, "last row")):
        with pytest.raises(ValueError, match=message):
            model.value({KEY: matrix})
    with pytest.raises(ValueError, match="mesh such as 'bed' has no 'bed.to_world'.*vertex_positions"):
        scene_model(loaded, ["bed.to_world"])


def test_a_ball_scaled_unlike_along_its_axes_counts_by_its_volume(load):
    model = scene_model(load(lit_bed(shape("sphere"), rays=5000, pings=1)), [KEY])
    alike, unlike = model.start[KEY].copy(), model.start[KEY].copy()
    alike[:3, :3], unlike[:3, :3] = 2 * np.eye(3), np.diag([1.0, 2.0, 4.0])
    # sums are added in any order
    np.testing.assert_allclose(model.value({KEY: alike}), model.value({KEY: unlike}), rtol=1e-6)


def test_lines_where_a_ball_meets_the_bed_are_told(load):
    """Half in the bed, and while the sonar alone moves, too; not of a ball that hangs above it."""
    for key in (KEY, "sonar.position_offset"):
        for z, wanted in ((-29.5, {"where ball and bed meet, left out": 1.0}), (-28, {})):
            model = scene_model(load(lit_bed(shape("sphere", (16, 0.3, z)), rays=2000, pings=1)), [key])
            told = model.linearised({}).told
            assert {name: told[name] for name in told if "meet" in name} == wanted
