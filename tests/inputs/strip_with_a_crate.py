"""A strip of a synthetic aperture of half a metre by three, with a crate, as the text of a scene."""

TEXT = """<scene version="3.0.0">
    <default name="bed_seed" value="1"/>
    <integrator type="sonar_path"><float name="cell" value="0.2"/></integrator>
    <sensor type="synthetic_aperture" id="sonar">
        <string name="preset" value="minehunting_300khz"/>
        <float name="pulse_ms" value="1"/>
        <integer name="receivers" value="8"/>
        <integer name="banks" value="1"/>
        <integer name="overlap" value="2"/>
        <integer name="pings" value="5"/>
        <point name="start" x="0" y="0" z="-12"/>
        <float name="heading_deg" value="0"/>
        <boolean name="noise" value="true"/>
        <float name="image_spacing" value="0.03"/>
        <medium type="seawater" id="water"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="18"/><float name="range_min" value="15"/></film>
    </sensor>
    <bsdf type="lambert" id="sand"><float name="mu_db" value="-25"/></bsdf>
    <shape type="seabed" id="seabed">
        <float name="depth" value="20.3"/><float name="length" value="10"/><float name="width" value="60"/>
        <float name="spacing" value="0.5"/><integer name="seed" value="$bed_seed"/>
        <float name="fractal_rms" value="0.01"/>
        <ref id="sand"/>
    </shape>
    <shape type="cube" id="crate">
        <transform name="to_world"><scale x="0.2" y="0.1" z="0.2"/><translate x="13" y="0.1" z="-20.2"/></transform>
        <ref id="sand"/>
    </shape>
</scene>
"""
