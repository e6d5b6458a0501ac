"""A sonar's window of time is that of the scene as loaded: renders of a changed water fall into the bins that gradients
hold."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from gradient_scenes import sidescan
from scene_text import lambert, plugin, scene_text

import mitsonar
from mitsonar.plugins import PLUGINS
from mitsonar.survey.sidescan import kind as sidescan_kind

KEY = "sonar.medium.sound_speed"
SPEEDS = np.array([1515.0, 1514.0, 1502.0, 1494.0, 1491.0])
PROFILE = "0:1515, 7:1514, 11:1502, 18:1494, 40:1491"


def seen_by(kind, **attributes):
    """The scene file of a sonar of some kind over a level bed in a thermocline."""
    film = {"bins": attributes.pop("bins")} if "bins" in attributes else {}
    return scene_text(
        plugin("shape", "seabed", "bed", lambert(-25), depth=18.0, length=40.0, width=110.0, spacing=2.0),
        plugin("sensor", kind, "sonar", plugin("medium", "seawater", profile=PROFILE),
               plugin("film", "sonar_film", range=45.0, **film), pings=2, start=(0, -10, -8), **attributes),
        rays=200_000)


def leaf_of(params, speeds):
    """Set the speeds of the water, which carry gradients."""
    leaf = mi.Float64(speeds)
    dr.enable_grad(leaf)
    params[KEY] = leaf
    params.update()
    return leaf


@pytest.mark.parametrize("kind", [name[8:] for name in PLUGINS if name.startswith("sensors.")])
def test_the_window_stays_as_water_and_sonar_change(load, variant, kind):
    scene = load(seen_by(kind))
    sensor, params = scene.sensors()[0], mi.traverse(scene)

    def planned():
        survey = scene.integrator().array_survey(scene, sensor)
        return survey.time, survey.track.time

    before = planned()
    params[KEY] = mi.Float64(SPEEDS - [3, 2, 2, 2, 1])
    if sensor.follows_offsets:
        params["sonar.position_offset"] = mi.Float64([0, 0, 0.5] * 2)
    params.update()
    for then, now in zip(before, planned(), strict=True):
        assert np.array_equal(then, now)


def test_differences_of_renders_are_what_is_sent_back_by_the_speed_beside_the_sonar(load, variant):
    # 1 m/s and 200,000 rays: rays that are drawn otherwise, and pass from bin to bin, leave some 2 % of chance
    scene = load(seen_by("sidescan", bins=150, speckle=False, noise=False))
    params = mi.traverse(scene)

    def levels(speeds):
        leaf_of(params, speeds)
        return np.array(dr.detach(mi.render(scene, params, seed=1)))[..., 0]

    leaf = leaf_of(params, SPEEDS)
    image = mi.render(scene, params, seed=1)
    across = np.abs(np.arange(300) - 149.5) / 150
    weights = np.exp(-((across - 0.6) / 0.12) ** 2) * np.where(np.array(dr.detach(image))[..., 0] > -100, 1, 0)
    dr.backward(dr.sum(image * mi.TensorXf(weights[..., None].astype(np.float32))))
    for node in (1, 2):
        step = np.eye(5)[node]
        difference = np.sum(weights * (levels(SPEEDS + step) - levels(SPEEDS - step))) / 2
        assert dr.grad(leaf).numpy()[node] == pytest.approx(difference, rel=0.05), node


def test_the_check_sees_a_window_that_a_render_moves_and_a_gradient_holds(tmp_path, variant, monkeypatch):
    path = tmp_path / "scene.xml"
    path.write_text(sidescan(rays=2000, pings=1, waves=""))
    monkeypatch.setattr(sidescan_kind, "head_speed", lambda sensor, depth: float(sensor.water.profile.at(depth)))
    wrong, = mitsonar.gradient_check(path, [KEY], directions=1, tolerance=0.05).rows
    assert wrong.verdict == "off" and wrong.error > 1
