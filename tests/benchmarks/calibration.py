"""Calibrations of arrays that are off, from echoes of targets in speckle: errors before and after, by scene.

    python tests/benchmarks/calibration.py [--scenes line plane ring] [--cell 0.4]

Arrays are off by 2 mm a coordinate of each element, channels by 0.5 us (or nothing) and 20 %, navigation by 5 cm and
0.2 degrees a ping, places of targets by 5 cm, the level by 1 dB; the water that is believed is the right one. Shapes
are compared after the best shift and turn of the whole array, which is not observable.
"""
import argparse
import itertools
import tempfile
import time
from pathlib import Path

import measuring
import numpy as np

import mitsonar
from mitsonar.inversion.arrays.calibration import calibrated
from mitsonar.validation.scenes import array_sonar, bed, point_target

UNIFORM, SUMMER = {"profile": "0:1500"}, {"cast": str(measuring.SUMMER)}
LINE = np.stack([np.zeros(24), np.linspace(-0.3, 0.3, 24), np.zeros(24)], 1)
GRID = np.linspace(-0.15, 0.15, 5)
PLANE = np.stack([np.zeros(25), *(part.ravel() for part in np.meshgrid(GRID, GRID))], 1)
TURNS = np.arange(16) * np.pi / 8
RING = np.stack([0.1 * np.cos(3 * TURNS), 0.25 * np.cos(TURNS), 0.25 * np.sin(TURNS)], 1)
ARC = np.stack([0.4 - 0.4 * np.cos(np.linspace(-0.6, 0.6, 20)), 0.4 * np.sin(np.linspace(-0.6, 0.6, 20)),
                0.05 * np.cos(9 * np.linspace(-0.6, 0.6, 20))], 1)
ARM = np.linspace(-0.2, 0.2, 9)
CROSS = np.concatenate([np.stack([0 * ARM, ARM, 0 * ARM], 1), np.stack([0 * ARM, 0 * ARM, ARM], 1)])
CROSS = np.unique(CROSS, axis=0)
CLOUD = np.random.default_rng(5).uniform((-0.1, -0.25, -0.15), (0.1, 0.25, 0.15), (18, 3))
# elements, kHz, water, targets, knots, pings; the first three were used while the fit was made, the others were not
SCENES = {
    "line": (LINE, 100.0, UNIFORM, [(-6, 14, -21), (5, 17, -18), (1, 22, -23), (9, 25, -16), (-9, 27, -20)], 3.0, 12),
    "plane": (PLANE, 70.0, SUMMER, [(-4, 16, -17), (6, 20, -22), (0, 25, -19), (-9, 29, -14)], 2.0, 14),
    "ring": (RING, 120.0, SUMMER, [(3, 15, -15), (-5, 19, -20), (7, 23, -17), (-2, 28, -22), (10, 30, -20)],
             4.0, 10),
    "arc": (ARC, 150.0, SUMMER, [(-3, 13, -16), (4, 15, -20), (8, 19, -22), (-7, 21, -18), (2, 24, -24)], 2.5, 12),
    "cross": (CROSS, 85.0, UNIFORM, [(5, 15, -19), (-2, 18, -23), (-8, 21, -16), (9, 26, -20)], 3.5, 12),
    "cloud": (CLOUD, 60.0, SUMMER, [(-5, 12, -18), (2, 16, -22), (7, 18, -16), (-1, 23, -24), (-10, 27, -20)], 3.0,
              14),
}


