"""Parameters of small scenes, each alone: forward, backward and differences are one, or the check says they are not.

With 4,000 rays a ping derivatives are grainy to some per cent; with more, `mitsonar gradient-check` says what is left.
"""
import pytest
from gradient_scenes import sidescan

import mitsonar

CRATE = """<shape type="cube" id="crate">
    <transform name="to_world"><scale x="1.5" y="2" z="1"/><translate x="14" y="-3" z="-29.5"/></transform>
    <bsdf type="lambert"><float name="mu_db" value="-15"/></bsdf>
</shape>"""
BARE = '<float name="mu_db" value="-25.0"/>'
WEED = ('<float name="weed_cover" value="0.3"/> <float name="weed_size" value="8"/> '
        '<float name="weed_edge" value="3"/> <float name="glints" value="20"/>')


@pytest.mark.parametrize("water, more, keys", [
    ("uniform", "", ["bed.bsdf.strength", "sonar.medium.absorption_scale", "sonar.position_offset"]),
    ("thermocline", "", ["bed.vertex_positions", "sonar.medium.sound_speed"]),
    ("uniform", CRATE, ["crate.bsdf.strength"]), ("uniform", WEED, ["bed.vertex_positions", "bed.bsdf.strength"])])
def test_every_key_is_right_or_told(tmp_path, water, more, keys):
    path = tmp_path / "scene.xml"
    scene = sidescan(water, rays=4000, pings=2, more="" if more is WEED else more)
    path.write_text(scene.replace(BARE, BARE + WEED, 1) if more is WEED else scene)
    check = mitsonar.gradient_check(path, keys, directions=1, tolerance=0.1)
    assert not check.wrong, check.text()
    assert all(row.verdict in ("right", "undecided") and row.asymmetry < 1e-2 for row in check.rows), check.text()
