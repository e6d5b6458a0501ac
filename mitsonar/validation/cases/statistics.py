"""Statistics of echoes: Rayleigh-distributed amplitudes, and K-distributed amplitudes of patchy beds."""
import numpy as np
from scipy.special import gamma, kv
from scipy.stats import kstest

from .. import scenes
from ..case import Case, Compared, Curve, Panel, Table

LOG_MEAN_DB, LOG_SPREAD_DB = -2.506816, 5.570043   # mean and standard deviation of exponential intensity in decibels
KNOWN_MEAN, ESTIMATED_MEAN = 1.628, 1.28           # √n D at 1 % (Kolmogorov; Lilliefors for a mean that is estimated)
PATCH, PINGS = 16.0, 1500                          # [m]
APART = 1.0                                        # [m], distance of pings, more than the aperture


def k_distribution(intensity: np.ndarray, shape: float) -> np.ndarray:
    """Return the distribution function of K-distributed intensity of mean 1: 1 - 2/Γ(ν) (ν I)^(ν/2) K_ν(2 √(ν I))."""
    intensity = np.maximum(intensity, 1e-9)
    root = 2 * np.sqrt(shape * intensity)
    return 1 - 2 / gamma(shape) * (shape * intensity) ** (shape / 2) * kv(shape, root)


def _sidescan(pings):
    """Return intensities over their means, in bins one pulse long of pings without common ground."""
    import mitsonar

    track = {"start": [0.0, -APART * (pings - 1) / 2, -20.0], "ping_rate_hz": 4.0,
             "speed_knots": APART * 4.0 * 3600 / 1852}
    scene = scenes.sidescan({"bed": scenes.bed(40.0, scenes.lambert(-20.0))}, depth=20.0, rays=60_000, pings=pings,
                            sensor={"speckle": True, **track}, film={"range_min": 25.0, "range": 62.5, "bins": 500})
    image = mitsonar.render(scene, seed=4)
    return 10 ** ((image["level"].values.astype(float) - image["mean_level"].values.astype(float)).ravel() / 10)


def _patchy(shape, pings):
    """Return intensities in the middles of patches over the mean intensities without patches."""
    import mitsonar

    # one patch in each ping, along the middles of patches; slow, because sidescans move while echoes return
    track = {"start": [0.0, -PATCH * (pings - 1) / 2, -20.0], "ping_rate_hz": 0.05,
             "speed_knots": PATCH * 0.05 * 3600 / 1852}
    images = []
    for patches in ({}, {"patchiness": shape, "patch_size": PATCH}):
        scene = scenes.sidescan(
            {"bed": scenes.bed(40.0, {**scenes.lambert(-27.0), **patches}, size=20.0 * PATCH + PATCH * pings)},
            depth=20.0, rays=25_000, pings=pings, sensor={**track, "speckle": bool(patches)},
            film={"range_min": 25.0, "range": 46.0, "bins": 280})
        images.append(mitsonar.render(scene, seed=5))
    mean = 10 ** (images[0]["mean_level"].values.astype(float) / 10)
    slant = images[0]["range"].values
    bins = [int(np.argmin(abs(slant - np.hypot(20.0, (k + 0.5) * PATCH)))) for k in (1, 2)]
    level = 10 ** (images[1]["level"].values.astype(float) / 10)
    return (level / mean.mean((0, 1)))[..., bins].ravel()


def _element(beds):
    """Return intensities over their mean, of nearly independent samples of an element's response."""
    import mitsonar

    samples = []
    for number in range(beds):
        scene = scenes.array_sonar(
            {f"bed {number}": scenes.bed(20.0, scenes.lambert(-27.0), size=60.0)}, depth=10.0,
            film={"range": 29.0, "range_min": 20.0, "sample_rate_khz": 100.0}, integrator={"cell": 0.2})
        response = mitsonar.impulse_response(scene)
        r = 750.0 * response["time"].values
        density = r ** -5.0 * 10 ** (-0.2 * 0.030 * r)
        samples.append((response.values[0, 0, 0] / np.sqrt(density))[20:-20:3])
    power = np.abs(np.concatenate(samples)) ** 2
    return power / power.mean()


