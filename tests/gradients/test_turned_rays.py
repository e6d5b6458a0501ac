"""Rays that turned: their spreading, as the water, the sonar and the bed move.

A sonar 6 m above the bed sends rays upwards that the water bends down again, -1.25 /s: all that comes from beyond
120 m, where a ray that left level ends.
"""
import mitsonar  # noqa: F401  isort: skip
from types import SimpleNamespace

import drjit.llvm.ad as lib
import mitsuba as mi
import numpy as np
import pytest
from scene_text import lambert, plugin, scene_text

from mitsonar.gradients.attached.finish import _widening
from mitsonar.gradients.attached.walked_rays import walked
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.verbs.gradients import scene_model
from mitsonar.water import SoundSpeedProfile

SCENE = scene_text(
    plugin("shape", "seabed", "bed", lambert(-25, "sand"), depth=30.0, length=40.0, width=440.0, spacing=20.0),
    plugin("sensor", "sidescan", "sonar", plugin("medium", "seawater", profile="0:1530, 60:1455"),
           plugin("film", "sonar_film", range=210.0, bins=100), pings=1, start=(0, 0, -24), speed_knots=0.01,
           beam_width_deg=2.0, speckle=False, noise=False), rays=200_000)


@pytest.mark.parametrize("key, step", [("sonar.medium.sound_speed", 0.2), ("sonar.position_offset", 0.1)])
def test_energies_of_turned_rays_follow_water_and_sonar(tmp_path, key, step):
    """The speed at the surface, and the sonar's height, over all bins from 126 m on. Rays of 200,000 leave 3 % of
    noise; with spreading that stands still slopes were 150 and 80 % off."""
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    model = scene_model(mitsonar.load_file(path), [key])
    start, way = model.start[key], np.zeros_like(model.start[key])
    way[..., -1 if way.ndim > 1 else 0] = 1
    about = model.linearised({})
    ahead, back = (model.value({key: start + sign * step * way}) for sign in (1, -1))
    level = about.value.reshape(model.shape)[0, :, 60:].sum(0)
    product, difference = (one.reshape(model.shape)[0, :, 60:].sum(0) / level for one in (
        about.forward({key: way}), (ahead - back) / (2 * step)))
    assert product.mean() == pytest.approx(difference.mean(), rel=0.06)


def test_wavefronts_of_turned_rays_widen_as_neighbours_part():
    """κ = d ln A / ds of one ray, A = X |D| |sin θ sin θ_0| / (p c_0²) at depths 2 cm apart: 1e-3 of κ by float32.

    Straight down; turned above; turned below, and neighbours cross before; turned above and below."""
    depth = np.array([2.0, 6, 14, 20, 32, 47, 60, 90, 140])
    speed = np.array([1473.7, 1473.7, 1476, 1513, 1487, 1486, 1484, 1487, 1498])
    table = layer_table(SoundSpeedProfile(depth, speed), lib.Float64)
    source, launch = np.array([30.0, 30, 61, 61]), np.sin(np.radians([40.0, -5, 5, 4]))
    target, about = np.array([120.0, 40, 100, 62]), np.array([106.6, 208.0, 642.4, 1576.5])
    sound = [np.interp(z, depth, speed) for z in (source, target)]
    parameter = np.sqrt(1 - launch ** 2) / sound[0]

    def logarithm(step):
        reach, _, spread = (one.numpy() for one in walked(
            table, lib, lib.Float64(speed), lib.Float64(source), lib.Float64(launch), lib.Float64(target + step),
            lib.Float64(about), lib.Bool(True)))
        square = 1 - (parameter * np.interp(target + step, depth, speed)) ** 2
        return reach, spread, np.log(abs(reach * spread * np.sqrt(square) * launch / (parameter * sound[0] ** 2)))

    reach, spread, area = logarithm(0.0)
    ahead, back = (walked(table, lib, lib.Float64(speed), lib.Float64(source), lib.Float64(launch),
                          lib.Float64(target + sign * 0.01), lib.Float64(about), lib.Bool(True))[0].numpy()
                   for sign in (1, -1))
    side = np.sign(ahead - back)                                       # down or up where it arrives
    sine = side * np.sqrt(1 - (parameter * sound[1]) ** 2)
    slope = (logarithm(0.01)[2] - logarithm(-0.01)[2]) / 0.02 * sine
    cosine = parameter * sound[1]
    hits = SimpleNamespace(
        arc_length=mi.Float(reach.astype(np.float32)), sound_speed=lib.Float64(sound[1]), valid=mi.Bool(True),
        ray_parameter=lib.Float64(parameter), spreading_area=mi.Float(np.exp(area).astype(np.float32)),
        arrival_direction=mi.Vector3f(mi.Float(cosine.astype(np.float32)), 0, mi.Float(-sine.astype(np.float32))))
    node = np.clip(np.searchsorted(depth, target) - 1, 0, len(depth) - 2)
    gradient = np.diff(speed)[node] / np.diff(depth)[node]
    found = _widening(hits, *(mi.Float(one.astype(np.float32)) for one in (
        launch, reach, gradient, np.sign(spread * launch * sine))))
    np.testing.assert_allclose(found.numpy(), slope, rtol=2e-3)
