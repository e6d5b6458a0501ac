"""A bin of a sidescan has an object's label only where the object's main lobe meets it."""
import numpy as np

import mitsonar

SCENE = """<scene version="3.0.0">
    <integrator type="sonar_path"><integer name="rays" value="8000"/></integrator>
    <shape type="seabed" id="seabed">
        <float name="depth" value="12"/> <float name="length" value="40"/> <float name="width" value="70"/>
        <float name="spacing" value="5"/> <bsdf type="lambert"><float name="mu_db" value="-75"/></bsdf>
    </shape>
    <shape type="cube" id="box">
        <transform name="to_world"><scale value="1"/><translate x="16" y="0" z="-11"/></transform>
        <bsdf type="lambert"><float name="mu_db" value="-5"/></bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <integer name="pings" value="21"/> <point name="start" x="0" y="-10" z="-4"/>
        <float name="ping_rate_hz" value="5"/>
        <float name="speed_knots" value="9.72"/> <float name="beam_width_deg" value="2"/>
        <float name="sidelobe_db" value="-20"/>
        <medium type="seawater"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="30"/> <integer name="bins" value="150"/></film>
    </sensor>
</scene>"""


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
