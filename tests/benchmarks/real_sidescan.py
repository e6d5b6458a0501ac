"""A rendered wreck beside a real one: the same statistics of both pictures, and the pictures one above the other.

    python tests/benchmarks/real_sidescan.py                          ours, beside the record where ../shared has it
    python tests/benchmarks/real_sidescan.py --real line.xtf          beside another record, of altitude and attitude
    python tests/benchmarks/real_sidescan.py --picture both.png       the real one on top, both under the same gain

Ours is the scene sidescan_wreck along the record's own track: places, depths, roll, pitch, yaw and pings of the XTF
file, its range and its number of samples. Compasses of tows are magnetic: headings are turned by what their median is
off the course. Places and attitude come in steps, some pings long, so they are smoothed over 2.5 s; else every ping has
a loss of its own. The bed lies where the record's first return says. The record's gain is not known, so all rows but
the dynamic range are ratios of neighbours; ours has 30 log R + 2 a R there. mitsonar/imaging/picture_statistics.py says
how each row is measured.
"""
import argparse
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
REAL = ROOT / "../shared/data/measured/sidescan/scotsman_600khz.xtf"
SMOOTH = 2.5                       # [s] of places and attitude
SIDES = "port", "starboard"
OCTAVES = "2-4, 4-8, 8-16, 16-32, 32-64"


def main(argv=None):
    """Render, measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--real", type=Path, default=REAL, help="XTF file of a sidescan")
    parser.add_argument("--pings", type=int, help="the first ones of the track alone")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--picture", type=Path, help="PNG file of both")
    parser.add_argument("-D", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    arguments = parser.parse_args(argv)
    import measuring

    parameters = dict(one.split("=", 1) for one in arguments.parameters)
    if arguments.pings:
        parameters["pings"] = arguments.pings
    there = arguments.real.is_file()
    if not there:
        print(f"{arguments.real} is not here: ours alone, by the scene's own track\n")
    with tempfile.TemporaryDirectory() as folder:
        amplitudes, spacing = ours(arguments.real if there else None, Path(folder), parameters, arguments.seed)
    columns = {f"ours, {side}": (amplitudes[:, number], spacing) for number, side in enumerate(SIDES)}
    if there:
        real, real_spacing = recorded(arguments.real)
        columns |= {f"real, {side}": (real[:, number], real_spacing) for number, side in enumerate(SIDES)}
        if arguments.picture:
            draw(arguments.picture, [real, amplitudes])
    measuring.table(["", *columns], list(zip(*columns_of(columns))))


def recorded(path):
    """Return amplitudes (ping, side, sample) and their spacing [m]."""
    from mitsonar.io.xtf.amplitudes import read_amplitudes

    record = read_amplitudes(path)
    return record["amplitude"].values.astype(float), float(record["range"].diff("range").mean())


def ours(real, folder, parameters, seed):
    """Render the wreck, along a real record's track if there is one; amplitudes and spacing as `recorded`."""
    import mitsonar

    if real is not None:
        parameters = {**along(real, folder), **parameters}
    image = mitsonar.render(mitsonar.load_file(ROOT / "scenes" / "sidescan_wreck.xml", **parameters), seed=seed)
    slant_range = image["range"].values.astype(float)
    level = image["level"].values.astype(float) + 30 * np.log10(slant_range) \
        + 2 * image.attrs["absorption_db"] * slant_range
    return 10 ** ((level - level.max()) / 20), float(image.attrs["bin_width"])


