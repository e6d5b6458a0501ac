"""Plugins against the protocols that mitsonar knows them by: pyright compares them, in `plugins/contracts.py`."""
import ast
from pathlib import Path

import pytest

from mitsonar.scene import protocols, registration

PLUGINS = Path(__file__).resolve().parents[2] / "plugins"
WITHOUT_PROTOCOL = {"shapes.capped_cylinder"}          # a mesh as any other of Mitsuba's


def compared():
    """Modules of the plugins whose classes stand in an assignment of `plugins/contracts.py`."""
    tree = ast.parse((PLUGINS / "contracts.py").read_text(encoding="utf-8"))
    module_of = {alias.name: node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level
                 for alias in node.names}
    used = {name.id for node in ast.walk(tree) if isinstance(node, ast.AnnAssign) and node.value is not None
            for name in ast.walk(node.value) if isinstance(name, ast.Name)}
    return {module for name, module in module_of.items() if name in used}


def test_every_plugin_is_compared_with_its_protocol():
    assert compared() >= set(registration.PLUGINS) - WITHOUT_PROTOCOL


@pytest.mark.parametrize("material, smooth", [
    ({"type": "lambert"}, False), ({"type": "sediment", "sediment": "medium sand"}, False),
    ({"type": "windy_sea"}, False), ({"type": "rigid"}, True), ({"type": "impedance", "density": 1900.0,
                                                                "sound_speed": 1700.0}, True)])
def test_materials_of_mitsonar_are_recognised(variant, material, smooth):
    import mitsuba as mi

    bsdf = mi.load_dict(material)
    assert protocols.sound_material(bsdf) is bsdf
    assert protocols.smooth_material(bsdf) is (bsdf if smooth else None)


def test_objects_of_mitsuba_are_none_of_mitsonars(variant):
    import mitsuba as mi

    assert protocols.sound_material(mi.load_dict({"type": "diffuse"})) is None
    sphere = mi.load_dict({"type": "sphere"})
    assert protocols.target_shape(sphere) is None and protocols.parted_shape(sphere) is None
    assert not (protocols.is_seabed(sphere) or protocols.is_sea_surface(sphere) or protocols.is_smooth(sphere)
                or protocols.is_mirror(sphere) or protocols.has_smooth_normals(sphere))


def test_shapes_of_mitsonar_are_recognised(variant):
    import mitsuba as mi

    bed, sea = mi.load_dict({"type": "seabed", "depth": 10.0}), mi.load_dict({"type": "sea_surface", "wind_speed": 0.0})
    target = mi.load_dict({"type": "point_target", "position": [0, 0, -5]})
    assert protocols.is_seabed(bed) and not protocols.is_seabed(sea)
    assert protocols.is_sea_surface(sea) and protocols.is_mirror(sea) and not protocols.is_sea_surface(bed)
    assert protocols.target_shape(target) is target and protocols.target_shape(bed) is None
