"""A scene of a synthetic aperture whose raw echoes are made in a blink, as text."""

TEXT = """<scene version="3.0.0">
    <default name="pings" value="4"/>
    <integrator type="sonar_path"><float name="cell" value="0.5"/></integrator>
    <sensor type="synthetic_aperture" id="sonar">
        <string name="preset" value="minehunting_300khz"/>
        <integer name="receivers" value="4"/> <integer name="banks" value="1"/> <float name="pulse_ms" value="0.2"/>
        <integer name="pings" value="$pings"/> <float name="speed_knots" value="3"/>
        <point name="start" x="0" y="0" z="-10.3"/>
        <medium type="seawater" id="water"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range_min" value="20"/><float name="range" value="22"/></film>
    </sensor>
    <shape type="seabed" id="bed">
        <float name="depth" value="20.2"/> <float name="length" value="80"/> <float name="width" value="80"/>
        <float name="spacing" value="5"/> <bsdf type="lambert"/>
    </shape>
    <shape type="point_target" id="ball">
        <point name="position" x="18" y="0.3" z="-20.2"/><float name="target_strength_db" value="0"/>
    </shape>
</scene>
"""
