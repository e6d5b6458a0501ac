"""Beds whose facets join the tree when rays ask: hits, shadows and pictures are those of the whole tree, exactly."""
import mitsuba as mi
import numpy as np

import mitsonar
from mitsonar.scene.loading import load_to_render
from mitsonar.scene.tracing import late_beds

FAN = {"range": 8, "beams": 32, "elements": 16, "swimmer_range": 4}


def scenes(**parameters):
    """Return a scene as loaded for users, and as loaded to be rendered."""
    late = load_to_render("divers", parameters)
    return mitsonar.load_file("divers", **parameters), late, late_beds.late_scene(late)


def straight(start, end):
    way = end - start
    length = np.linalg.norm(way, axis=1, keepdims=True)
    rays = mi.Ray3f(*(kind(*(mi.Float(np.float32(column)) for column in values.T))
                      for kind, values in ((mi.Point3f, start), (mi.Vector3f, way / length))))
    rays.maxt = mi.Float(np.float32(length[:, 0]))
    return rays


def test_lines_meet_in_a_part_of_the_bed_what_they_meet_in_the_whole(variant):
    """400 lines from above, below and along a bed of 250,000 cells, over objects, out of the bed, in random blocks."""
    whole, _, late = scenes()
    chance = np.random.default_rng(1)
    start = chance.uniform((-6, -6, -11.9), (6, 6, -10), (400, 3))
    end = chance.uniform((-6, -6, -13), (6, 6, -11.9), (400, 3))
    start[:20], end[:20] = (-30, 0, -12.05), chance.uniform((20, -1, -12.1), (30, 1, -12), (20, 3))
    known, rays = late_beds.near(late, start, end), straight(start, end)
    assert known is not late and "whole" not in vars(late), "a part of the bed does"
    found, expected = (scene.ray_intersect_preliminary(rays) for scene in (known, whole))
    met = expected.is_valid().numpy()
    assert 200 < met.sum() and np.array_equal(found.is_valid().numpy(), met)
    assert np.array_equal(found.t.numpy()[met], expected.t.numpy()[met])
    assert np.array_equal(known.ray_test(rays).numpy(), met)


def test_all_rays_find_the_bed_of_a_scene_that_was_loaded_to_be_rendered(variant):
    whole, _, late = scenes()
    rays = mi.Ray3f(mi.Point3f(0.03, 3.02, -5), mi.Vector3f(0, 0, -1))
    assert late.ray_intersect_preliminary(rays).t == whole.ray_intersect_preliminary(rays).t


def test_a_picture_does_not_depend_on_who_loads_the_scene(variant):
    """Vertical rays meet nodes, where distances to facets differ in the last bit: these, too, are the same."""
    whole, late, _ = scenes(**FAN)
    expected, image = mitsonar.render(whole, seed=1), mitsonar.render(late, seed=1)
    for name in expected.variables:
        assert image[name].values.tobytes() == expected[name].values.tobytes(), name
    assert image.attrs["objects"] == expected.attrs["objects"] and not image.attrs["altered"]


def test_only_scenes_to_be_rendered_come_late(variant):
    assert isinstance(late_beds.late_scene(mitsonar.load_file("divers")), mi.Scene)
