"""Sway of a synthetic aperture from the sharpness of its image, and from point targets: errors before and after.

    python tests/benchmarks/sway.py [--scenes wideband compact thermocline steep slow deep] [--cell 0.05]

A trajectory is believed that is off by a sway of each ping, correlated over a few pings, without mean and trend. The
prototype of this found 5 mm over 40 pings at 100 kHz to 0.08 mm, modulo half a wavelength, on echoes made by its own
model; here they are the renderer's, with speckle and receivers that move while they hear. The first three scenes were
used while the search was made. The others were not, and there the track is 5 cm off in each direction throughout, it
drifts by 5 cm along its way and in depth, and echoes are 1 dB too strong.
"""
import argparse
import time

import measuring
import numpy as np
from sonar_scenes import bed, point_target, synthetic_aperture

import mitsonar
from mitsonar.inversion.arrays.ping_images import PingImages, moved
from mitsonar.inversion.arrays.sharpness import sharpened, sway_of_targets, without_trend
from mitsonar.synthetic_aperture.focusing.grids import ground_grid

UNIFORM, SUMMER = {"profile": "0:1500"}, {"cast": str(measuring.SUMMER)}
# preset, water, rms of the sway [mm], pings over which it is alike, and of those not used before height [m]
SCENES = {"wideband": ("wideband_90khz", UNIFORM, 5.0, 6.0), "compact": ("compact_337khz", UNIFORM, 1.0, 4.0),
          "thermocline": ("wideband_90khz", SUMMER, 3.0, 3.0),
          "steep": ("wideband_90khz", SUMMER, 4.0, 5.0, 13.0), "slow": ("compact_337khz", SUMMER, 0.8, 8.0, 7.0),
          "deep": ("survey_100khz", UNIFORM, 4.0, 4.0, 8.0)}
GROUND = 19.0
RECEIVERS = {"wideband_90khz": 0.0375, "compact_337khz": 0.0333, "survey_100khz": 0.08}   # [m] apart
PIXELS = {"wideband_90khz": 0.025, "compact_337khz": 0.012, "survey_100khz": 0.025}        # [m]


def made(name, pings, cell, seed):
    """Raw echoes, the grid, and how far off the trajectory is at each ping."""
    preset, water, rms, correlation, *height = SCENES[name]
    rng = np.random.default_rng(seed)
    places = np.stack([GROUND + rng.uniform(-1.2, 1.2, 25), rng.uniform(-1.2, 1.2, 25), np.full(25, -19.98)], 1)
    shapes = {f"stone{number}": point_target(place, rng.uniform(-28, -20)) for number, place in enumerate(places)}
    shapes["reflector"] = point_target([GROUND + 0.5, 0.3, -19.95], -18.0)
    step, above = 4 * RECEIVERS[preset] / 2, height[0] if height else 10.0
    scene = synthetic_aperture({"bed": bed(20.0, size=100.0), **shapes}, water=water,
                               sensor={"preset": preset, "pings": pings, "receivers": 8, "overlap": 4, "banks": 1,
                                       "noise": True,
                                       "start": [0.0, -0.5 * step * pings, above - 20.0]},
                               film={"range_min": 18.0, "range": 25.0}, integrator={"cell": cell})
    raw = mitsonar.raw_echoes(scene, seed=seed)
    sway = rng.standard_normal(pings)
    sway = np.exp(-0.5 * ((np.arange(pings)[:, None] - np.arange(pings)) / correlation) ** 2) @ sway
    sway = without_trend(sway, np.arange(pings))
    sway *= 1e-3 * rms / sway.std()
    spacing = PIXELS[preset]
    grid = ground_grid((-1.5, 1.5), (GROUND - 1.5, GROUND + 1.5), (spacing, spacing), 20.0)
    return raw, grid, sway


def misled(trajectory):
    """A trajectory that is 5 cm off in each direction, and drifts by 5 cm along its way and in depth."""
    drift = np.linspace(0.025, 0.075, trajectory["motion_time"].size)
    changed = {"motion_x": 0.05 + 0 * drift, "motion_y": drift, "motion_depth": drift}
    return trajectory.assign({name: trajectory[name] + off for name, off in changed.items()})


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--pings", type=int, default=40)
    parser.add_argument("--cell", type=float, default=0.05)
    parser.add_argument("--seed", type=int, default=4)
    parser.add_argument("--exact", action="store_true", help="the track is off by sway alone, echoes are as loud")
    parser.add_argument("--picture", help="where to draw the last scene: before, after, sways")
    options = parser.parse_args()
    print("| scene | sway [mm] | by sharpness [mm] | modulo half a wavelength | said | by a target [mm] | contrast | "
          "seconds |")
    print("|---|---|---|---|---|---|---|---|")
    for name in options.scenes:
        raw, grid, sway = made(name, options.pings, options.cell, options.seed)
        when = raw["ping_time"].values
        believed = moved(raw, when, -sway)
        if len(SCENES[name]) > 4 and not options.exact:
            believed = misled(believed)
            raw = raw.assign({echo: (10 ** 0.05 * value).astype(value.dtype) for echo, value in raw.data_vars.items()
                              if np.iscomplexobj(value)})
        begin = time.process_time()
        found = sharpened(raw, grid, trajectory=believed)
        seconds = time.process_time() - begin
        along = np.arange(len(sway))
        off = without_trend(found.sway - sway, along)
        half = found.half_wavelength
        wrapped = without_trend(off - half * np.round(off / half), along)
        images = PingImages.of(raw, grid, believed, window=None)
        # where a target stands is looked for in the sharpened image
        bright = np.unravel_index(np.argmax(np.abs(found.after)), grid.depth.shape)
        try:
            target = without_trend(sway_of_targets(images, np.array([bright])) - sway, along)
        except ValueError:                                  # some pings do not see it
            target = np.full(len(sway), np.nan)
        print(f"| {name} | {1e3 * sway.std():.2f} | {1e3 * off.std():.3f} | {1e3 * wrapped.std():.3f} | "
              f"{1e3 * np.sqrt(np.mean(found.uncertainty ** 2)):.3f} | {1e3 * target.std():.3f} | "
              f"{found.contrast[0]:.1f} -> {found.contrast[1]:.1f} | {seconds:.1f} |", flush=True)
        if options.picture:
            draw(options.picture, found, sway)


def draw(path, found, sway):
    """Draw images with the trajectory as it was believed and with what was found, and the sways."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, axes = plt.subplots(1, 3, figsize=(13, 4))
    loudest = 20 * np.log10(np.abs(found.after).max())
    for axis, image, title in ((axes[0], found.before, "as believed"), (axes[1], found.after, "sharpened")):
        axis.imshow(20 * np.log10(np.abs(image) + 1e-12), vmin=loudest - 40, vmax=loudest, cmap="magma", origin="lower")
        axis.set(title=title, xlabel="across", ylabel="along")
    ping = np.arange(len(sway))
    axes[2].plot(ping, 1e3 * sway, "k", label="truth")
    axes[2].plot(ping, 0 * ping, ":", label="start")
    axes[2].errorbar(ping, 1e3 * found.sway, 1e3 * found.uncertainty, fmt=".", label="found")
    axes[2].set(xlabel="ping", ylabel="sway [mm]")
    axes[2].legend()
    figure.savefig(path, dpi=80, bbox_inches="tight")


if __name__ == "__main__":
    main()
