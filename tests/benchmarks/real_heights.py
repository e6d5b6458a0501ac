"""The tilt of a real bed from the strengths of its echoes alone, beside the soundings of the same line.

    python tests/benchmarks/real_heights.py                       prints the table where ../shared has the line
    python tests/benchmarks/real_heights.py --picture fit.png     soundings, start, answer and deviation across track

No sidescan record there lies over a bed that was sounded: the places of both are printed. A multibeam line has both:
strengths, and depths from travel times. Here the strengths are all that the fit sees: those of beams to port and to
starboard by slant range, as a sidescan has them, of the pings that span the swath.

The line's gains, beam patterns and the bed's law of angles are not known. Strengths are divided by their mean over both
sides and all pings at the same range, and multiplied by what a level bed would give: what is left is how the sides
differ. A tilted plane is as far and as steep by slant range as a level one at the same distance: only what lies on
which side of the vertical tells them apart, and vertical beams where they are not even. So little of a tilt can be told
from such a record, and the fit must say so; an even bed of the same tilt, rendered, shows what could have been told.
Lengths and times are `SCALE` times those of the line, at the same sound speed: the fit's bins and floors are in metres
of usual altitudes.
"""
import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured"
LINE = MEASURED / "multibeam/em2042_os01.kmall"
SIDESCANS = "scotsman_600khz.xtf", "wreck_000_1236.xtf"
SCALE = 5.0
BINS, WIDEST = 72, 36.0            # of slant range, scaled
AROUND = 20                        # soundings to either side that are averaged
BED, STRENGTH = "bed.vertex_positions", "bed.bsdf.strength"
SPAN = np.deg2rad(55)              # to either side that a ping of the whole swath has
SCENE = """
<scene version="3.0.0">
    <default name="rays" value="{rays}"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <shape type="seabed" id="bed">
        <float name="depth" value="{depth}"/> <float name="length" value="80"/> <float name="width" value="24"/>
        <float name="spacing" value="2"/> <float name="slope_deg" value="{tilt}"/>
        <float name="slope_heading_deg" value="180"/>
        <bsdf type="lambert" id="sand"><float name="mu_db" value="-20"/></bsdf>
    </shape>
    <sensor type="sidescan" id="sonar">
        <float name="beam_width_deg" value="1.5"/> <float name="pulse_ms" value="0.1"/>
        <string name="vertical_pattern" value="even.csv"/> <float name="depression_deg" value="0"/>
        <float name="back_db" value="-60"/>
        <float name="ping_rate_hz" value="1.5433"/> <integer name="pings" value="{pings}"/>
        <point name="start" x="-1" y="0" z="-10"/> <float name="heading_deg" value="90"/>
        <float name="speed_knots" value="3"/> <boolean name="speckle" value="false"/>
        <medium type="seawater"><float name="sound_speed" value="{speed}"/></medium>
        <film type="sonar_film"><float name="range" value="{range}"/> <integer name="bins" value="{bins}"/></film>
    </sensor>
</scene>
"""


