"""Sound-speed profiles from soundings: how wrong before and after, and what could be seen.

    python tests/benchmarks/profile_from_soundings.py            simulated lines in real water, then real lines
    python tests/benchmarks/profile_from_soundings.py LINE.all   those lines alone
    python tests/benchmarks/profile_from_soundings.py --quick    fewer soundings, in the water of scenes/casts

Simulated: lines over a slope that climbs through the layers, or over a level bed, in water as casts of ../shared have
it, sample by sample; a bed with relief on a grid of a metre; noise of the times, 5 cm of navigation error a ping, 0.1
m/s of the head's sensor (`simulated_soundings`). The fit begins with water of one speed, the head's, knows nothing of
the bed, and has nodes many metres apart. Errors are those of the told nodes, or of all below the head where none is
told. Depths: what the water does to all soundings, before and after.

Real lines: their times and angles, the cast of the file being the truth, and a stale cast the start: layers a tenth of
the depth deeper, 4 m/s less above a third of the depth, 3 m/s more below. Once with the bed unknown, once with the
file's own soundings as the bed, known to 5 cm. A second table asks these soundings for no more than those three
numbers, believed to 20 m, 5 and 5 m/s before: what would be found were the stale cast wrong in no other way.
"""
import argparse
import sys
import time
from pathlib import Path

import numpy as np
from simulated_soundings import HEAD, surveyed

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT / "../shared/data"
CASTS = {"river in August": ("castaway_11E101663_20120821.csv", 5, 21),
         "harbour": ("valeport_minisvp_V000056.txt", 8, 40), "bay": ("hypack_20190819.vel", 10, 54)}
LINES = ("em710_122m.all", "em2040_56m.all")
NODES = 12
HEADS = ["water", "bed [m]", "noise [us]", "error [m/s]", "worst", "error/deviation", "depths [cm]",
         "mean of column [m/s]", "told; numbers seen", "s CPU"]


