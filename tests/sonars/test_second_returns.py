"""Second returns of bed and surface in the pictures of fans and heads: they begin where their ways end.

A sonar 3 m deep over a level bed at 8 m, under a mirror: the bed by way of the surface, out or back, begins at
(5 + 8 + 3)/2 = 8 m, the bed between two surface legs at (3 + 8 + 8 + 3)/2 = 11 m. With two and three bounces levels
rise there by more than 2 dB, and by less than 0.05 dB half a metre before (rays are drawn anew).
"""
import numpy as np
import pytest
import sonar_scenes as scenes

import mitsonar

MIRROR = {"type": "sea_surface", "wind_speed": 0.0, "size": 200.0}
KINDS = {
    "forward_looking": (scenes.forward_looking, {
        "frequency_khz": 200.0, "bandwidth_khz": 20.0, "pulse_ms": 0.3, "receive_elements": 16, "beams": 17,
        "fan_deg": 90.0, "tilt_deg": 0.0, "vertical_beam_width_deg": 180.0}),
    "sector_scan": (scenes.sector_scan, {
        "frequency_khz": 200.0, "bandwidth_khz": 0.0, "beam_width_deg": 10.0, "vertical_beam_width_deg": 150.0,
        "sector_deg": 9.0, "pings": 4})}


@pytest.mark.parametrize("kind", KINDS)
def test_second_returns_begin_where_their_ways_end(variant, kind):
    build, sensor = KINDS[kind]
    power = []
    for depth in (1, 2, 3):
        scene = build({"bed": scenes.bed(8.0, size=200.0), "sea": MIRROR}, depth=3.0, sensor=sensor,
                      film={"range": 12.0}, integrator={"max_depth": depth, "rays": 20_000, "cell": 0.2})
        image = mitsonar.render(scene, 1)
        level = image["level"].values.reshape(-1, image["level"].shape[-1]).astype(float)
        away = image["range"].values
        power.append([np.mean(10 ** (level[:, (away >= begin) & (away < begin + 0.4)] / 10))
                      for begin in (7.3, 8.05, 10.4, 11.05)])
    once, twice, thrice = 10 * np.log10(power)
    assert np.all(np.abs((twice - once)[:1]) < 0.05) and (twice - once)[1] > 2
    assert np.all(np.abs((thrice - twice)[:3]) < 0.05) and (thrice - twice)[3] > 2
