"""A bin of a sidescan has an object's label only where the object's main lobe meets it."""
import numpy as np
from scene_text import lambert, plugin, scene_text

import mitsonar

SCENE = scene_text(
    plugin("shape", "seabed", "seabed", lambert(-75), depth=12.0, length=40.0, width=70.0, spacing=5.0),
    plugin("shape", "cube", "box", lambert(-5),
           '<transform name="to_world"><scale value="1"/><translate x="16" y="0" z="-11"/></transform>'),
    plugin("sensor", "sidescan", "sonar", plugin("medium", "seawater", sound_speed=1500.0),
           plugin("film", "sonar_film", range=30.0, bins=150), pings=21, start=(0, -10, -4), ping_rate_hz=5.0,
           speed_knots=9.72, beam_width_deg=2.0, sidelobe_db=-20.0), rays=8000)


def test_side_lobes_bring_an_objects_echo_but_not_its_label(tmp_path, variant):
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    image = mitsonar.render(path, seed=1)
    box = [int(number) for number, name in image.attrs["labels"].items() if name == "box"][0]
    mine = (image["label"] == box).sel(side="starboard").values
    away = np.abs(image["y"].values) > 1 + 16 * np.tan(np.deg2rad(2))           # the lobe's edge lies a degree off
    most = image["share"].sel(shape="box", side="starboard").values > 0.5
    assert most[away].sum() > 20                                              # of a dark bed side lobes are most
    assert mine[~away].sum() > 10 and not mine[away].any()