def main(argv=None):
    """Measure and print tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lines", nargs="*", type=Path)
    parser.add_argument("--quick", action="store_true", help="fewer soundings, in the water of scenes/casts")
    arguments = parser.parse_args(argv)
    given = arguments.lines
    import measuring

    if arguments.quick:
        few = {"lines": 4, "pings": 20, "beams": 20}
        measuring.table(HEADS, list(simulated("summer", measuring.SUMMER, 8, 50, **few)))
        return
    if not given:
        measuring.table(HEADS, [row for name, (file, *depths) in CASTS.items()
                                for row in simulated(name, SHARED / "profiles" / file, *depths)])
        print()
    rows = [row for path in given or [SHARED / "measured/multibeam" / name for name in LINES] for row in real(path)]
    measuring.table(["line", "bed", *HEADS[1:]], [row[:-1] for row in rows])
    print()
    measuring.table(["line", "bed", "layers deeper by [m]", "more above [m/s]", "more below [m/s]"],
                    [[*row[:2], *row[-1]] for row in rows])


def simulated(name, path, shallowest, deepest, **options):
    """Return the rows of a cast; options are of `surveyed`."""
    from mitsonar.inversion.profile.profile import fit_profile
    from mitsonar.inversion.profile.profile_problem import ProfilePrior
    from mitsonar.io import casts
    from mitsonar.water import SoundSpeedProfile

    cast = casts.read(path).profile
    depth = np.unique(np.r_[0, HEAD, np.linspace(0, deepest, NODES + 1)[1:]])
    start = SoundSpeedProfile(depth, np.full(depth.size, float(cast.at(HEAD))))
    for low, noise, seed in ((shallowest, 2e-6, 1), (shallowest, 20e-6, 2), (deepest - 0.02 * deepest, 20e-6, 3)):
        beams, bed = surveyed(cast, low, deepest, noise=noise, seed=seed, **options)
        began = time.process_time()
        fit = fit_profile(beams, start, noise=noise, prior=ProfilePrior(length=deepest / 6))
        yield [name, *worded(fit, cast, noise, time.process_time() - began, depths(beams, bed, cast, start, fit))]


def depths(beams, bed, cast, start, fit):
    """Return the root mean square error of depths by the water, before and after [m]."""
    from mitsonar.gradients.soundings.sounding_times import SoundingTimes
    from mitsonar.hydrography.reduction.legs import Starts
    from mitsonar.water import SoundSpeedProfile

    true = SoundingTimes(beams, cast, bed).places({})[:, 2]
    for water in (start, SoundSpeedProfile(fit.depth, fit.speed)):
        found = Starts(profile=water, depth=beams.depth).depth_after(beams.slowness, beams.travel_time / 2)
        yield float(np.sqrt(np.nanmean((found - true) ** 2)))


def worded(fit, cast, noise, seconds, errors):
    """Return the columns of a fit."""
    truth, below = cast.at(fit.depth), fit.depth > fit.head_depth + 0.5
    some = fit.told & below if fit.is_profile else below & (fit.depth < fit.bed_depths[-1])
    before, after = (np.abs(speed - truth)[some] for speed in (fit.start, fit.speed))
    ratio = np.sqrt(np.mean(((fit.speed - truth)[some] / fit.deviation[some]) ** 2))
    column = np.linspace(fit.head_depth, fit.bed_depths[1], 20000)
    mean = cast.at(column).mean()
    errors = " -> ".join(f"{100 * error:.1f}" for error in errors)
    told = (f"{(fit.told & below).sum()} of {below.sum()}" if fit.is_profile else
            "mean only" if fit.is_overlapping else "nothing: one look")
    start = np.interp(column, fit.depth, fit.start).mean()
    return [f"{fit.bed_depths[0]:.0f} to {fit.bed_depths[-1]:.0f}", f"{1e6 * noise:.0f} ({1e6 * fit.noise:.0f} found)",
            f"{before.mean():.2f} -> {after.mean():.2f}", f"{before.max():.1f} -> {after.max():.1f}", f"{ratio:.1f}",
            errors, f"{start - mean:+.1f} -> {fit.column_mean - mean:+.2f} +- {fit.column_mean_deviation:.2f}",
            f"{told}; {fit.parameters:.1f}", f"{seconds:.1f}"]


def real(path):
    """Return the rows of a line: bed unknown, and bed known."""
    from mitsonar.gradients.soundings.sounding_bed import BedGrid
    from mitsonar.hydrography.detection.sounding_beams import beams_of
    from mitsonar.hydrography.reduction.resounding import profile_of
    from mitsonar.inversion.profile.profile import fit_profile, laid_bed
    from mitsonar.inversion.profile.profile_problem import ProfilePrior
    from mitsonar.io.survey_lines import reading
    from mitsonar.water import SoundSpeedProfile

    line = reading.of_head(reading.read(path, water_column=False), 0)
    beams, whole = beams_of(line, under_way=False), profile_of(line)
    head, deepest = float(np.median(beams.depth)), float(np.nanmax(line["depth"].values))
    below = whole.depth > head + 0.01
    cast = SoundSpeedProfile(np.r_[head, whole.depth[below]], np.r_[beams.head_speed[0], whole.sound_speed[below]])
    depth = np.r_[head, head + (deepest - head) * np.arange(1, NODES + 1) / NODES]
    shallow = 1 / (1 + np.exp((depth - deepest / 3) / (0.02 * deepest)))

    def wrong(numbers):
        """The cast with layers deeper by so much, and so much faster above and below."""
        speed = cast.at(np.maximum(depth - numbers[0], head)) + numbers[1] * shallow + numbers[2] * (1 - shallow)
        return np.r_[beams.head_speed[0], speed[1:]]

    stale = np.array([0.1 * deepest, -4.0, 3.0])
    start = SoundSpeedProfile(depth, wrong(stale))
    prior = ProfilePrior(length=deepest / 6, deviation=6.0, bed_deviation=0.05, bed_bend=0.3)
    laid = laid_bed(beams, cast, prior, None)
    for name, bed in (("unknown", None), ("known to 5 cm", laid)):
        began = time.process_time()
        fit = fit_profile(beams, start, noise=5e-6, prior=prior, bed=bed)
        seconds = time.process_time() - began
        grid = BedGrid(x=laid.x, y=laid.y, depth=laid.depth)
        found, deviation = three_numbers(fit, wrong, stale)
        yield [path.stem, name, *worded(fit, cast, 5e-6, seconds, depths(beams, grid, cast, start, fit)),
               [f"{before:+.1f} -> {after:+.1f} +- {one:.1f}" for before, after, one in zip(stale, found, deviation)]]
        print(path.stem, name + ":", fit.verdict, "\n")


def three_numbers(fit, wrong, stale):
    """Return what the soundings say of three numbers (3,) about a start, and deviations.

    The fit's answer m is where T (m - ĉ) + P (m - start) = 0, with P = (U Uᵀ)⁻¹, T = (U S⁻² Uᵀ)⁻¹ of its patterns U and
    singular values S, and ĉ what the soundings alone say: they weigh three numbers as they weigh the nodes.
    """
    inverse = np.linalg.inv(fit.patterns.T)
    told, before = inverse.T @ (fit.singular_values[:, None] ** 2 * inverse), inverse.T @ inverse
    slopes = np.stack([(wrong(stale + step) - wrong(stale - step)) / 0.2 for step in 0.1 * np.eye(3)], -1)
    believed = np.diag(np.array([20.0, 5.0, 5.0]) ** -2)
    normal = slopes.T @ told @ slopes + believed
    push = slopes.T @ (told @ (fit.speed - fit.start) + before @ (fit.speed - fit.start))
    return stale + np.linalg.solve(normal, push), np.sqrt(np.diag(np.linalg.inv(normal)))


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    main()
