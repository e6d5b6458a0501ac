"""Measure what a recorder costs: a sidescan's ping, a fan's frame, a rotating head's ping.

    python tests/benchmarks/recorders.py                              milliseconds of CPU a ping, and their share

A picture is rendered, and its recorder is then run over it alone. CPU seconds are those of all threads; of the rounds
the least is shown.
"""
import argparse
import time

import measuring

SCENES = {"sidescan_wreck": {}, "forward_looking": {"frequency_khz": 1200, "beams": 512, "elements": 192, "range": 6,
                                                    "range_min": 1, "bandwidth_khz": 100, "pulse_ms": 0.1},
          "sector_scan": {}}


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--scenes", nargs="+", choices=[*SCENES], default=[*SCENES])
    parser.add_argument("--pings", type=int, default=20, help="of a picture; default 20")
    parser.add_argument("--rays", type=int, default=150_000, help="per ping of the sidescan; default 150000")
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args(argv)
    import mitsonar
    from mitsonar.imaging.recording import PingRecorder

    print(measuring.machine())
    rows = []
    for name in arguments.scenes:
        values = SCENES[name]
        rays = {"rays": arguments.rays} if name == "sidescan_wreck" else {}
        scene = mitsonar.load_file(measuring.ROOT / "scenes" / f"{name}.xml", pings=arguments.pings, **rays, **values)
        picture, whole = least(lambda scene=scene: mitsonar.render(scene), max(1, arguments.rounds // 2))
        recorder = scene.sensors()[0].recorder
        _, alone = least(lambda recorder=recorder, picture=picture: PingRecorder(recorder, 0).added(picture),
                         arguments.rounds)
        samples = picture["level"].values[0].size
        rows.append((name, samples, *(f"{1e3 * cost / arguments.pings:.3f}" for cost in (alone, whole)),
                     f"{100 * alone / whole:.1f} %"))
    measuring.table(("scene", "samples a ping", "recorder [ms]", "whole ping [ms]", "share"), rows)


def least(work, rounds):
    """Return what work returns, and the least of its CPU seconds over some rounds."""
    costs = []
    for _ in range(rounds):
        began = time.process_time()
        result = work()
        costs.append(time.process_time() - began)
    return result, min(costs)


if __name__ == "__main__":
    main()
