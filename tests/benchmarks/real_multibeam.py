"""Real soundings and ours: travel times along eigenrays, and places of soundings reduced anew.

    python tests/benchmarks/real_multibeam.py                    the lines of ../shared
    python tests/benchmarks/real_multibeam.py LINE.all ...       others

Times: from the file's places of soundings, out from the transmit array where it sent and back to the receive array
where it heard: our two-way time less the file's, times half the speed of sound: metres, one way. A ping's three lever
arms are fitted or nothing is. Places: what `resounded` makes of the file's times and angles, less the file's places.
The water is the file's cast with the head's sound-speed sensor as the node at the arrays, or the cast as it stands; the
ship is held in place while echoes are under way, or moved (`mitsonar.planning.instrument_rules`). Pings without a
record of the motion to their last echo are left out, and so are soundings that no ray leads to.
"""
import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MEASURED = ROOT / "../shared/data/measured/multibeam"
LINES = ("em710_122m.all", "em2040_56m.all", "em2042_os01.kmall")
FEWEST = 4                         # soundings of a ping


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lines", nargs="*", type=Path, default=[MEASURED / name for name in LINES])
    import measuring

    rows = [row for path in parser.parse_args(argv).lines for row in rows_of(path)]
    measuring.table(["line", "sound speed", "ship", "pings, soundings", "times: nothing fitted [mm]", "three arms [mm]",
                     "worst ping", "places anew: depth [mm]", "across", "along"], rows)


def rows_of(path):
    """Return the rows of a line: with the head's sound speed or the cast's, of the ship held in place, and moved."""
    for node in (True, False):
        for held in (True, False):
            found = list(pings_of(path, held, node))
            if not found:
                raise SystemExit(f"{path} has no ping whose motion was recorded to its last echo.")
            bare, fitted, places = (np.concatenate([one[k] for one in found]) for k in range(3))
            worst = max(rms(one[1]) for one in found)
            yield [path.stem, "head" if node else "cast", "held" if held else "moved", f"{len(found)}, {bare.size}",
                   millimetres(rms(bare)), millimetres(rms(fitted)), millimetres(worst),
                   *(millimetres(rms(column)) for column in places.T)]


def pings_of(path, held, node=True):
    """Return residuals of times, bare and fitted, and of places (depth, across, along), ping by ping."""
    from mitsonar.io.survey_lines import reading
    from mitsonar.planning.instrument_rules import time_residuals

    whole = reading.read(path, water_column=False)
    for head in range(whole.sizes.get("receive_head", 1)):
        line = reading.of_head(whole, head)
        for ping in range(line.sizes["ping"]):
            one = line.isel(ping=[ping])
            if one["valid"].values.sum() < FEWEST or not under_way(one):
                continue
            for bare, fitted in time_residuals(one, node, not held):
                yield bare, fitted, anew(one, held, node)


def under_way(one):
    """Whether the motion was recorded from the ping to its last echo: files are cut, too."""
    sent, motion = float(one["ping_time"][0]), one["motion_time"].values
    return motion[0] <= sent and sent + float(one["travel_time"].max()) <= motion[-1]


def anew(one, held, node):
    """Return places (sounding, 3) of `resounded` less the file's, from the ping's own place."""
    from mitsonar.hydrography.reduction.resounding import resounded
    from mitsonar.planning.instrument_rules import InstrumentRules

    when, sent = one["motion_time"].values, float(one["ping_time"][0])
    one = one.assign({f"motion_{name}": one[f"motion_{name}"] + float(one[f"ping_{name}"][0]) - np.interp(
        sent, when, one[f"motion_{name}"].values) for name in ("x", "y", "depth")})
    new = resounded(one, **InstrumentRules(node=node, under_way=not held, residual={}).arguments(one))
    valid = one["valid"].values[0]
    return np.stack([(new[name].values - one[name].values)[0][valid] for name in (
        "depth", "across_track", "along_track")], -1)


def rms(values):
    """Return the root mean square of what is a number."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def millimetres(value):
    """Word a length."""
    return f"{1e3 * value:.1f}"


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
