"""Meshes of a sample: those that its scene shows, however they come into it, with their licences."""
import hashlib
from pathlib import Path

import mitsonar
from mitsonar.sweep.meshes import meshes_of

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SCENE = """<scene version="3.0.0">
    <default name="wreck" value="hull.ply"/>
    <shape type="ply" id="wreck.old"><string name="filename" value="$wreck"/></shape>
    <shape type="moving" id="diver.1">
        <shape type="obj"><string name="filename" value="kick.obj"/></shape>
    </shape>
    <shape type="sphere" id="mine"/>
    <include filename="more.xml"/>
</scene>"""


class Bare:
    def shapes(self):
        return []


def test_targets_that_were_placed_and_shapes_that_are_files(variant):
    path = str(SCENES / "divers.xml")
    scene = mitsonar.load_file(path, bed_spacing=0.2, mines="1", clutter="2", divers="1", target_seed=3)
    found = meshes_of(scene, path, {})
    placed = {place["species"] for shape in scene.shapes() for place in getattr(shape, "placed", {}).values()}
    assert {entry["mesh"] for entry in found} == placed - {"rounded_stone", "angular_stone"} and "diver" in placed
    diver = next(entry for entry in found if entry["mesh"] == "diver")
    assert diver["class"] == "diver" and diver["licence"] == "BSD-3-Clause"
    assert diver["sha256"] == hashlib.sha256((SCENES / "meshes" / "diver.ply").read_bytes()).hexdigest()


def test_files_of_the_scene_by_parameters_in_other_shapes_and_in_other_files(tmp_path):
    for name in ("hull.ply", "barge.ply", "kick.obj", "pier.ply"):
        (tmp_path / name).write_text(name)
    (tmp_path / "meshes.toml").write_text('licence = "MIT"\n[barge]\nauthor = "B"\n')
    (tmp_path / "more.xml").write_text('<scene version="3.0.0"><shape type="ply" id="pier">'
                                       '<string name="filename" value="pier.ply"/></shape></scene>')
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    found = meshes_of(Bare(), str(path), {"wreck": "barge.ply"})
    assert [(entry["mesh"], entry["class"], entry["author"]) for entry in found] == [
        ("barge", "wreck", "B"), ("kick", "diver", "not stated"), ("pier", "pier", "not stated")]
    assert {entry["licence"] for entry in found} == {"MIT"}
