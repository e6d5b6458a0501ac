"""Every echo that an eigenray brings is heard at every element, and what no ray brings is counted.

Points all about, at 40 to 200 m, in a thermocline and in a duct of -5/+5 1/s, where many rays turn. Truth: the earliest
arrivals of NumPy's eigenray solver, and the sonar equation: amplitude (c_h/c_0)/A, A the spreading area to the array's
centre, to 0.5 dB (found: 0.05; the rest is spreading to the elements, 0.5 m off). Where two echoes fall on each other
neither is looked at.
"""
import numpy as np
import pytest
from summer import SUMMER_TEXT

import mitsonar
from mitsonar.propagation import eigenray
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target
from mitsonar.water import SoundSpeedProfile

WATER = {"thermocline": (SUMMER_TEXT, 17.0), "duct": ("0:1600, 20:1500, 40:1600", 20.0)}
ELEMENTS, POINTS = 8, 300


def profile_of(text):
    return SoundSpeedProfile(*np.array([pair.split(":") for pair in text.split(",")], float).T)


def scene_of(places, water, depth, **sensor):
    line = {"receive": "line", "receive_elements": ELEMENTS, "receive_pitch": 1 / 7, "receive_axis": "down",
            "receive_normal": "forward"}
    return array_sonar({"bed": buried_bed(40.0, size=20.0), **{f"t{i}": point_target(p) for i, p in enumerate(places)}},
                       water={"profile": water, "absorption_db_per_km": 0.0}, film={"range": 215.0},
                       integrator={"cell": 30.0}, sensor={"start": [0.0, 0.0, -depth], **line, **sensor})


def rays(profile, depth, places, elements):
    """Eigenrays to the centre (P,) and to elements (E, P) at body positions (E, 3), heading north."""
    x, y, z = places.T
    out = eigenray(profile, depth, -z, np.hypot(x, y))
    forward, starboard, down = elements.T[:, :, None]
    return out, eigenray(profile, depth + down, -z, np.hypot(x - starboard, y - forward))


def about(rng):
    """Points all about, from near to far."""
    distance = np.linspace(40, 200, POINTS) + rng.uniform(-0.2, 0.2, POINTS)
    bearing, deep = rng.uniform(0, 2 * np.pi, POINTS), rng.uniform(2, 38, POINTS)
    return np.column_stack([distance * np.cos(bearing), distance * np.sin(bearing), -deep])


@pytest.mark.filterwarnings("ignore:.*arrivals at elements are missing")
@pytest.mark.parametrize("return_path", ["vector", "eigenray"])
@pytest.mark.parametrize("name", WATER)
def test_what_an_eigenray_reaches_is_heard_at_every_element(variant, rng, name, return_path):
    text, depth = WATER[name]
    profile = profile_of(text)
    places = about(rng)
    heard = mitsonar.impulse_response(scene_of(places, text, depth), return_path=return_path, kernel="nearest")
    elements = np.column_stack([heard[f"rx_{axis}"] for axis in "xyz"])
    out, back = rays(profile, depth, places, elements)
    sample = (out.travel_time + back.travel_time - float(heard.time[0])) * heard.attrs["sampling_rate"]
    wanted = profile.at(-places[:, 2]) / profile.at(depth) / out.spreading_area
    levels = []
    for row, places_in_row in zip(np.abs(heard.values[0, 0]), sample):
        there = np.flatnonzero(np.isfinite(places_in_row))
        whole = np.round(places_in_row[there]).astype(int)
        order = np.argsort(whole)
        apart = np.diff(whole[order], prepend=-9, append=10 ** 9)
        alone = order[(apart[1:] > 3) & (apart[:-1] > 3)]
        peak = np.max([row[whole[alone] + k] for k in (-1, 0, 1)], axis=0)
        levels.append(20 * np.log10(np.maximum(peak, 1e-30) / wanted[there[alone]]))
    levels = np.concatenate(levels)
    assert len(levels) > 800
    assert np.abs(levels).max() < 0.5


def test_what_no_ray_brings_to_an_element_is_counted_and_told(variant, rng):
    """At the edge of what once-turned rays reach in the duct the centre hears some points that not all elements do."""
    text, depth = WATER["duct"]
    profile, places = profile_of(text), about(rng)
    scene = scene_of(places, text, depth)
    with pytest.warns(UserWarning, match="arrivals at elements are missing"):
        heard = mitsonar.impulse_response(scene, return_path="eigenray")
    out, back = rays(profile, depth, places, np.column_stack([heard[f"rx_{axis}"] for axis in "xyz"]))
    missing = out.exists & ~back.exists
    assert missing.any()
    assert heard.attrs["lost_arrivals"] == missing.sum()


def test_nothing_is_told_where_nothing_is_lost(variant, recwarn):
    places = np.array([[60.0, 0.0, -30.0], [150.0, 60.0, -18.0]])
    heard = mitsonar.impulse_response(scene_of(places, SUMMER_TEXT, 17.0), return_path="eigenray")
    assert heard.attrs["lost_arrivals"] == 0
    assert not [one for one in recwarn if "missing" in str(one.message)]
