"""A sonar's record as a function of its scene: derivatives against differences, and against each other.

Differences are central, of fourth order, with the rays held fixed. What is left of an error beside their own is what
falls between time bins (kinks of the tent) and between facets: some 1e-3 of the rms over directions with 20,000 rays.
"""
from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest
from inputs.gradient_scenes import WATERS, forward_looking, sidescan

import mitsonar

POSITIONS, STRENGTH = "bed.vertex_positions", "bed.bsdf.strength"


def smooth_weights(model, value):
    """Weights that vary slowly over pings and bins, so that no bin's edge counts; of mean 1 with the record."""
    pings, rows, bins = model.shape
    side = np.linspace(0.5, 1.5, rows)[:, None]             # what turns the sonar must not cancel between sides
    ping = 1 + 0.5 * np.cos(np.arange(pings) / 3)
    time = (np.arange(bins) / bins) ** 3 * np.clip((0.9 * bins - np.arange(bins)) / (0.2 * bins), 0, 1)
    weights = ping[:, None, None] * side * time * np.ones(model.shape)
    return weights.ravel() / np.mean(value * weights.ravel())


def bumps(positions, rng, count=4, reach=(20, 6)):
    """Smooth heights about places of the bed, as directions of its vertices."""
    for centre in rng.uniform(-np.array(reach), reach, (count, 2)):
        direction = np.zeros_like(positions)
        direction[:, 2] = np.exp(-((positions[:, :2] - centre) ** 2).sum(1) / 18)
        yield direction


def errors(model, key, directions, step):
    """Rms of the error over the rms of differences, and the greatest between forward and backward, of the rms."""
    start = model.start[key]
    about = model.linearised({})
    weights = smooth_weights(model, about.value)
    gradient, pairs = about.backward(weights)[key], []
    forward = [about.forward({key: direction}) @ weights for direction in directions]
    for direction, moved in zip(directions, forward):
        up, down, far_up, far_down = (model.value({key: start + by * step * direction}) @ weights
                                      for by in (1, -1, 2, -2))
        pairs.append((moved, np.sum(gradient * direction), (8 * (up - down) - (far_up - far_down)) / (12 * step)))
    forward, backward, differences = np.array(pairs).T
    size = np.sqrt(np.mean(differences ** 2))
    return np.sqrt(np.mean((forward - differences) ** 2)) / size, np.abs(forward - backward).max() / size


@pytest.mark.parametrize("water", WATERS)
def test_heights_move_a_sidescan_as_differences_say(load, rng, water):
    model = mitsonar.scene_model(load(sidescan(water)), [POSITIONS])
    against_differences, against_backward = errors(
        model, POSITIONS, list(bumps(model.start[POSITIONS], rng)), 0.01)
    assert against_differences < 5e-3
    assert against_backward < 1e-3                              # gradients of vertices are sums in float32


def test_heights_move_a_fan_as_differences_say(load, rng):
    model = mitsonar.scene_model(load(forward_looking()), [POSITIONS])
    directions = list(bumps(model.start[POSITIONS], rng, 2, (4, 12)))
    against_differences, against_backward = errors(model, POSITIONS, directions, 0.01)
    assert against_differences < 3e-2
    assert against_backward < 1e-3                              # gradients of vertices are sums in float32


def test_a_strength_is_a_factor(load):
    model = mitsonar.scene_model(load(sidescan()), [STRENGTH])
    about = model.linearised({})
    moved = about.forward({STRENGTH: model.start[STRENGTH]})
    # nothing else sounds: the record is proportional to the strength of its only material
    np.testing.assert_allclose(moved, about.value - model.value({STRENGTH: [1e-30]}), rtol=1e-5)


def test_a_lifted_flat_bed_moves_as_differences_say(load):
    """Its deepest point is where it is hit, and no table may end there. Weights keep away from the record's ends."""
    text = sidescan(waves="")
    model = mitsonar.scene_model(load(text), [POSITIONS])
    start, about = model.start[POSITIONS], model.linearised({})
    lifted = np.zeros_like(start)
    lifted[:, 2] = 1
    weights = smooth_weights(model, about.value)
    up, down = (model.value({POSITIONS: start + by * lifted}) @ weights for by in (0.01, -0.01))
    assert about.forward({POSITIONS: lifted}) @ weights == pytest.approx((up - down) / 0.02, rel=1e-3)


