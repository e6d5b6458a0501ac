"""Real soundings and ours: travel times along eigenrays, and places of soundings reduced anew.

    python tests/benchmarks/real_multibeam.py                    the lines of ../shared
    python tests/benchmarks/real_multibeam.py LINE.all ...       others

Times: from the file's places of soundings, through its cast with the head's sound speed as the node at the transmit
array, out from the transmit array where it sent and back to the receive array where it heard: our two-way time less the
file's, times half the speed of sound: metres, one way. A ping's three lever arms are fitted or nothing is. Places: what
`resounded` makes of the file's times and angles, less the file's places. The ship moves while echoes are under way;
sounders that write .all leave its way and heave out (held), those that write .kmall do not (moved). Pings without a
record of the motion to their last echo are left out.
"""
import argparse
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MEASURED = ROOT / "../shared/data/measured/multibeam"
LINES = ("em710_122m.all", "em2040_56m.all", "em2042_os01.kmall")
STEP, TURNS = 0.01, 3              # [m] of the lever arms' derivatives; rounds of fitting


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lines", nargs="*", type=Path, default=[MEASURED / name for name in LINES])
    import measuring

    rows = [row for path in parser.parse_args(argv).lines for row in rows_of(path)]
    measuring.table(["line", "ship", "pings, soundings", "times: nothing fitted [mm]", "three arms [mm]", "worst ping",
                     "places anew: depth [mm]", "across", "along"], rows)


def rows_of(path):
    """Give the rows of a line: of the ship held in place, and moved."""
    for held in (True, False):
        found = list(pings_of(path, held))
        if not found:
            raise SystemExit(f"{path} has no ping whose motion was recorded to its last echo.")
        bare, fitted, places = (np.concatenate([one[k] for one in found]) for k in range(3))
        worst = max(rms(one[1]) for one in found)
        yield [path.stem, "held" if held else "moved", f"{len(found)}, {bare.size}", millimetres(rms(bare)),
               millimetres(rms(fitted)), millimetres(worst), *(millimetres(rms(column)) for column in places.T)]


def pings_of(path, held):
    """Give residuals of times, bare and fitted, and of places (depth, across, along), ping by ping."""
    from mitsonar.io.survey_lines import reading

    whole = reading.read(path, water_column=False)
    for head in range(whole.sizes.get("receive_head", 1)):
        line = reading.of_head(whole, head)
        for ping in range(line.sizes["ping"]):
            one = line.isel(ping=[ping])
            if not one["valid"].values.any() or not under_way(one):
                continue
            one = kept_in_place(one) if held else one
            yield *times(one), anew(one)


def under_way(one):
    """Whether the motion was recorded from the ping to its last echo: files are cut, too."""
    sent, motion = float(one["ping_time"][0]), one["motion_time"].values
    return motion[0] <= sent and sent + float(one["travel_time"].max()) <= motion[-1]


def kept_in_place(one):
    """Hold the ship where it was at the ping; its attitude goes on."""
    names = {f"motion_{name}": one["motion_time"].copy(data=np.full(
        one.sizes["motion"], float(one[f"ping_{name}"][0]))) for name in ("x", "y", "depth")}
    return one.assign(names)


def times(one):
    """Give our times less the file's as metres one way, with nothing and with three lever arms of the ping fitted."""
    valid = one["valid"].values[0]
    sector = one["sector"].values[0][valid]
    sent = float(one["ping_time"][0]) + one["sector_delay"].values[0][sector]
    theirs = one["travel_time"].values[0][valid]
    part = one["sector_offset"].values[0][sector] if "sector_offset" in one else 0.0
    half = 0.5 * float(one["head_sound_speed"][0])
    points = [one[name].values[0][valid] for name in ("x", "y", "depth")]
    profile, shift = node_at_the_array(one), off_the_stream(one)

    def ours(arm):
        return sum(leg(profile, array(one, when, offset + arm, shift), points) for when, offset in (
            (sent, one["transmit_offset"].values + part), (sent + theirs, one["receive_offset"].values)))

    bare = ours(np.zeros(3)) - theirs
    arm, left = np.zeros(3), bare
    for _ in range(TURNS):
        slopes = np.stack([(ours(arm + STEP * axis) - theirs - left) / STEP for axis in np.eye(3)], -1)
        arm = arm - np.linalg.lstsq(slopes, left, rcond=None)[0]
        left = ours(arm) - theirs
    return half * bare, half * left


def leg(profile, start, end):
    """Give the travel time of an eigenray."""
    from mitsonar.propagation import eigenray

    return eigenray(profile, start[2], end[2], np.hypot(end[0] - start[0], end[1] - start[1])).travel_time


def array(one, when, offset, shift):
    """Give x, y and depth of an array at times."""
    from mitsonar.io.survey_lines.places import across_and_along, levelled

    x, y, depth, roll, pitch, heading = (np.interp(when, one["motion_time"].values, one[f"motion_{name}"].values)
                                         for name in ("x", "y", "depth", "roll", "pitch", "heading"))
    arm = levelled(offset, roll, pitch)
    x, y = across_and_along(x + shift[0], y + shift[1], heading, arm[:, 1], arm[:, 0])
    return x, y, depth + shift[2] + arm[:, 2]


def off_the_stream(one):
    """Give the ping's own place less that of the motion's stream: heave is in steps of a centimetre."""
    when = one["motion_time"].values
    return [float(one[f"ping_{name}"][0] - np.interp(float(one["ping_time"][0]), when, one[f"motion_{name}"].values))
            for name in ("x", "y", "depth")]


def node_at_the_array(one):
    """Give the cast below the transmit array, with the head's sound speed as its first node."""
    from mitsonar.io.survey_lines.places import levelled
    from mitsonar.water import SoundSpeedProfile

    arm = levelled(one["transmit_offset"].values, float(one["ping_roll"][0]), float(one["ping_pitch"][0]))
    depth, speed = one["cast_depth"].values, one["cast_sound_speed"].values
    head = float(one["ping_depth"][0]) + arm[2]
    below = depth > head + 1e-3
    return SoundSpeedProfile(np.r_[head, depth[below]], np.r_[float(one["head_sound_speed"][0]), speed[below]])


def anew(one):
    """Give places (sounding, 3) of `resounded` less the file's."""
    from mitsonar.hydrography.resounding import resounded

    shift = off_the_stream(one)
    one = one.assign({f"motion_{name}": one[f"motion_{name}"] + by for name, by in zip(("x", "y", "depth"), shift)})
    new = resounded(one)
    valid = one["valid"].values[0]
    return np.stack([(new[name].values - one[name].values)[0][valid] for name in (
        "depth", "across_track", "along_track")], -1)


def rms(values):
    """Give the root mean square of what is a number."""
    return float(np.sqrt(np.nanmean(np.square(values))))


def millimetres(value):
    """Word a length."""
    return f"{1e3 * value:.1f}"


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
