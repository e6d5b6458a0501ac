"""Heights of a bed and maps of sediments from one sidescan image: how wrong before and after, in what time.

    python tests/benchmarks/inversions.py                          all scenes, one look and four
    python tests/benchmarks/inversions.py --scenes waves --looks 4 --pictures FOLDER
    python tests/benchmarks/inversions.py --scenes waves relief mounds --looks 1 --water summer      in a thermocline

Data differ from the model: other rays (8 times as many), facets' normals, a bed 1 dB stronger, 5 cm of navigation
error in each direction that varies over some 10 pings, speckle, receiver noise, the recorder's steps. The fit knows
altitude by the first return and nothing of the bed's shape, or its shape and nothing of its sediments. Errors are those
of nodes within the track's length and 29 m aside, 3 m on either side of the track left out.

Priors and stages were chosen on `waves`, so that its row is no test of them; on a mound among ripples; and on one map.
`relief` and `mounds` and the three maps were not used; `rough` was, to see why a fit fails: a prior whose power fell by
k^-6 held the answer off, at 1.3 times the deviance of speckle where the truth has 0.46. Every row is one draw.
"""
import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

SCENE = """
<scene version="3.0.0">
    <default name="rays" value="5000"/> <default name="strength" value="-20"/> <default name="speckle" value="true"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="32"/> <float name="length" value="80"/> <float name="width" value="80"/>
        <float name="spacing" value="{spacing}"/> {relief}
        <bsdf type="lambert" id="sand">{strength}</bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <float name="beam_width_deg" value="1.5"/> <float name="pulse_ms" value="0.1"/>
        <float name="ping_rate_hz" value="1.5433"/> <integer name="pings" value="{pings}"/> {track}
        <boolean name="speckle" value="$speckle"/> <medium type="seawater">{water}</medium>
        <film type="sonar_film"><float name="range" value="36"/> <integer name="bins" value="320"/></film>
    </sensor>
</scene>
"""
STRAIGHT = """<point name="start" x="{x}" y="0" z="-20"/> <float name="heading_deg" value="90"/>
    <float name="speed_knots" value="3"/>"""
EVEN = '<float name="mu_db" value="$strength"/>'
PAINTED = """<texture type="bitmap" name="mu_db"><boolean name="raw" value="true"/>
    <string name="filename" value="{}"/></texture>"""
SUMMER = Path(__file__).resolve().parents[2] / "scenes" / "casts" / "summer.csv"
WATERS = {"uniform": '<float name="sound_speed" value="1480"/>', "summer": f'<string name="cast" value="{SUMMER}"/>'}
HEIGHTS = {"waves": "sine_wavelength=16 sine_height=1 sine_heading_deg=40 slope_deg=3 slope_heading_deg=30",
           "relief": "fractal_rms=0.3 fractal_gamma=3.9 fractal_outer_scale=20 slope_deg=1 slope_heading_deg=100",
           "mounds": "slope_deg=1 slope_heading_deg=320",
           "rough": "fractal_rms=0.4 fractal_gamma=3.25 fractal_outer_scale=20"}
CLASSES = {"mud": -27.0, "sand": -20.0, "gravel": -14.0}
MAPS = "bands", "patches", "cells"
BED, STRENGTH, TEXTURE = "bed.vertex_positions", "bed.bsdf.strength", "bed.bsdf.mu_db.data"
HEADS = ["scene", "looks", "error before", "after", "less its mean", "deviation told", "level", "resolved",
         "misfit of speckle", "s CPU", "s"]