def test_levels_are_those_of_the_picture(load):
    scene = load(sidescan(rays=100_000, sonar='<boolean name="noise" value="false"/>'))
    model = mitsonar.scene_model(scene, [STRENGTH])
    picture = 10 ** (mitsonar.render(scene).mean_level.values.astype(float).ravel() / 10)
    intensity = model.value({})
    lit = picture > 1e-4 * picture.max()
    # rays are the picture's own; bins without steps differ where an echo begins, and smooth normals on slopes
    assert np.mean(np.abs(10 * np.log10(intensity[lit] / picture[lit]))) < 0.05
    assert intensity.sum() == pytest.approx(picture.sum(), rel=1e-3)


def test_values_are_given_back(load):
    scene = load(sidescan())
    model = mitsonar.scene_model(scene, [POSITIONS, STRENGTH])
    assert repr(model) == f"SceneModel of 4 pings, 2 rows, 100 bins by {POSITIONS} (1775, 3), {STRENGTH} (1,)"
    before = model.value({})
    model.value({POSITIONS: model.start[POSITIONS] + 0.1, STRENGTH: [0.02]})
    np.testing.assert_allclose(model.value({}), before, rtol=1e-12)


def test_what_cannot_be_is_told(load):
    scene = load(sidescan())
    with pytest.raises(ValueError, match="no parameter 'bed.vertex_position'.*did you mean"):
        mitsonar.scene_model(scene, ["bed.vertex_position"])
    with pytest.raises(ValueError, match="no parameter 'bed.faces' that gradients could be of"):
        mitsonar.scene_model(scene, ["bed.faces"])
    model = mitsonar.scene_model(scene, [STRENGTH])
    with pytest.raises(ValueError, match=r"strength has the shape \(2,\); give \(1,\)"):
        model.value({STRENGTH: [1.0, 2.0]})
    with pytest.raises(ValueError, match="not finite"):
        model.value({STRENGTH: [np.nan]})
    with pytest.raises(ValueError, match="weights have the shape"):
        model.linearised({}).backward(np.ones(3))


def test_a_bed_lifted_above_the_sonar_is_refused(load):
    model = mitsonar.scene_model(load(sidescan(rays=1000, pings=1)), [POSITIONS])
    with pytest.raises(ValueError, match="sonar below the seabed"):
        model.value({POSITIONS: model.start[POSITIONS] + [0, 0, 15]})
    model.value({})


def test_gradients_of_levels_are_verbs(load):
    scene = load(sidescan(sonar='<boolean name="noise" value="false"/>'))
    model = mitsonar.scene_model(scene, [STRENGTH])
    found = mitsonar.gradient(scene, [STRENGTH], lambda level: np.isfinite(level) / np.isfinite(level).sum())
    moved = mitsonar.directional_derivative(scene, {STRENGTH: np.ones(1)})
    # every level with an echo goes with 10 log µ
    assert found[STRENGTH][0] == pytest.approx(10 / np.log(10) / model.start[STRENGTH][0], rel=2e-2)
    assert moved.shape == model.shape
    with pytest.raises(ValueError, match="of is 'levels'.*did you mean"):
        mitsonar.gradient(scene, [STRENGTH], np.ones(model.shape), of="levels")


@pytest.mark.parametrize("key", ["sonar.position_offset", "sonar.attitude_offset", "sonar.medium.sound_speed"])
def test_water_and_track_move_a_sidescan_as_differences_say(load, rng, key):
    """The sonar hangs between nodes of the profile: at one, sound speeds above and below would share the derivative."""
    text = sidescan("thermocline").replace('z="-18"', 'z="-16"')
    model = mitsonar.scene_model(load(text), [key])
    start, step = model.start[key], {"sound_speed": 0.05, "position_offset": 0.005, "attitude_offset": 0.0005}
    assert np.any(start) == (key == "sonar.medium.sound_speed")
    directions = [rng.normal(size=(1, *start.shape[1:])) + np.zeros_like(start) for _ in range(2)]
    if start.ndim == 1:
        directions = [rng.normal(size=start.shape) for _ in range(2)]
    against_differences, against_backward = errors(model, key, directions, step[key.rpartition(".")[2]])
    assert against_differences < 1e-2
    assert against_backward < 1e-3                              # gradients of vertices are sums in float32


def test_a_bed_that_is_never_met_has_no_gradient(load):
    """The film ends before the first return: there is nothing to move, and no outline to look at."""
    text = sidescan().replace('name="range" value="34.0"', 'name="range" value="8"')
    about = mitsonar.scene_model(load(text), [POSITIONS]).linearised({})
    assert not np.any(about.backward(np.ones_like(about.value))[POSITIONS])


