"""A sidescan scene that loads and renders in a blink, as text to be spoilt."""

TEXT = """<scene version="3.0.0">
    <default name="pings" value="2"/>
    <default name="rays" value="2000"/>
    <default name="range" value="60"/>
    <default name="speckle" value="true"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <sensor type="sidescan" id="sonar">
        <integer name="pings" value="$pings"/>
        <boolean name="speckle" value="$speckle"/>
        <medium type="seawater" id="water"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="$range"/><integer name="bins" value="50"/></film>
    </sensor>
    <bsdf type="lambert" id="sand"><float name="mu_db" value="-27"/></bsdf>
    <shape type="seabed" id="bed">
        <float name="depth" value="30"/> <float name="length" value="200"/> <float name="width" value="200"/>
        <float name="spacing" value="20"/>
        <ref id="sand"/>
    </shape>
</scene>
"""


def spoilt(*edits, text=TEXT):
    """A scene's text with every (old, new) of `edits` replaced; an old one that is not there is the test's mistake."""
    for old, new in edits:
        assert old in text, f"the scene has no {old}"
        text = text.replace(old, new)
    return text
