"""Small scenes of beds that inversions look for, and images of them."""
import mitsonar  # noqa: F401  isort: skip
import mitsuba as mi
import numpy as np

BED, STRENGTH = "bed.vertex_positions", "bed.bsdf.strength"
SCENE = """
<scene version="3.0.0">
    <default name="rays" value="1500"/> <default name="depth" value="20"/> <default name="mu_db" value="-20"/>
    <default name="speckle" value="false"/> <default name="slope" value="0"/> <default name="bump" value="0"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="$depth"/> <float name="length" value="48"/> <float name="width" value="24"/>
        <float name="spacing" value="2"/> <float name="slope_deg" value="$slope"/>
        <float name="sine_wavelength" value="16"/> <float name="sine_height" value="$bump"/>
        <float name="sine_heading_deg" value="40"/>
        <bsdf type="lambert" id="sand"><float name="mu_db" value="$mu_db"/></bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <float name="beam_width_deg" value="2"/> <float name="pulse_ms" value="0.13"/>
        <string name="recorder" value="none"/>
        <integer name="pings" value="11"/>
        <float name="ping_rate_hz" value="0.8"/> <float name="speed_knots" value="3.11"/>
        <float name="heading_deg" value="90"/>
        <point name="start" x="-10" y="0" z="-10"/> <boolean name="speckle" value="$speckle"/>
        <medium type="seawater"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="24"/> <integer name="bins" value="200"/></film>
    </sensor>
</scene>
"""


def scene(folder, **parameters):
    path = folder / "bed.xml"
    path.write_text(SCENE)
    return mitsonar.load_file(path, **parameters)


def model(opened, *keys, seed=5):
    from mitsonar.verbs.gradients import scene_model

    return scene_model(opened, keys, seed=seed)


def looked(opened, looks, seed=70):
    """An image that is the mean of several draws of speckle."""
    images = [mitsonar.render(opened, seed=seed + look) for look in range(looks)]
    mean = np.mean([10 ** (image["level"].values.astype(float) / 10) for image in images], 0)
    return images[0].assign(level=(images[0]["level"].dims, 10 * np.log10(mean)))


def vertices(opened):
    return np.array(mi.traverse(opened)[BED]).reshape(-1, 3)
