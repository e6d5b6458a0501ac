"""The frozen ray against BELLHOP: travel times through water that changes across, by a ray tracer that is not ours.

    python -m venv OTHER; OTHER/bin/pip install pelagic
    python tests/benchmarks/bellhop_field.py --python OTHER/bin/python

BELLHOP (Porter, 2011) marches rays through quadrilaterals of sound speed ('Q'), here 1 m by 0.25 m. It runs in a
process of its own, under another Python that has `pelagic`. The time of the eigenray is found between neighbouring rays
of a fine fan. Beside it stand our own shooting (`tests/propagation/test_frozen_ray.py`) and the frozen ray with its
bending.
"""
import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

STEP = 0.25                        # [m] of BELLHOP's rays
DEPTHS, RANGES = np.arange(0, 100.01, 0.25), np.arange(0, 420.1, 1.0)
FANS = (9.0, 181), (0.4, 41), (0.02, 21)     # half widths [degrees] and rays, each about the last one's eigenray


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", help="a Python that has pelagic")
    parser.add_argument("--rays", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args(argv)
    if arguments.rays:
        return json.dump([float(eigenray_time(**case)) for case in json.load(sys.stdin)], sys.stdout)
    if arguments.python is None:
        return print("pelagic is not here; give --python a Python that has it, as the first lines of this file say")
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "propagation"))
    import test_frozen_ray as water

    cases, kinds = [], ["", *water.FIELDS]
    for x1, z0, z1 in water.LEGS:
        for kind in kinds:
            speed = water.speed(DEPTHS)[:, None] + 0 * RANGES
            if kind:
                speed = speed + water.FIELDS[kind][1](RANGES[None], DEPTHS[:, None])
            cases.append({"speed": speed.tolist(), "x1": x1, "z0": z0, "z1": z1})
    made = subprocess.run([arguments.python, __file__, "--rays"], input=json.dumps(cases), capture_output=True,
                          text=True, check=True, timeout=1800)
    times = np.array(json.loads(made.stdout)).reshape(len(water.LEGS), len(kinds))
    print(f"{'field':15}{'m':>5}{'to':>4}{'effect us':>11}{'shooting - BELLHOP ns':>23}{'frozen ray - BELLHOP ns':>25}")
    for number, kind in enumerate(kinds[1:], 1):
        for (x1, z0, z1), row in zip(water.LEGS, times):
            effect = row[number] - row[0]
            shot = water.exact(kind, 0, z0, x1, z1) - water.exact("", 0, z0, x1, z1)
            frozen = water.frozen(kind, x1, z0, z1).later[0]
            print(f"{kind:15}{x1:5}{z1:4}{1e6 * effect:11.3f}{1e9 * (shot - effect):23.1f}"
                  f"{1e9 * (frozen - effect):25.1f}")


def eigenray_time(speed, x1, z0, z1):
    """Return BELLHOP's travel time [s] from a depth to a place, through sound speed (depths, ranges)."""
    middle = np.degrees(np.arctan2(z1 - z0, x1))
    for width, rays in FANS:
        angle, depth, time = _fan(np.array(speed), x1, z0, z1, middle + np.linspace(-width, width, rays))
        off = depth - z1
        near = np.argsort(abs(off))[:5]
        middle = float(np.polyval(np.polyfit(off[near], angle[near], 2), 0.0))
    return np.polyfit(off[near], time[near], 2)[-1]


def _fan(speed, x1, z0, z1, angles):
    """Return angles [degrees], and depths [m] and times [s] of rays where they pass a range."""
    import pelagic

    lines = ["'field'", "10000.0", "1", "'QVF'", f"2 0.0 {DEPTHS[-1]}",
             *(f"{z} {c:.12f} /" for z, c in zip(DEPTHS, speed[:, 0])), "'R' 0.0",
             "1", f"{z0} /", "1", f"{z1} /", "1", f"{x1 / 1000} /", "'R'", str(len(angles)),
             " ".join(f"{angle:.12f}" for angle in angles) + " /", f"{STEP} {DEPTHS[-1] + 1} {(x1 + 2) / 1000}"]
    with tempfile.TemporaryDirectory() as folder:
        case = Path(folder) / "field.env"
        case.write_text("\n".join(lines) + "\n")
        case.with_suffix(".ssp").write_text("\n".join([
            str(len(RANGES)), " ".join(f"{r / 1000:.9f}" for r in RANGES),
            *(" ".join(f"{c:.12f}" for c in row) for row in speed)]) + "\n")
        found = pelagic.bellhop.load(str(case)).run().rays
    passed = []
    for ray in found:
        points = ray.points if ray.points.shape[1] == 6 else ray.points.T
        after = int(np.searchsorted(points[:, 0], x1))
        if 2 <= after < len(points) - 1 and not ray.top_bounces + ray.bottom_bounces:
            part = points[after - 2:after + 2]              # cubic between four steps
            passed.append([ray.launch_angle_degrees, *(
                np.polyval(np.polyfit((part[:, 0] - x1) / STEP, part[:, k], 3), 0.0) for k in (1, 2))])
    return np.array(passed).T


if __name__ == "__main__":
    main()