def main(argv=None):
    """Fit and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=[*HEIGHTS, *MAPS], default=[*HEIGHTS, *MAPS])
    parser.add_argument("--looks", nargs="+", type=int, default=[1, 4])
    parser.add_argument("--pings", type=int, default=61)
    parser.add_argument("--spacing", type=float, default=1.0, help="of the bed's nodes [m]")
    parser.add_argument("--water", choices=list(WATERS), default="uniform")
    parser.add_argument("--quick", action="store_true", help="a step or two")
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args(argv)
    import measuring

    rows = []
    for name in given.scenes:
        for looks in given.looks:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(fitted(name, looks, given, Path(folder)))
    measuring.table(HEADS, rows)


def opened(folder, name, given, strength=EVEN, relief="", jittered=False, **parameters):
    """Load the scene, along a straight track or along one that is some centimetres off."""
    import mitsonar

    x = -(given.pings - 1) / 2
    track = STRAIGHT.format(x=x)
    if jittered:
        from scipy.ndimage import gaussian_filter1d

        off = gaussian_filter1d(np.random.default_rng(4).standard_normal((given.pings, 3)), 4, axis=0, mode="wrap")
        off *= 0.05 / off.std(0)
        count = np.arange(given.pings)
        way = np.column_stack((count / 1.543, x + count + off[:, 0], off[:, 1], -20 + off[:, 2], 0 * count, 0 * count,
                               0 * count + 90.0))
        np.savetxt(folder / "track.csv", way, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="",
                   fmt="%.5f")
        track = '<string name="track" value="track.csv"/>'
    parts = [part.split("=") for part in relief.split()]
    path = folder / f"{name}.xml"
    shape = " ".join(f'<float name="{key}" value="{value}"/>' for key, value in parts)
    path.write_text(SCENE.format(pings=given.pings, spacing=given.spacing, track=track, water=WATERS[given.water],
                                 relief=shape, strength=strength))
    return mitsonar.load_file(path, **parameters)


def looked(scene, looks):
    """An image that is the mean of draws of speckle; its rays are none of the model's."""
    import mitsonar

    images = [mitsonar.render(scene, seed=700 + look) for look in range(looks)]
    mean = np.mean([10 ** (image["level"].values.astype(float) / 10) for image in images], 0)
    return images[0].assign(level=(images[0]["level"].dims, 10 * np.log10(mean)))


def fitted(name, looks, given, folder):
    """Return a row of the table."""
    fit, truth, seen, seconds = (heights if name in HEIGHTS else sediments)(name, looks, given, folder)
    parameter = "height" if name in HEIGHTS else "strength_db"
    answer, start, deviation, resolved = (fit[f"{parameter}{part}"].values
                                          for part in ("", "_start", "_deviation", "_resolved"))
    off, unit = (answer - truth)[seen], "m" if name in HEIGHTS else "dB"
    if given.pictures:
        from mitsonar.plots.sheets.fit_sheet import fit_figure

        given.pictures.mkdir(exist_ok=True)
        drawn = fit.assign({f"{parameter}_truth": (fit[parameter].dims, truth)})
        fit_figure(drawn).savefig(given.pictures / f"{name}_{looks}.png")
    level = (f"{fit.gain_db:+.2f} dB of 1" if name in HEIGHTS
             else f"{np.mean((fit['strength_db_class'].values == nearest(truth))[seen]):.0%} right")
    poor = f"{fit.misfit_of_speckle:.2f}" if name in HEIGHTS else "-"
    return [name, str(looks), f"{rms((start - truth)[seen]):.3f} {unit}", f"{rms(off):.3f} {unit}",
            f"{np.std(off):.3f} {unit}", f"{rms(deviation[seen]):.3f} {unit}", level,
            f"{np.mean(resolved[seen] > 0.5):.0%}", poor, *(f"{one:.1f}" for one in seconds)]


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def nearest(strengths):
    return np.abs(np.array(list(CLASSES.values()))[:, None, None] - strengths).argmin(0)


def stages(given, usual):
    from mitsonar.inversion.images.image_fit import Stage

    return [Stage(bins=8, steps=1, products=2)] if given.quick else usual


def clocks():
    return np.array([time.process_time(), time.perf_counter()])