def along(real, folder):
    """Return parameters of the scene that make it the record's: track, bed, range, samples."""
    from scipy.signal import savgol_filter

    from mitsonar.imaging.picture_statistics import first_return
    from mitsonar.io.tracks import tracks
    from mitsonar.io.tracks.navigation import course

    record, spacing = recorded(real)
    track = tracks.load(real).placed()
    heading = np.asarray(track.heading)
    magnetic = np.median(np.angle(np.exp(1j * (heading - course(track.time, track.position[:, :2])))))
    interval = (track.time[-1] - track.time[0]) / (track.time.size - 1)
    way = np.column_stack((track.position, *(np.rad2deg(np.broadcast_to(angle, heading.shape)) for angle in (
        track.roll, track.pitch, np.unwrap(heading) - magnetic))))
    way = savgol_filter(way, 2 * round(SMOOTH / interval / 2) + 1, 2, axis=0)
    np.savetxt(folder / "track.csv", np.column_stack((track.time - track.time[0], way)),
               delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="", fmt="%.4f")
    first = first_return(record[:, 0], spacing)[-track.time.size:] * spacing
    depth = float(np.median(first * np.cos(np.deg2rad(way[:, 4])) - way[:, 2]))
    print(f"the record: {len(record)} pings of {record.shape[-1]} samples to {spacing * record.shape[-1]:.1f} m; bed "
          f"at {depth:.1f} m, compass turned by {-np.rad2deg(magnetic):.1f} degrees\n")
    return {"track": folder / "track.csv", "waypoints": "", "depth": f"{depth:.2f}", "bins": record.shape[-1],
            "range": f"{spacing * record.shape[-1]:.3f}", "pings": track.time.size,
            "ping_rate": f"{(track.time.size - 1) / (track.time[-1] - track.time[0]):.4f}"}


def columns_of(columns):
    """Return the table's columns, names of rows first."""
    from mitsonar.imaging.picture_statistics import measure

    def numbers(values, digits=2):
        return " ".join(f"{value:.{digits}f}" for value in np.atleast_1d(values))

    rows = {"open bed: windows of 16 x 16": lambda s: str(s.windows),
            "coefficient of variation (Rayleigh: 0.52)": lambda s: numbers(s.variation),
            "amplitude over mean, 1 10 50 90 99 % (Rayleigh: .11 .37 .94 1.71 2.42)": lambda s: numbers(s.quantiles),
            "correlation of amplitudes from ping to ping, lags 1-5": lambda s: numbers(s.ping_correlation),
            "of intensities": lambda s: numbers(s.ping_intensity_correlation),
            "correlation of amplitudes in range, lags 1-5": lambda s: numbers(s.range_correlation),
            "of intensities ": lambda s: numbers(s.range_intensity_correlation),
            "lag 1 with the bed's texture in: pings, range": lambda s: numbers((s.ping_texture, s.range_texture)),
            f"spectrum along track, wavelengths of {OCTAVES} pings; white: 1": lambda s: numbers(s.ping_spectrum),
            "spectrum in range, the same samples": lambda s: numbers(s.range_spectrum),
            "shadows under the bed [dB], quartiles": lambda s: numbers(s.shadow_db, 1),
            "samples in shadows": lambda s: str(s.shadows),
            "first return: rise from 10 to 90 % [m]": lambda s: numbers(s.rise),
            "its peak over the bed 1-3 m on [dB]": lambda s: numbers(s.peak_db, 1),
            "water column under the bed 1-3 m on [dB]": lambda s: numbers(s.water_db, 1),
            "dynamic range, 0.1 to 99.9 %, with the gain [dB]": lambda s: numbers(s.dynamic_range_db, 0),
            "different amplitudes; saturated [%]": lambda s: f"{s.values}; {100 * s.saturated:.2f}"}
    yield list(rows)
    for amplitude, spacing in columns.values():
        found = measure(amplitude, spacing)
        yield [row(found) for row in rows.values()]


def draw(path, pictures):
    """Write pictures one above the other: port mirrored, starboard, the root of amplitudes over their 99.5 %."""
    from PIL import Image

    rows = []
    for amplitude in pictures:
        sheet = np.concatenate((amplitude[:, 0, ::-1], amplitude[:, 1]), 1)
        rows += [255 * np.sqrt(np.clip(sheet / np.percentile(sheet, 99.5), 0, 1)), np.full((8, sheet.shape[1]), 255.0)]
    Image.fromarray(np.concatenate(rows[:-1]).astype(np.uint8)).save(path)


if __name__ == "__main__":
    main()
