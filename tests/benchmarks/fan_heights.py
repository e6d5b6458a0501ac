"""Heights of a bed from a few frames of a forward-looking sonar: errors before and after, by relief.

    python tests/benchmarks/fan_heights.py [--scenes waves relief mound] [--pings 5]

Data differ from the model: they are coherent frames of the beam domain, with the speckle of single scatterers, facets'
normals, receiver noise, a bed 1 dB stronger and 5 cm of navigation error in each direction. The fit begins with a level
bed at the mean depth. Errors are those of nodes that the frames told: half of the prior's variance has gone there.
"""
import argparse
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np
from looks import jittered, looked, rms, stronger

SCENE = """
<scene version="3.0.0">
    <default name="rays" value="10000"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="12"/> <float name="length" value="36"/> <float name="width" value="36"/>
        <float name="spacing" value="1.5"/> {relief}
        <bsdf type="lambert" id="sand"><float name="mu_db" value="-25"/></bsdf>
    </shape>
    <sensor type="forward_looking" id="sonar">
        <integer name="pings" value="{pings}"/> <float name="ping_rate_hz" value="1"/>
        <string name="track" value="{track}.csv"/>
        <float name="frequency_khz" value="200"/> <string name="pulse" value="cw"/> <float name="pulse_ms" value="0.1"/>
        <integer name="beams" value="32"/>
        <medium type="seawater"><string name="cast" value="{water}"/></medium>
        <film type="sonar_film"><float name="range" value="20"/> <integer name="bins" value="250"/></film>
    </sensor>
</scene>
"""
RELIEFS = {"waves": {"sine_wavelength": 10, "sine_height": 0.6, "sine_heading_deg": 30},
           "relief": {"fractal_rms": 0.3, "fractal_gamma": 3.5, "fractal_outer_scale": 15}, "mound": {}}
BED, STRENGTH = "bed.vertex_positions", "bed.bsdf.strength"
HEADS = ["relief", "told nodes", "error before [m]", "after", "told", "misfit", "s CPU"]


def main(argv=None):
    """Fit and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=list(RELIEFS), default=list(RELIEFS))
    parser.add_argument("--pings", type=int, default=5)
    parser.add_argument("--iterations", type=int, default=3)
    parser.add_argument("--verbose", action="store_true", help="say what was observable")
    given = parser.parse_args(argv)
    rows = []
    for name in given.scenes:
        with tempfile.TemporaryDirectory() as folder:
            rows.append(fitted(name, given, Path(folder)))
    measuring.table(HEADS, rows)


def opened(folder, kind, given, relief, **parameters):
    """Load the scene along the track that is believed, or along the true one."""
    import mitsonar

    places = np.column_stack([np.zeros(given.pings), np.arange(given.pings) - 12.0, np.full(given.pings, -6.0)])
    if kind == "data":
        jittered(places, 0.0, 1.0, folder / "data.csv", 6)
    else:
        way = np.column_stack((np.arange(given.pings), places, np.zeros((given.pings, 3))))
        np.savetxt(folder / f"{kind}.csv", way, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="")
    shape = " ".join(f'<float name="{key}" value="{value}"/>' for key, value in relief.items())
    path = folder / f"{kind}.xml"
    path.write_text(SCENE.format(pings=given.pings, track=kind, relief=shape, water=measuring.SUMMER))
    return mitsonar.load_file(path, **parameters)


def fitted(name, given, folder):
    """Return a row of the table."""
    import mitsonar  # noqa: F401  isort: skip: it comes before Mitsuba
    import mitsuba as mi

    from mitsonar.inversion.fitting.iteration import Stopping
    from mitsonar.inversion.images.scene_fit import KeyPrior, fit_scene

    data = opened(folder, "data", given, RELIEFS[name], rays=60000)
    parameters = mi.traverse(data)
    stronger(parameters, STRENGTH)
    truth = np.array(parameters[BED]).reshape(-1, 3)
    if name == "mound":
        truth[:, 2] += np.exp(-((truth[:, 0] - 2) ** 2 + truth[:, 1] ** 2) / 18)
        parameters[BED] = mi.Float(truth.ravel().astype(np.float32))
    parameters.update()
    image = looked(data, 1)
    scene = opened(folder, "model", given, {})
    begun = time.process_time()
    strength = float(np.asarray(mi.traverse(scene)[STRENGTH]).ravel()[0])
    fit = fit_scene(scene, image, [KeyPrior(key="bed.heights", deviation=0.3),
                                   KeyPrior(key=STRENGTH, deviation=0.3 * strength)], length=3.0, seed=3,
                    stopping=Stopping(iterations=given.iterations, noise=None), directions=40)
    seconds = time.process_time() - begun
    found = fit.to_dataset()
    if given.verbose:
        print(*fit.sentences(), sep="\n")
    start = found["bed.heights_start"].values.ravel()
    heights = found["bed.heights"].values.ravel()
    told = found["bed.heights_resolved"].values.ravel() > 0.5
    deviation = found["bed.heights_deviation"].values.ravel()
    off = truth[:, 2]
    return [name, str(int(told.sum())), f"{rms((start - off)[told]):.3f}", f"{rms((heights - off)[told]):.3f}",
            f"{rms(deviation[told]):.3f}", f"{found['deviance'].values[0]:.2f} -> {found['deviance'].values[-1]:.2f}",
            f"{seconds:.1f}"]


if __name__ == "__main__":
    main()
