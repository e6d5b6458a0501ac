"""Floors of side lobes of fans and heads: what a point in a null of the vertical pattern has.

A point hangs 8 m off, on the axis and in the first null of the vertical pattern, sin ψ = λ/H, H = 0.443 λ / sin(Δ/2)
for a width Δ. With a floor f of the transmit and of the receive face, its echo in the null is f² of that on the axis,
whatever the way that the picture is made. Elements beside the centre see the null at an angle that differs by 1e-4: 0.1
dB.
"""
import numpy as np
import pytest
import sonar_scenes as scenes

import mitsonar
from mitsonar.sonar.arrays.channels import diffuse_level

WIDTH_DEG, RANGE = 20.0, 8.0
NULL = np.arcsin(np.sin(np.deg2rad(WIDTH_DEG) / 2) / 0.44294647069)
FACE = {"vertical_beam_width_deg": WIDTH_DEG, "tilt_deg": 0.0}
PARTS = {"film": {"range": 10.0, "range_min": 6.0}, "integrator": {"cell": 1.0}}


def of_a_fan(angle, way, floor_db):
    """The loudest level [dB] of a point, `angle` below the axis of a fan of 64 receivers."""
    place = [0.0, RANGE * np.cos(angle), -10.0 - RANGE * np.sin(angle)]
    scene = scenes.forward_looking({"bed": scenes.bed(60.0), "point": scenes.point_target(place)}, sensor={
        **FACE, "receive_elements": 64, "beams": 65, "fan_deg": 60.0, "vertical_sidelobe_db": floor_db,
        "picture": way}, **PARTS)
    return float(mitsonar.render(scene, 1)["level"].max())


def of_a_head(angle, way, floor_db):
    """The same of a head that looks at the point's bearing."""
    place = [0.0, RANGE * np.cos(angle), -10.0 - RANGE * np.sin(angle)]
    scene = scenes.sector_scan({"bed": scenes.bed(60.0), "point": scenes.point_target(place)}, sensor={
        **FACE, "first_bearing_deg": 0.0, "sector_deg": 1.0, "pings": 1, "turns_while_listening": False,
        "vertical_sidelobe_db": floor_db, "picture": way}, **PARTS)
    return float(mitsonar.render(scene, 1)["level"].max())


@pytest.mark.parametrize("way", ["beams", "elements"])
@pytest.mark.parametrize("level", [of_a_fan, of_a_head])
def test_the_floor_is_what_a_point_in_the_vertical_null_has(variant, level, way):
    axis, null = level(0.0, way, -20.0), level(NULL, way, -20.0)
    assert null - axis == pytest.approx(-40.0, abs=0.1)
    assert level(0.0, way, -200.0) == pytest.approx(axis, abs=1e-3)
    assert level(NULL, way, -200.0) < axis - 60


def test_presets_have_floors_and_omnidirectional_faces_have_none(variant):
    sensor = scenes.forward_looking({"bed": scenes.bed(40.0)}).sensors()[0]
    assert sensor.transmit.floor == sensor.receive.floor == pytest.approx(0.01)
    sensor = scenes.forward_looking({"bed": scenes.bed(40.0)}, sensor={"vertical_beam_width_deg": 180.0}).sensors()[0]
    assert sensor.transmit.floor == sensor.receive.floor == 0


def beams_of_a_point(**sensor):
    """Levels (B,) [dB] at the range of a point ahead, of a fan that has no noise, relative to the loudest."""
    scene = scenes.forward_looking(
        {"bed": scenes.bed(60.0), "point": scenes.point_target([0.0, RANGE, -10.0])},
        sensor={**FACE, "receive_elements": 64, "beams": 181, "fan_deg": 120.0, **sensor}, **PARTS)
    level = mitsonar.render(scene, 1)["level"].values[0].astype(float)
    beam, sample = np.unravel_index(level.argmax(), level.shape)
    assert abs(beam - 90) <= 1
    return level[:, sample] - level.max(), scene.sensors()[0].receive.weight


@pytest.mark.parametrize("more", [{}, {"receive_rows": 2}])
def test_flaws_of_receivers_fill_a_fan_to_the_same_beams_by_both_ways(variant, more):
    """Beams that are 40 dB down or more of 64 receivers half a wavelength apart; 0.3 makes -24.4 dB."""
    found, weight = beams_of_a_point(receive_flaws=0.3, picture="beams", **more)
    wanted = beams_of_a_point(receive_flaws=0.3, picture="elements", **more)[0]
    np.testing.assert_allclose(10 ** (found / 20), 10 ** (wanted / 20), atol=1e-3)
    aside = np.abs(np.arange(181) - 90) > 15
    floor = 10 * np.log10(np.mean(10 ** (found[aside] / 10)))
    columns = weight.reshape(-1, 64)[0]
    # some 55 independent beams: 0.6 dB
    assert floor == pytest.approx(10 * np.log10(diffuse_level(columns, 0.3)), abs=1.5)
    even = beams_of_a_point(receive_flaws=0.0, picture="beams", **more)[0]
    assert 10 * np.log10(np.mean(10 ** (even[aside] / 10))) < floor - 6
