"""Where targets lie and how they are turned, from one sidescan image: errors before and after, by target.

    python tests/benchmarks/poses.py [--scenes box wedge cylinder] [--looks 1 4] [--exact]

Data differ from the model: other rays (5 times as many), facets' normals, bed and target 1 dB stronger, 5 cm of
navigation error in each direction that varies over some 10 pings, speckle, receiver noise. With ``--exact`` navigation
and level are right. The box stands on the bed, the cylinder is half buried, the wedge a quarter. A pose is told about
the track that is believed: what the track is off on average beside the target, the pose is off.
"""
import argparse
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np
from looks import jittered, looked, stronger

SCENE = """
<scene version="3.0.0">
    <default name="rays" value="6000"/> <default name="speckle" value="true"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="20"/> <float name="length" value="60"/> <float name="width" value="60"/>
        <float name="spacing" value="2"/>
        <bsdf type="lambert" id="sand"><float name="mu_db" value="-22"/></bsdf>
    </shape>
    <shape type="obj" id="target"> <string name="filename" value="target.obj"/>
        <boolean name="face_normals" value="true"/>
        <bsdf type="lambert" id="steel"><float name="mu_db" value="-14"/></bsdf></shape>
    <sensor type="sidescan" id="sonar">
        <float name="beam_width_deg" value="1.5"/> <float name="pulse_ms" value="0.1"/>
        <float name="ping_rate_hz" value="4"/> <integer name="pings" value="{pings}"/>
        <string name="track" value="{track}.csv"/>
        <boolean name="speckle" value="$speckle"/> <medium type="seawater">{water}</medium>
        <film type="sonar_film"><float name="range" value="30"/> <integer name="bins" value="300"/></film>
    </sensor>
</scene>
"""
UNIFORM = '<float name="sound_speed" value="1490"/>'
SUMMER = f'<string name="cast" value="{measuring.SUMMER}"/>'
VERTICES, TRACK = "target.vertex_positions", "sonar.position_offset"
STRENGTHS = ["bed.bsdf.strength", "target.bsdf.strength"]
# sonar's height [m], water, middle of the target, start's error: east, north, up [m], yaw, pitch, roll [rad]
SCENES = {"box": (9.0, UNIFORM, (0.3, 11.0, -19.2), (0.35, -0.3, 0.03, 0.2, 0.03, -0.02)),
          "wedge": (7.0, SUMMER, (-0.5, 14.0, -19.4), (-0.3, 0.25, -0.05, -0.15, -0.03, 0.02)),
          "cylinder": (8.0, UNIFORM, (0.4, 9.0, -20.0), (0.25, 0.35, 0.06, 0.2, 0.02, 0.04))}
HEADS = ["target", "looks", "place before [m]", "after", "told", "yaw before [deg]", "after", "told", "height, tilts",
         "s CPU", "misfit"]


def mesh(name):
    """Vertices about their middle and faces of a target."""
    if name == "box":
        corner = np.stack(np.meshgrid([-1, 1], [-1.5, 1.5], [-0.8, 0.8], indexing="ij"), -1).reshape(-1, 3)
        faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                 (0, 6, 4), (1, 5, 7), (1, 7, 3)]
        return corner, faces
    if name == "wedge":
        corner = np.array([(-1.6, y, z) for y, z in ((-1, -0.8), (1.2, -0.8), (0.2, 0.8))]
                          + [(1.6, y, z) for y, z in ((-1, -0.8), (1.2, -0.8), (0.2, 0.8))], float)
        faces = [(0, 2, 1), (3, 4, 5), (0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4), (2, 0, 3), (2, 3, 5)]
        return corner, faces
    turns = np.arange(24) * np.pi / 12
    ring = np.stack([0 * turns, 0.7 * np.cos(turns), 0.7 * np.sin(turns)], 1)
    corner = np.concatenate([ring - [2, 0, 0], ring + [2, 0, 0], [[-2, 0, 0], [2, 0, 0]]])
    faces = []
    for one, other in zip(range(24), np.roll(np.arange(24), -1)):
        faces += [(one, other + 24, other), (one, one + 24, other + 24), (48, one, other), (49, other + 24, one + 24)]
    return corner, faces