def _rows(name, intensity, moment, distribution, critical, bias=0.0):
    """Yield the second moment, allowed three standard errors and a bias, and the Kolmogorov-Smirnov distance."""
    root = np.sqrt(intensity.size)
    allowed = 3 * float(np.std(intensity ** 2)) / root + bias * moment
    yield Compared(f"{name}: second moment (n = {intensity.size})", float(np.mean(intensity ** 2)), moment, allowed,
                   "-")
    yield Compared(f"{name}: √n times the largest distance of distributions", float(
        root * kstest(intensity, distribution).statistic), 0.0, critical, "-")


def _panel(title, intensity, distribution):
    level = np.linspace(-25, 12, 200)
    got = np.quantile(intensity, np.linspace(0.005, 0.995, 60))
    return Panel(title, "intensity over its mean [dB]", "share below", (
        Curve("closed form", level, distribution(10 ** (level / 10))),
        Curve("chain", 10 * np.log10(got), np.linspace(0.005, 0.995, 60), ".")))


def _exponential(intensity):
    return 1 - np.exp(-intensity)


def _run(quick):
    rows, panels = [], []
    intensity = _sidescan(40 if quick else 200)
    rows += [Compared("sidescan, Rayleigh: mean", float(intensity.mean()), 1.0, 3 / np.sqrt(intensity.size), "-"),
             *_rows("sidescan, Rayleigh", intensity, 2.0, "expon", KNOWN_MEAN)]
    level = 10 * np.log10(intensity)
    error = LOG_SPREAD_DB / np.sqrt(level.size)
    rows += [Compared("sidescan, Rayleigh: mean level less level of the mean", float(level.mean()), LOG_MEAN_DB,
                      3 * error, "dB"),
             Compared("sidescan, Rayleigh: standard deviation of the level", float(level.std()), LOG_SPREAD_DB,
                      4 * error, "dB")]
    panels.append(_panel("sidescan, Rayleigh", intensity, _exponential))
    intensity = _element(2 if quick else 8)
    rows += _rows("element signals, Rayleigh", intensity, 2.0, "expon", ESTIMATED_MEAN)
    panels.append(_panel("element signals, Rayleigh", intensity, _exponential))
    for shape in (2.0,) if quick else (0.5, 1.0, 2.0, 5.0):
        intensity = _patchy(shape, PINGS // 3 if quick else PINGS)

        def distribution(values: np.ndarray, shape: float = shape) -> np.ndarray:
            return k_distribution(values, shape)

        rows += [Compared(f"patchy bed, ν = {shape:g}: mean", float(intensity.mean()), 1.0,
                     3 * float(intensity.std()) / np.sqrt(intensity.size), "-"),
                 *_rows(f"patchy bed, ν = {shape:g}", intensity, 2 * (1 + 1 / shape), distribution, KNOWN_MEAN, 0.03)]
        panels.append(_panel(f"patchy bed, ν = {shape:g}", intensity, distribution))
    return Table(tuple(rows), tuple(panels))


CASE = Case(title="Statistics of echoes", run=_run, text=(
    "Bins one pulse long of a sidescan over a flat bed, and samples of element signals: intensity is exponential, "
    "second moment 2, -2.507 ± 5.570 dB in decibels; a bed whose strength varies by patches of 16 m, one patch a "
    "resolution cell and ping: K distribution, second moment 2(1 + 1/ν) (Jakeman and Pusey 1976; Abraham and Lyons "
    "2002). The allowed errors are three standard errors of moments, 3 % more for patches that sidelobes reach, and "
    "the Kolmogorov-Smirnov distance that one sample in a hundred exceeds. Seeds are fixed."))