def inside(x, y, given):
    half = (given.pings - 1) / 2
    return (np.abs(x) <= half) & (np.abs(y) < 29) & (np.abs(y) > 3)


def heights(name, looks, given, folder):
    """Fit heights; give the answer, the truth, where it counts, and seconds."""
    import mitsonar  # noqa: F401  isort: skip: it comes before Mitsuba
    import mitsuba as mi

    from mitsonar.inversion.images.heights import fit_heights, grid_of
    from mitsonar.inversion.images.image_fit import COARSE_TO_FINE
    from mitsonar.verbs.gradients import scene_model

    data = opened(folder, "data", given, relief=HEIGHTS[name], jittered=True, rays=40000)
    parameters = mi.traverse(data)
    parameters[STRENGTH] = parameters[STRENGTH] * 10 ** 0.1
    positions = np.array(parameters[BED]).reshape(-1, 3)
    if name == "mounds":
        positions[:, 2] += mounds(positions[:, 0], positions[:, 1])
        parameters[BED] = mi.Float(positions.ravel().astype(np.float32))
    parameters.update()
    image = looked(data, looks)
    begun = clocks()
    model = scene_model(opened(folder, "model", given), [BED, STRENGTH], seed=3, edges=False)
    fit = fit_heights(model, image, BED, strength=STRENGTH, looks=looks, farthest=32.5,
                      stages=stages(given, COARSE_TO_FINE), modes=2 if given.quick else 60)
    seconds = clocks() - begun
    x, y, number = grid_of(positions)
    return fit, positions[number, 2], inside(x[:, None], y[None], given), seconds


def mounds(x, y):
    """Mounds and pits of 1 to 1.5 m, some with shadows [m]."""
    draw = np.random.default_rng(11)
    found = 0 * x
    for east, north, high, wide in zip(draw.uniform(-28, 28, 10), draw.uniform(-28, 28, 10),
                                       draw.uniform(0.6, 1.5, 10) * (-1) ** np.arange(10), draw.uniform(2, 4, 10)):
        found += high * np.exp(-((x - east) ** 2 + (y - north) ** 2) / (2 * wide ** 2))
    return found


def sediments(name, looks, given, folder):
    """Fit a map; as `heights`."""
    import mitsonar  # noqa: F401  isort: skip: it comes before Mitsuba
    import mitsuba as mi

    from mitsonar.inversion.images.sediment_map import STAGES, fit_sediment_map
    from mitsonar.verbs.gradients import scene_model

    count = 41
    axis = 80 * ((np.arange(count) + 0.5) / count - 0.5)
    x, y = np.meshgrid(axis, -axis)
    drawn = {"bands": np.floor((y + 6 * np.sin(x / 8)) / 14), "cells": np.floor(x / 20) + np.floor(y / 20),
             "patches": ((x - 10) ** 2 + (y - 15) ** 2 < 90) + 2.0 * ((x + 12) ** 2 + (y + 14) ** 2 < 120)}[name]
    truth = np.array(list(CLASSES.values()))[drawn.astype(int) % 3]
    mi.set_variant("llvm_ad_mono")
    for file, values in (("truth", truth + 1), ("start", np.full_like(truth, -20.0))):
        mi.Bitmap(values[:, :, None].astype(np.float32)).write(str(folder / f"{file}.exr"))
    image = looked(opened(folder, "data", given, PAINTED.format("truth.exr"), jittered=True, rays=40000), looks)
    begun = clocks()
    model = scene_model(opened(folder, "model", given, PAINTED.format("start.exr")), [TEXTURE], seed=3, edges=False)
    fit = fit_sediment_map(model, image, TEXTURE, looks=looks, classes=CLASSES, farthest=32.5,
                           stages=stages(given, STAGES), modes=2 if given.quick else 20)
    return fit, truth, inside(x, y, given), clocks() - begun


if __name__ == "__main__":
    main()
