"""Water columns of real multibeam sounders and of ours: the ring of side lobes at the first return, noise, bleed.

    python tests/benchmarks/real_columns.py LINE ...             recorded lines, or soundings with their column (.nc)

A line a ping. Ring: the mean power in a window of time about the first return, in beams of 10 degrees of the angle from
the vertical, over that of the strongest beam [dB]; beside it the noise from a third to 0.85 of the first return's time,
and the first millisecond, each after 30 log R and absorption, over the strongest sample [dB]. Rough: rms difference of
the noise of beams and of samples from that of their neighbours [dB]. Of soundings the levels as recorded are taken,
where they are there.
"""
import argparse
import sys
from pathlib import Path

import numpy as np

WINDOW = 2.0                       # pulse lengths either way of the strongest sample
STEP = 10                          # [degrees]
NEIGHBOURS = 11                    # beams or samples that a rough one is compared with


def main(argv=None):
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lines", nargs="+", type=Path)
    import measuring

    import mitsonar

    angles = np.arange(0, 70, STEP)
    rows = []
    for path in parser.parse_args(argv).lines:
        line = mitsonar.read(path)
        if "column_level_db" not in line:
            raise SystemExit(f"{path} has no water column; give one with it, or sound with --column.")
        for ping in range(line.sizes["ping"]):
            found = of_ping(line.isel(ping=ping), angles)
            if found is not None:
                rows += [[path.name, ping, *row] for row in found]
    measuring.table(["line", "ping", "measure", *(f"{low} to {low + STEP}" for low in angles)], rows)


def of_ping(ping, angles):
    """Return the rows of a ping: the measure and its values by angle; None without a column or a sounding."""
    name = "column_recorded_db" if "column_recorded_db" in ping else "column_level_db"
    there = np.isfinite(ping["column_angle"].values) & np.isfinite(ping[name].values).any(1)
    if not there.any() or not ping["valid"].values.any():
        return None
    level, angle = ping[name].values[there].astype(float), ping["column_angle"].values[there]
    rate, start = (float(np.median(ping[f"column_{one}"].values[there])) for one in ("rate", "start"))
    off = np.abs(np.rad2deg(angle - float(ping["ping_roll"])))
    time = start + (0.5 + np.arange(level.shape[1])) / rate
    power = 10 ** (np.nan_to_num(level, nan=-300) / 10)
    first = float(np.nanmin(ping["travel_time"].values[ping["valid"].values]))
    length = float(np.nanmax(ping["sector_pulse_length"].values))
    near = np.abs(time - first) < max(0.03 * first, 2 * length)
    peak = time[near][np.argmax(power[:, near].mean(0))]
    ring = power[:, np.abs(time - peak) <= max(WINDOW * length, 1.5 / rate)].mean(1)
    speed = float(ping["head_sound_speed"])
    sector = np.minimum(ping["column_sector"].values[there], ping["sector_absorption_db"].size - 1)
    absorption = np.nan_to_num(ping["sector_absorption_db"].values)[sector]
    far = 0.5 * speed * np.maximum(time, 0.5 / rate)
    written = level + 30 * np.log10(far) + 2 * absorption[:, None] * far
    written = 10 ** ((np.nan_to_num(written, nan=-300) - np.nanmax(written)) / 10)
    before = written[:, (time > first / 3) & (time < 0.85 * first)]
    rows = [["ring", *by_angle(ring / ring.max(), off, angles)], ["noise", *by_angle(before.mean(1), off, angles)],
            ["first ms", *by_angle(written[:, time < 1e-3].mean(1), off, angles)]]
    beams, samples = (rough(10 * np.log10(before.mean(axis))) for axis in (1, 0))
    return [*rows, [f"rough beams {beams:.1f}, samples {samples:.1f}", *[""] * len(angles)]]


def by_angle(power, off, angles):
    """Return levels [dB] of mean powers in steps of the angle; empty without a beam."""
    inside = [(off >= low) & (off < low + STEP) for low in angles]
    return [f"{10 * np.log10(max(power[some].mean(), 1e-30)):.1f}" if some.any() else "" for some in inside]


def rough(level):
    """Return the rms difference [dB] of levels from the mean of their neighbours."""
    if level.size < NEIGHBOURS:
        return np.nan
    return float(np.std(level - np.convolve(np.pad(level, NEIGHBOURS // 2, "edge"),
                                            np.full(NEIGHBOURS, 1 / NEIGHBOURS), "valid")))


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