def test_a_texture_moves_a_sidescan_both_ways(load, rng, tmp_path, two_threads):
    """A texture keeps a copy of its data: tangents must reach it, time after time."""
    places = np.linspace(0, 1, 12)
    strengths = (-25 + 3 * np.sin(6 * places[:, None] + 4 * places)).astype(np.float32)
    mi.Bitmap(strengths[..., None]).write(str(tmp_path / "strengths.exr"))
    text = sidescan().replace('<float name="mu_db" value="-25.0"/>', """<texture name="mu_db" type="bitmap">
        <string name="filename" value="strengths.exr"/> <boolean name="raw" value="true"/> </texture>""")
    model, key = mitsonar.scene_model(load(text), ["bed.bsdf.mu_db.data"]), "bed.bsdf.mu_db.data"
    about = model.linearised({})
    weights = np.ones_like(about.value) / about.value.mean()
    for _ in range(2):
        direction = np.cos(rng.uniform(0, 6) + 3 * places)[:, None, None] * np.ones_like(model.start[key])
        moved = about.forward({key: direction}) @ weights
        up, down = (model.value({key: model.start[key] + by * direction}) @ weights for by in (0.05, -0.05))
        assert moved == pytest.approx((up - down) / 0.1, rel=1e-3)
        assert np.sum(about.backward(weights)[key] * direction) == pytest.approx(moved, rel=1e-5)


def test_what_stands_still_is_told_or_refused(load):
    buoy = """<shape type="point_target" id="buoy"><point name="position" x="9" y="0" z="-26"/>
        <float name="target_strength_db" value="-10"/></shape> <shape type="sea_surface" id="sea"/>"""
    group = """<shape type="shapegroup" id="group"><shape type="cube" id="cube"/></shape>
        <shape type="instance" id="copy"><ref id="group"/><transform name="to_world"><translate x="9" z="-29"/>
        </transform></shape>"""
    scene = load(sidescan(rays=1000, pings=1, more=buoy))
    told = mitsonar.scene_model(scene, [STRENGTH]).linearised({}).told
    assert 0 < told["echoes that stand still"] < 0.1
    for key, text in (("buoy.vertex_positions", "point target"), ("sea.vertex_positions", "sea surface")):
        with pytest.raises(ValueError, match=f"{key}' has no gradient.*{text}.*stands still"):
            mitsonar.scene_model(scene, [key])
    with pytest.raises(ValueError, match="cube.vertex_positions' has no gradient.*instances"):
        mitsonar.scene_model(load(sidescan(rays=1000, pings=1, more=group)), ["group.cube.vertex_positions"])


def test_models_of_one_scene_and_of_two_do_not_meet(load):
    """Leaves of an earlier product are none of a later one's, whoever still holds them."""
    scene = load(sidescan(rays=1000, pings=1))
    first, second = (mitsonar.scene_model(scene, [key]).linearised({}) for key in (STRENGTH, POSITIONS))
    third = mitsonar.scene_model(load(sidescan(rays=1000, pings=1)), [STRENGTH]).linearised({})
    weights = np.ones_like(first.value)
    expected = first.backward(weights)[STRENGTH]
    assert expected > 0
    second.backward(weights)
    assert third.backward(weights)[STRENGTH] == pytest.approx(expected, rel=1e-5)
    assert first.backward(weights)[STRENGTH] == pytest.approx(expected, rel=1e-5)
    assert first.forward({STRENGTH: np.ones(1)}) @ weights == pytest.approx(expected[0], rel=1e-5)


def test_numbers_of_a_sediment_stay_in_their_range(load):
    def sediment(more: str = "") -> mi.Scene:
        return load(sidescan(rays=1000, pings=1).replace(
            '<bsdf type="lambert">\n<float name="mu_db" value="-25.0"/>\n</bsdf>',
            f'<bsdf type="sediment">{more}</bsdf>'))

    model = mitsonar.scene_model(sediment(), ["bed.bsdf.w2", "bed.bsdf.gamma"])
    for key, value in (("w2", -1), ("gamma", 5)):
        with pytest.raises(ValueError, match=rf"Sediment: {key} is \[{value}.*give numbers from"):
            model.value({f"bed.bsdf.{key}": [float(value)]})
    # the table of what a mesh leaves over is made of one gamma: its derivatives would be amiss
    with pytest.raises(ValueError, match="no parameter 'bed.bsdf.gamma' that gradients could be of"):
        mitsonar.scene_model(sediment('<float name="mesh_resolution" value="0.5"/>'), ["bed.bsdf.gamma"])
