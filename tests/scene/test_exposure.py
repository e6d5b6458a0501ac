"""The share of an object's facing surface that a sonar could see: closed forms of half-buried bodies and of walls.

256 points an object leave 3 % of chance (one standard deviation of a share of 3/4 of 128 facing points is 4 %): 0.12.
"""
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.scene.geometry import Geometry
from mitsonar.scene.shadows.exposure import exposed_shares

CHANCE = 0.12


def shares(shapes, places):
    """Exposed share by name of the objects of a scene with a level bed at 0 m."""
    ahead = mi.ScalarTransform4f
    scene = mi.load_dict({"type": "scene", **{name: shape(ahead) for name, shape in shapes.items()},
                          "bed": {"type": "seabed", "depth": 0.0, "length": 60.0, "width": 60.0, "spacing": 2.0,
                                  "sand": {"type": "lambert", "mu_db": -25.0}}}, optimize=False)
    geometry = Geometry(scene)
    labels = {label: name for label, name in geometry.labels.items() if name in shapes}
    found = exposed_shares(geometry, list(labels), np.array(places, float))
    return {labels[label]: share for label, share in found.items()}


def cube(x, z, half=1.0):
    return lambda to: {"type": "cube", "to_world": to().translate([x, 0, z]).scale(half)}


@pytest.mark.parametrize("height", [0.0, 1.0, -1.2])
def test_a_cube_shows_what_stands_out_of_the_bed(variant, height):
    """Seen from the east and above, its top (4 m²) and one side of which (height + 1) m of 2 stand out."""
    expected = (4 + 2 * (height + 1)) / 8 if height > -1 else 0.0
    found = shares({"box": cube(0, height)}, [[20, 0, 20]])["box"]
    assert found == pytest.approx(expected, abs=CHANCE if 0 < expected < 1 else 1e-9)


def test_a_half_buried_ball_shows_all_of_its_facing_side_but_a_lune(variant):
    """Between the plane of the bed and that across a line of sight at 45 degrees: 1 - 45/180."""
    found = shares({"ball": lambda to: {"type": "sphere", "center": [0, 0, 0], "radius": 1.0}}, [[20, 0, 20]])["ball"]
    assert found == pytest.approx(0.75, abs=CHANCE)


def test_what_stands_behind_a_wall_is_hidden_from_the_nearest_place_alone(variant):
    wall = {"wall": lambda to: {"type": "cube", "to_world": to().translate([4, 0, 4]).scale([0.1, 20, 4])},
            "box": cube(0, 1)}
    behind = shares(wall, [[9, 0, 4], [-30, 0, 4]])
    assert behind["box"] < 0.05 and behind["wall"] > 0.9
    assert shares(wall, [[30, 0, 4], [-9, 0, 4]])["box"] > 0.95