def main(argv=None):
    """Fit, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--line", type=Path, default=LINE, help="a multibeam's survey line")
    parser.add_argument("--rays", type=int, default=6000)
    parser.add_argument("--picture", type=Path)
    given = parser.parse_args(argv)
    import measuring

    import mitsonar

    if not given.line.is_file():
        print(f"{given.line} is not here: nothing to compare")
        return
    print(f"{places(given.line)}\n")
    line = mitsonar.read(given.line)
    strengths = swath(line)
    slope, height = sounded(line, strengths["pings"])
    rows, drawn = [], {}
    for name in ("the line's strengths", "an even bed's of that tilt"):
        begun = time.process_time()
        seen = strengths if not rows else rendered(strengths, given.rays, np.arctan(slope))
        fit, reach = fitted(seen, given.rays)
        across, deep = fit["y"].values / SCALE, 10 / SCALE        # of the sonar in the fit's scene
        counted = (np.abs(across) < reach) & (np.abs(across) > 0.5)
        before, found = (fit[one].values.mean(0) / SCALE + deep for one in ("height_start", "height"))
        true = height(across)
        rows.append([name, *(f"{np.rad2deg(np.arctan(one)):.2f}" for one in (
            slope, fit.slope_y, float(fit["slope_deviation"]))), *(
            f"{np.std((one - true)[counted]):.3f}" for one in (before, found)),
            f"{fit['misfit'].values[-1]:.1f}", f"{time.process_time() - begun:.0f}"])
        drawn |= {"soundings": true, "level bed": before, f"of {name}": found}
    measuring.table(["heights fitted to", "tilt [degrees]", "fitted", "told ±", "level bed's error [m]", "fit's [m]",
                     "misfit / speckle", "s CPU"], rows)
    print(f"\n{len(strengths['pings'])} pings, {strengths['looks']:.1f} looks a bin; errors are less their mean, "
          f"within {reach:.1f} m")
    if given.picture:
        draw(given.picture, across, drawn)


def places(line):
    """Say where records lie."""
    import mitsonar
    from mitsonar.io.tracks import tracks

    said = [f"{line.name}: EPSG and origin {mitsonar.read(line).attrs['crs']}, {mitsonar.read(line).attrs['origin']}"]
    for name in SIDESCANS:
        path = MEASURED / "sidescan" / name
        if path.is_file():
            track = tracks.load(path)
            said.append(f"{name}: latitude {np.mean(track.y):.3f}, longitude {np.mean(track.x):.3f}")
    return "; ".join(said)


def swath(line):
    """Return mean strengths (ping, side, bin), their range [m], how many looks they have, and pings."""
    speed, angle = line["head_sound_speed"].values, line["angle"].values
    valid = line["valid"].values & np.isfinite(line["backscatter_db"].values)
    whole = [ping for ping in range(line.sizes["ping"]) if valid[ping].any()
             and angle[ping][valid[ping]].min() < -SPAN and angle[ping][valid[ping]].max() > SPAN]
    edges = np.linspace(0, WIDEST / SCALE, BINS + 1)
    strength, count = np.zeros((2, len(whole), 2, BINS))
    for row, ping in enumerate(whole):
        slant = 0.5 * line["travel_time"].values[ping] * speed[ping]
        power = 10 ** (0.1 * line["backscatter_db"].values[ping])
        for side, there in enumerate((angle[ping] < 0, angle[ping] >= 0)):
            some = there & valid[ping] & np.isfinite(slant)
            count[row, side] = np.histogram(slant[some], edges)[0]
            strength[row, side] = np.histogram(slant[some], edges, weights=power[some])[0]
    mean = strength / np.maximum(count, 1)
    both = (count > 0).all((0, 1))
    # the pings see the same bed, with speckle of their own
    seen = mean[..., both]
    spread = np.var(seen, 0, ddof=1) / np.mean(seen, 0) ** 2 if len(whole) > 1 else np.ones(1)
    return {"mean": mean, "count": count, "both": both, "range": 0.5 * (edges[1:] + edges[:-1]), "pings": whole,
            "looks": float(1 / np.mean(spread)), "speed": float(np.mean(speed))}


def opened(folder, strengths, rays, tilt=0.0):
    """Load a bed of one material under the sonar, level or tilted, at the depth of the first return."""
    import mitsonar

    nearest = strengths["range"][np.argmax(strengths["both"])]
    # a face hears as well from abreast to straight down, as all beams together do
    (Path(folder) / "even.csv").write_text("angle_deg,level_db\n-90,0\n90,0\n")
    path = Path(folder) / "bed.xml"
    path.write_text(SCENE.format(rays=rays, depth=10 + SCALE * nearest / np.cos(tilt), pings=len(strengths["mean"]),
                                 speed=strengths["speed"], tilt=np.rad2deg(tilt), range=WIDEST, bins=BINS))
    return mitsonar.load_file(path)


def rendered(strengths, rays, tilt):
    """Return the strengths that an even bed of a tilt would have, with speckle of as many looks."""
    import mitsonar

    with tempfile.TemporaryDirectory() as folder:
        level, tilted = (10 ** (0.1 * mitsonar.render(opened(folder, strengths, 8 * rays, one), seed=2)[
            "mean_level"].values.astype(float)) for one in (0.0, tilt))
    looks = strengths["looks"]
    speckle = np.random.default_rng(0).gamma(looks, 1 / looks, level.shape)
    return {**strengths, "mean": speckle * tilted / np.maximum(level, 1e-6 * level.max())}


def fitted(strengths, rays):
    """Fit heights; give the answer, and how far across [m] the strengths reach."""
    import mitsonar  # isort: skip: it comes before Mitsuba
    from mitsonar.inversion import HeightPrior, fit_heights
    from mitsonar.inversion.images.image_fit import Stage

    both, mean = strengths["both"], strengths["mean"]
    nearest, farthest = strengths["range"][np.flatnonzero(both)[[0, -1]]]
    stages = [Stage(bins=1, steps=8, products=8, first_only=True), Stage(bins=1, steps=6, products=20)]
    with tempfile.TemporaryDirectory() as folder:
        image = mitsonar.render(opened(folder, strengths, 8 * rays), seed=1)
        ratio = np.where(both, mean / np.where(both, mean.mean((0, 1)), 1), 1)
        seen = image["mean_level"].values.astype(float) + 10 * np.log10(np.maximum(ratio, 1e-3))
        model = mitsonar.scene_model(opened(folder, strengths, rays), [BED, STRENGTH], seed=3, edges=False)
        fit = fit_heights(model, image.assign(level=(image["level"].dims, seen)), BED, strength=STRENGTH,
                          looks=strengths["looks"], prior=HeightPrior(deviation=0.1, length=6.0, level=0.5, slope=0.1),
                          stages=stages, farthest=SCALE * farthest)
    # of the line through the heights, from the deviations of its ends, as if they were told apart
    across = fit["y"].values
    at = np.abs(across) < SCALE * farthest * 0.7
    weight = (across[at] - across[at].mean()) / np.sum((across[at] - across[at].mean()) ** 2)
    deviation = float(np.abs(weight) @ fit["height_deviation"].values.mean(0)[at])
    return fit.assign(slope_deviation=deviation), float(np.sqrt(max(farthest ** 2 - nearest ** 2, 0)))


def sounded(line, pings):
    """Return the slope to port of the line's own soundings, and their height at places to port, from the sonar on."""
    valid = line["valid"].values[pings]
    across, depth = (line[name].values[pings][valid] for name in ("across_track", "depth"))
    sonar = np.mean(line["ping_depth"].values[pings]) + line["receive_offset"].values[2]
    order = np.argsort(-across)
    port, height = -across[order], sonar - depth[order]
    smooth = np.convolve(height, np.ones(2 * AROUND + 1) / (2 * AROUND + 1), mode="valid")

    def at(y):
        return np.interp(y, port[AROUND:-AROUND], smooth, left=np.nan, right=np.nan)

    return float(np.polyfit(port, height, 1)[0]), at


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def draw(path, across, heights):
    """Draw heights across the track."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4))
    axes = figure.subplots()
    for name, values in heights.items():
        axes.plot(across, values, label=name)
    axes.set_xlabel("to port [m]")
    axes.set_ylabel("height [m]")
    axes.legend()
    figure.savefig(path)


if __name__ == "__main__":
    main()