def made(name, cell, seed, late_by):
    """Signals of an array that is off, channels by a delay, with what is believed of it, and the truth."""
    nominal, frequency, water, targets, knots, pings = SCENES[name]
    rng = np.random.default_rng(seed)
    elements = nominal + 2e-3 * rng.standard_normal(nominal.shape)
    count = len(elements)
    shapes = {f"target{number}": point_target(place, 3.0) for number, place in enumerate(targets)}
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "elements.csv"
        np.savetxt(table, elements, delimiter=",", header="x,y,z", comments="")
        scene = array_sonar({"bed": bed(26.0), **shapes}, water=water, integrator={"cell": cell},
                            sensor={"frequency_khz": frequency, "receive": "file", "receive_file": str(table),
                                    "pulse": "lfm", "bandwidth_khz": 0.2 * frequency, "pulse_ms": 1.0,
                                    "speed_knots": knots, "pings": pings, "ping_rate_hz": 4.0,
                                    "heading_deg": 80.0, "start": [-2.0, 0.0, -12.0]},
                            film={"range": 40.0})
        signals = mitsonar.element_signals(scene, list(range(pings)), seed=seed)
    late, gain = late_by * rng.standard_normal(count), np.exp(0.2 * rng.standard_normal(count))
    turn = np.exp(-2j * np.pi * 1e3 * frequency * late)
    signals = signals.copy(data=(signals.values * (10 ** 0.05 * gain * turn)[:, None]).astype(np.complex64))
    truth = {"rx_position": elements, "rx_delay": late, "gain": gain / gain.mean(),
             "position": np.stack([signals[axis].values for axis in "xyz"], 1), "targets": np.array(targets, float)}
    off = 0.05 * rng.standard_normal((pings, 3)) / np.sqrt(3)
    for number, axis in enumerate("xyz"):
        signals = signals.assign_coords({f"rx_{axis}": ("rx", nominal[:, number]),
                                         axis: ("ping", signals[axis].values + off[:, number])})
    for angle in ("roll", "pitch", "heading"):
        signals = signals.assign_coords(
            {angle: ("ping", signals[angle].values + np.deg2rad(0.2) * rng.standard_normal(pings))})
    places = truth["targets"] + 0.05 * rng.standard_normal((len(targets), 3)) / np.sqrt(3)
    return scene, signals, places, truth, nominal


def shape_error(found, true):
    """Rms [m] of elements after the best shift and turn."""
    a, b = found - found.mean(0), true - true.mean(0)
    # small turns, linearised, and none that the array cannot tell
    turns = np.stack([np.cross(axis, b) for axis in np.eye(3)], -1).reshape(-1, 3)
    rest = (a - b).ravel()
    rest = rest - turns @ np.linalg.lstsq(turns, rest, rcond=1e-6)[0]
    return float(np.sqrt(np.mean(rest ** 2) * 3))


def relative(delay):
    """Delays about their mean."""
    return delay - delay.mean()


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--cell", type=float, default=0.4)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--known", action="store_true", help="channels are not late")
    parser.add_argument("--verbose", action="store_true", help="say what was observable")
    options = parser.parse_args()
    print("| scene | shape [mm] | channels [us] | gains [%] | navigation [mm] | told / unknowns | seconds |")
    print("|---|---|---|---|---|---|---|")
    for name, late_by in itertools.product(options.scenes, (0.0,) if options.known else (0.5e-6, 0.0)):
        scene, signals, places, truth, nominal = made(name, options.cell, options.seed, late_by)
        begin = time.process_time()
        found = calibrated(signals, places, scene.sensors()[0].water.profile,
                           believed={"rx_position": 2e-3, "rx_delay": late_by, "position_offset": 0.03,
                                     "attitude_offset": np.deg2rad(0.2), "target_position": 0.03})
        seconds = time.process_time() - begin
        shape = shape_error(nominal, truth["rx_position"]), shape_error(found.values["rx_position"],
                                                                         truth["rx_position"])
        late = [1e6 * np.std(part) for part in (truth["rx_delay"], relative(found.values["rx_delay"])
                                                - relative(truth["rx_delay"]))]
        gain = [100 * np.std(part) for part in (truth["gain"] - 1, found.gain / truth["gain"])]
        believed = np.stack([signals[axis].values for axis in "xyz"], 1)
        place = [1e3 * np.sqrt(np.mean(np.sum((part - truth["position"]) ** 2, 1)))
                 for part in (believed, believed + found.values["position_offset"])]
        print(f"| {name}{'' if late_by else ', channels known'} | {1e3 * shape[0]:.2f} -> {1e3 * shape[1]:.3f} | "
              f"{late[0]:.2f} -> {late[1]:.3f} | "
              f"{gain[0]:.0f} -> {gain[1]:.1f} | {place[0]:.0f} -> {place[1]:.0f} | "
              f"{found.effective:.0f} / {len(found.singular_values)} | {seconds:.1f} |")
        if options.verbose:
            print(*found.sentences(), f"residual {1e9 * found.residual[0]:.0f} -> {1e9 * found.residual[1]:.0f} ns",
                  sep="\n")


if __name__ == "__main__":
    main()