def written(path, corner, faces):
    rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corner]
    rows += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    path.write_text("\n".join(rows) + "\n")


def main(argv=None):
    """Fit and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--looks", nargs="+", type=int, default=[1, 4])
    parser.add_argument("--pings", type=int, default=17)
    parser.add_argument("--rays", type=int, default=6000, help="of the model")
    parser.add_argument("--seed", type=int, default=1, help="of the navigation's error and of speckle")
    parser.add_argument("--exact", action="store_true", help="navigation and level are right")
    parser.add_argument("--verbose", action="store_true")
    parser.add_argument("--quick", action="store_true", help="a step")
    given = parser.parse_args(argv)
    with tempfile.TemporaryDirectory() as folder:
        measuring.table(HEADS, [fitted(name, looks, given, Path(folder)) for name in given.scenes
                                for looks in given.looks])


def opened(folder, name, kind, given, **parameters):
    """Load the scene along the track that is believed, or along the true one."""
    import mitsonar

    height, water = SCENES[name][:2]
    places = np.column_stack([0.5 * (np.arange(given.pings) - (given.pings - 1) / 2), np.zeros(given.pings),
                              np.full(given.pings, height - 20.0)])
    if kind == "data" and not given.exact:
        jittered(places, 90.0, 4.0, folder / "data.csv", given.seed)
    else:
        way = np.column_stack((np.arange(given.pings) / 4.0, places, np.tile([0, 0, 90.0], (given.pings, 1))))
        np.savetxt(folder / f"{kind}.csv", way, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="")
    path = folder / f"{kind}.xml"
    path.write_text(SCENE.format(pings=given.pings, track=kind, water=water))
    return mitsonar.load_file(path, **parameters)


def fitted(name, looks, given, folder):
    """Return a row of the table."""
    import mitsonar  # noqa: F401  isort: skip: it comes before Mitsuba
    import mitsuba as mi

    from mitsonar.inversion.images.image_fit import Stage
    from mitsonar.inversion.images.pose import STAGES, TurnedModel, fit_pose
    from mitsonar.verbs.gradients import scene_model

    middle, off = SCENES[name][2:]
    corner, faces = mesh(name)
    written(folder / "target.obj", corner + middle, faces)
    data = opened(folder, name, "data", given, rays=5 * given.rays)
    parameters = mi.traverse(data)
    if not given.exact:
        for key in STRENGTHS:
            stronger(parameters, key)
    truth = np.array(off)
    moved = TurnedModel(VERTICES).bound(np.array(parameters[VERTICES]).reshape(-1, 3), "m").inner(truth)
    parameters[VERTICES] = mi.Float(moved.ravel().astype(np.float32))
    parameters.update()
    image = looked(data, looks, 700 + 50 * given.seed)
    keys = [] if given.exact else STRENGTHS
    offsets = None if given.exact else TRACK
    model = scene_model(opened(folder, name, "model", given, rays=given.rays),
                        [VERTICES, *keys, *([offsets] if offsets else [])], seed=3)
    begun = time.process_time()
    fit = fit_pose(model, image, VERTICES, looks=looks, farthest=25.0, strengths=keys, track=offsets,
                   stages=[Stage(bins=6, steps=1, products=2)] if given.quick else STAGES)
    seconds = time.process_time() - begun
    wrong, told = fit["pose"].values - truth, fit["pose_deviation"].values
    place = [np.hypot(*one[:2]) for one in (truth, wrong, told)]
    yaw = [np.rad2deg(abs(one[3])) for one in (truth, wrong, told)]
    if given.verbose:
        print(name, "east, north, up, yaw, pitch, roll off", wrong.round(3), "told", told.round(3))
    rest = ", ".join(f"{value:+.2f}" for value in [wrong[2], *np.rad2deg(wrong[4:])])
    return [name, str(looks), *(f"{one:.3f}" for one in place), *(f"{one:.2f}" for one in yaw), rest,
            f"{seconds:.1f}", f"{fit['misfit'].values[0]:.2f} -> {fit['misfit'].values[-1]:.2f}"]


if __name__ == "__main__":
    main()
