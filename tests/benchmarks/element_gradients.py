"""Jacobians of element signals: their time over that of the signals, and each parameter against differences.

    python tests/benchmarks/element_gradients.py [--elements 64] [--cell 0.08] [--check]
"""
import argparse
import time

import measuring
import numpy as np

import mitsonar  # noqa: F401  (chooses libLLVM before Dr.Jit is imported)
from mitsonar.gradients.check.check import check_gradients
from mitsonar.validation.scenes import array_sonar, bed, point_target

WATERS = {"constant": {"profile": "0:1500"}, "thermocline": {"cast": str(measuring.SUMMER)}}
KEYS = [f"sensor.{name}" for name in ("tx_position", "rx_position", "tx_weight", "tx_delay", "rx_delay", "rx_gain",
                                      "position_offset", "attitude_offset")] + ["ball.position",
                                                                                "ball.target_strength_db"]


def made(water, speed, elements, cell):
    """A line of elements over a bed with a target."""
    return array_sonar({"bed": bed(30.0), "ball": point_target([4.0, 18.0, -20.0])}, water=WATERS[water],
                       sensor={"receive": "line", "receive_elements": elements, "receive_pitch": 0.0075,
                               "transmit": "line", "transmit_elements": 2, "transmit_pitch": 0.05,
                               "speed_knots": speed, "pings": 2},
                       integrator={"cell": cell}, film={"range": 40.0})


def seconds(work):
    """Of a processor, for a piece of work done again."""
    work()
    begin = time.process_time()
    work()
    return time.process_time() - begin


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--elements", type=int, default=64)
    parser.add_argument("--cell", type=float, default=0.08)
    parser.add_argument("--check", action="store_true", help="compare each parameter with differences, of 9 elements")
    options = parser.parse_args()
    from mitsonar.gradients.elements.elements import ElementModel
    print("| water | knots | million echoes | signals [s] | J v | Jt w |\n|---|---|---|---|---|---|")
    for water in WATERS:
        for speed in (0.0, 3.0):
            keys = ["sensor.rx_position", "sensor.position_offset", "ball.position"]
            model = ElementModel(made(water, speed, options.elements, options.cell), keys)
            jacobian = model.linearised({})
            weights = np.random.default_rng(0).standard_normal(len(jacobian.value))
            step = {key: 1e-4 * np.ones(model.start[key].shape) for key in keys}
            signals, forward, backward = map(seconds, (lambda: model.value({}), lambda: jacobian.forward(step),
                                                       lambda: jacobian.backward(weights)))
            echoes = sum(block.count for block in jacobian._first.ensonified.echoes(0))
            print(f"| {water} | {speed:g} | {1e-6 * echoes:.2f} | {signals:.2f} | {forward / signals:.2f} | "
                  f"{backward / signals:.2f} |", flush=True)
    if options.check:
        print("| water | parameter | verdict | off differences | forward and backward |\n|---|---|---|---|---|")
        for water in WATERS:
            found = check_gradients(ElementModel(made(water, 4.0, 9, 1.0), KEYS, pings=(1,)), directions=1)
            for row in found.rows:
                print(f"| {water} | {row.key} {row.part} | {row.verdict} | {row.error:.1e} | {row.asymmetry:.1e} |",
                      flush=True)


if __name__ == "__main__":
    main()
