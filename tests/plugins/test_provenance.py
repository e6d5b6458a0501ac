"""Where a result comes from: scenes by name, and what was altered after loading."""
import pytest

import mitsonar

SMALL = {"pings": 2, "rays": 2000, "bins": 40}


def test_scenes_that_come_with_mitsonar_go_by_name(variant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert mitsonar.load_file("sidescan_flat", pings=7).sensors()[0].route.pings == 7
    assert mitsonar.render("sidescan_flat.xml").sizes["ping"] == 200
    with pytest.raises(FileNotFoundError, match='scene sidescan_flatt does not exist .did you mean "sidescan_flat"'):
        mitsonar.render("sidescan_flatt")


def test_a_scene_as_it_was_loaded_is_not_called_altered(variant):
    scene = mitsonar.load_file("sidescan_harbour", **SMALL)
    assert [mitsonar.render(scene).attrs["altered"] for _ in range(2)] == [[], []]


def test_a_scene_that_was_altered_says_so(variant):
    import drjit as dr
    import mitsuba as mi

    scene = mitsonar.load_file("sidescan_targets", **SMALL)
    parameters = mi.traverse(scene)
    parameters["sand.strength"] *= 2
    parameters["sphere.to_world"] = mi.Transform4f().translate([0, 0, 0.5]) @ parameters["sphere.to_world"]
    corners = dr.unravel(mi.Point3f, parameters["boulder.vertex_positions"])
    corners.z += 0.25
    parameters["boulder.vertex_positions"] = dr.ravel(corners)
    parameters["wreck.vertex_positions"] = parameters["wreck.vertex_positions"] + 0   # another array, the same
    parameters.update()
    image = mitsonar.render(scene)
    assert image.attrs["altered"] == ["boulder.vertex_positions", "sand.strength", "sphere.to_world"]
    signals = mitsonar.element_signals(mitsonar.load_file("forward_looking", elements=2, range=10, cell=1))
    assert signals.attrs["altered"] == []


def test_of_a_scene_that_mitsuba_loaded_nothing_is_known(variant):
    import mitsuba as mi

    from mitsonar.io.scene_files import scenes

    scene = mi.load_file(scenes.find("sidescan_flat"), optimize=False, pings="2", rays="2000", bins="40")
    assert mitsonar.render(scene).attrs["altered"] is None
