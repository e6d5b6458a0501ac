"""Small scenes that gradients are tried on."""
from __future__ import annotations

WATERS = {"uniform": '<float name="sound_speed" value="1500"/>',
          "thermocline": '<string name="profile" value="0:1492, 18:1490, 24:1478, 30:1474, 50:1474"/>'}
WAVES = ('<float name="sine_wavelength" value="16"/> <float name="sine_height" value="0.4"/> '
         '<float name="sine_heading_deg" value="70"/>')
BED = """<shape type="seabed" id="bed">
        <float name="depth" value="30"/> <float name="length" value="24"/> <float name="width" value="70"/>
        <float name="spacing" value="1"/> {waves}
        <bsdf type="lambert"><float name="mu_db" value="-25"/></bsdf>
    </shape>"""


def sidescan(water: str = "uniform", *, rays: int = 20_000, pings: int = 4, more: str = "", sonar: str = "",
             integrator: str = "", waves: str = WAVES) -> str:
    """A scene file: a sidescan 12 m above a wavy bed, all lit."""
    return f"""<scene version="3.0.0">
    <integrator type="sonar_path"><integer name="rays" value="{rays}"/>{integrator}</integrator>
    {BED.format(waves=waves)} {more}
    <sensor type="sidescan" id="sonar">
        <integer name="pings" value="{pings}"/> <point name="start" x="0" y="-4" z="-18"/>
        <float name="speed_knots" value="3"/> {sonar}
        <medium type="seawater" id="water">{WATERS[water]}</medium>
        <film type="sonar_film"><float name="range" value="34"/> <integer name="bins" value="100"/></film>
    </sensor>
</scene>"""


def forward_looking(water: str = "uniform") -> str:
    """A scene file: a forward-looking sonar 6 m above a wavy bed."""
    return f"""<scene version="3.0.0">
    <integrator type="sonar_path"/>
    <shape type="seabed" id="bed">
        <float name="depth" value="12"/> <float name="length" value="60"/> <float name="width" value="60"/>
        <float name="spacing" value="0.5"/>
        <float name="sine_wavelength" value="8"/> <float name="sine_height" value="0.2"/>
        <bsdf type="lambert"><float name="mu_db" value="-25"/></bsdf>
    </shape>
    <sensor type="forward_looking" id="sonar">
        <integer name="pings" value="2"/> <point name="start" x="0" y="-20" z="-6"/>
        <float name="speed_knots" value="2"/> <float name="frequency_khz" value="200"/>
        <string name="pulse" value="cw"/> <float name="pulse_ms" value="0.1"/> <integer name="beams" value="16"/>
        <medium type="seawater">{WATERS[water]}</medium>
        <film type="sonar_film"><float name="range" value="25"/> <integer name="bins" value="400"/></film>
    </sensor>
</scene>"""
