"""Sediments in a scene: refused before a run where the law does not hold; a map paints both ways to light a seabed.

A flat square of two halves, clay to the west and sandy gravel to the east, under a sidescan that runs north over their
border: each side's level is that of a square of its sediment alone. The rays are the same, so the levels agree to
float32, 0.001 dB.
"""
import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render

from mitsonar.validation.scenes import array_sonar, bed, sidescan

HALVES = np.array([[0.0, 1.0]], np.float32)


def sediment(name, **attributes):
    return {"type": "sediment", "sediment": name, **attributes}


@pytest.mark.parametrize("scene, plan", [(sidescan, "survey"), (array_sonar, "array_survey")])
@pytest.mark.parametrize("material, words", [
    (sediment("rough rock"), "rough rock at 100 kHz is too rough for the law of small slopes"),
    (sediment("medium sand", w2=0.05), "medium sand at 100 kHz is too rough"),
    ({"type": "sediment", "classes": "clay, rough rock", "sediment_class": {
        "type": "checkerboard", "color0": 0.0, "color1": 1.0}}, "rough rock at 100 kHz is too rough")])
def test_what_the_law_does_not_hold_for_is_refused_before_a_run(scene, plan, material, words):
    loaded = scene({"bed": bed(40.0, material, size=300.0)})
    with pytest.raises(ValueError, match=words):
        getattr(loaded.integrator(), plan)(loaded, loaded.sensors()[0])


def test_a_map_of_sediments_under_a_sidescan(variant):
    bitmap = {"type": "bitmap", "bitmap": mi.Bitmap(HALVES[..., None]), "raw": True, "filter_type": "nearest",
              "wrap_mode": "clamp"}
    painted = {"type": "sediment", "classes": "clay, sandy gravel", "sediment_class": bitmap,
               "class_border": 0.0}
    level = {name: render(sidescan({"bed": bed(40.0, material, size=300.0)}, rays=20_000))[1]
             for name, material in (("map", painted), ("clay", sediment("clay")),
                                    ("gravel", sediment("sandy gravel")))}
    port, starboard = 0, 1
    heard = slice(300, 900)
    for side, name in ((port, "clay"), (starboard, "gravel")):
        apart = 10 * np.log10(level["map"][side, heard] / level[name][side, heard])
        assert np.abs(apart).max() < 1e-3
    assert np.median(10 * np.log10(level["gravel"] / level["clay"])[:, heard]) > 5
