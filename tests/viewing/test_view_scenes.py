"""What a page of a scene shows before it is rendered, read back by rerun's own reader: bed, objects, track, swath.

The bed of the small scene is level, 30 m deep; the sonar 10 m deep and the record 60 m long, so that the swath ends
sqrt(60² - 20²) = 56.6 m away. Tolerance: a cell of the overview, 60 m / 95.
"""
import numpy as np
import pytest
from read_view import entities
from small_scene import TEXT, spoilt

import mitsonar
from mitsonar.cli import main as cli

pytest.importorskip("rerun", reason="rerun-sdk is not installed")
BOX = """<shape type="cube" id="box"><transform name="to_world"><scale x="1" y="2" z="3"/>
    <translate x="25" y="0" z="-27"/></transform><ref id="sand"/></shape>
</scene>"""


@pytest.fixture
def shown(tmp_path, variant):
    """Record what a page of the small scene with a box would show, and return its entities."""
    def record(*more, **options):
        (tmp_path / "scene.xml").write_text(spoilt(("</scene>", BOX), text=TEXT), encoding="utf-8")
        mitsonar.view(tmp_path / "scene.xml", *more, save=tmp_path / "run.rrd", **options)
        return entities(tmp_path / "run.rrd")
    return record


def test_bed_and_objects_stand_where_they_are(shown):
    read = shown()
    bed, = read["/world/scene/bed"].column("Mesh3D:vertex_positions")
    np.testing.assert_allclose(np.array(bed)[:, 2], -30, atol=1e-3)
    box = read["/world/scene/objects/box/box"]
    np.testing.assert_allclose(box.column("Boxes3D:centers")[0], [[25, 0, -27]], atol=1e-4)
    np.testing.assert_allclose(box.column("Boxes3D:half_sizes")[0], [[1, 2, 3]], atol=1e-4)
    assert box.column("Boxes3D:labels") == [["box"]]


def test_the_swath_of_a_ping_ends_where_its_record_does(shown):
    read = shown(pings=3)
    sonar = np.array(read["/world/scene/sonar"].column("Transform3D:translation")[-1])[0]
    seen = np.array(read["/world/scene/seen"].column("Points3D:positions")[-1])
    away = np.linalg.norm(seen[:, :2] - sonar[:2], axis=1).max()
    assert away == pytest.approx(np.sqrt(60 ** 2 - (30 + sonar[2]) ** 2), abs=60 / 95)
    assert len(read["/world/scene/seen"].times) == 3
    rays, = read["/world/scene/rays_of_ping_1"].column("LineStrips3D:strips")
    assert all(ray[0][2] == pytest.approx(sonar[2], abs=1e-3) for ray in rays)


def test_a_scene_and_its_record_stand_in_one_space(shown, tmp_path):
    (tmp_path / "scene.xml").write_text(TEXT, encoding="utf-8")
    read = shown(mitsonar.render(tmp_path / "scene.xml"))
    for axis in ("translation", "quaternion"):
        both = [read[f"/world/{name}/sonar"].column(f"Transform3D:{axis}") for name in ("scene", "scene_2")]
        np.testing.assert_allclose(*both, atol=1e-5)


def test_a_parameter_may_have_the_name_of_an_option(tmp_path, variant):
    """The scene forward_looking has a parameter `cell`, its bed's."""
    assert cli.main(["view", "forward_looking", "-D", "cell=0.5", "--save", str(tmp_path / "run.rrd")]) == 0


def test_parameters_and_scenes_are_checked(shown, tmp_path, monkeypatch, capfd):
    (tmp_path / "broken.xml").write_text("<scene", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    for words, *arguments in (("broken.xml", "broken.xml"), ("none.xml", "none.xml"), ("range", "sidescan_flat",
                              "-D", "rnge=20"), ("other", "sidescan_flat", "--sensor", "other")):
        assert cli.main(["view", *arguments, "--save", "run.rrd"]) == 2
        out, err = capfd.readouterr()
        assert words in err and err.count("\n") == 1 and not (tmp_path / "run.rrd").exists()
    with pytest.raises(ValueError, match="only records"):
        mitsonar.view(mitsonar.render("sidescan_flat", pings=1, rays=2000), rays=2, save=tmp_path / "run.rrd")
