"""From the samples of an instrument to the nodes of a profile: the water only, the way down only, each depth once.

An instrument logs in time: in air, at rest under the surface until its sensors have settled (the soak), down, and up
through water that it has stirred. What is kept:

- samples in the water. In air are those with a sound speed below `SLOWEST_WATER`, and those within `SPLASH` of the
  surface whose conductivity is below half the median of the cast (a cell half full of water);
- of these, no depth that departs from the median of the five around it by more than `SPIKE` and ten times the step
  that three quarters of the samples stay below: one wrong pressure must not be the deepest sample;
- of these, what comes before the deepest sample and, where the instrument came up again by more than `RISE` to less
  than `SOAK` before it went down for good, what comes after the top of that turn;
- of these, samples at least as deep as every sample before, so that heave does not fold the profile;
- of these, one for each depth: samples less than `SAME_DEPTH` deeper than the first of a group are averaged.

Processed casts are sorted, and samples at one depth averaged. A plain table is taken at its word: there a
depth that does not increase is an error.
"""
import numpy as np

from .records import Cleaning, Samples

SLOWEST_WATER = 1350.0  # [m/s]: fresh water at 0 deg C has 1402, and instruments write 0 in air
SPLASH = 0.5            # [m]
RISE, SOAK = 0.1, 2.0   # [m]
SAME_DEPTH = 0.05       # [m]
SPIKE = 1.0             # [m]


def cleaned(samples: Samples) -> tuple[Samples, Cleaning]:
    """Clean samples that have a depth, by their state.

    Parameters
    ----------
    samples : Samples

    Returns
    -------
    Samples
        Depths strictly increase.
    Cleaning

    Raises
    ------
    ValueError
        If depths do not increase where they must, or a recording holds no water or no way down.
    """
    counts = {"read": samples.lines.size + samples.flagged, "flagged": samples.flagged}
    if samples.state == "ordered":
        _check_order(samples)
        return samples, Cleaning(**counts)
    if samples.state == "processed":
        samples, counts["merged"] = _merged(samples.taking(np.argsort(samples.columns["depth"], kind="stable")), 0.0)
        return samples, Cleaning(**counts)
    for name, step in (("in_air", _in_water), ("spikes", _without_spikes), ("upcast", _to_the_deepest),
                       ("soak", _after_the_soak), ("reversals", _deepening)):
        before, samples = samples.lines.size, samples.taking(step(samples))
        counts[name] = before - samples.lines.size
    samples, counts["merged"] = _merged(samples, SAME_DEPTH)
    return samples, Cleaning(**counts)


def _check_order(samples):
    depth = samples.columns["depth"]
    bad = np.flatnonzero(np.diff(depth) <= 0)
    if bad.size:
        k = bad[0] + 1
        raise ValueError(f"line {samples.lines[k]}: depth {depth[k]:g} m follows {depth[k - 1]:g} m; depths are "
                         "positive down and must increase from row to row: sort the rows and merge repeated depths.")


def _in_water(samples):
    columns = samples.columns
    below = columns["depth"] > SPLASH
    wet = columns.get("sound speed", np.full(below.shape, np.inf)) >= SLOWEST_WATER
    conductivity = columns.get("conductivity")
    if conductivity is not None and below.any():
        wet &= (conductivity > 0) & (below | (conductivity >= 0.5 * np.median(conductivity[below])))
    if not (wet & below).any():
        raise ValueError(f"all {wet.size} samples were taken in air or within {SPLASH:g} m of the surface; give a cast "
                         "that went into the water.")
    return wet


def _smoothed(depth):
    from scipy.ndimage import median_filter

    return median_filter(depth, 5, mode="nearest")


def _without_spikes(samples):
    depth = samples.columns["depth"]
    step = np.percentile(np.abs(np.diff(depth)), 75) if depth.size > 1 else 0.0
    return np.abs(depth - _smoothed(depth)) <= SPIKE + 10 * step


def _to_the_deepest(samples):
    depth = samples.columns["depth"]
    deepest = int(np.argmax(depth))
    top, span = depth[:deepest + 1].min(), np.ptp(depth)
    if top - depth.min() > max(0.5 * span, SPLASH):
        raise ValueError(f"it holds no way down: before its deepest sample (line {samples.lines[deepest]}) it has "
                         f"{top:g}..{depth[deepest]:g} m of {depth.min():g}..{depth[deepest]:g} m; give a recording "
                         "from the surface down, or a plain table sorted by depth.")
    return np.arange(depth.size) <= deepest


def _after_the_soak(samples):
    depth = samples.columns["depth"]
    steady = _smoothed(depth)                                   # one sample further up is no turn
    risen = np.flatnonzero((steady < SOAK) & (np.maximum.accumulate(steady) - steady > RISE))
    start = 0
    if risen.size:
        soak = int(np.argmax(steady[:risen[-1] + 1]))
        start = soak + int(np.argmin(depth[soak:risen[-1] + 1]))
    return np.arange(depth.size) >= start


def _deepening(samples):
    depth = samples.columns["depth"]
    return depth >= np.maximum.accumulate(depth)


def _merged(samples, width):
    """Average the samples of each depth, which are sorted; give them and how many vanished."""
    depth, starts = samples.columns["depth"], [0]
    for k, value in enumerate(depth.tolist()):
        if value - depth[starts[-1]] > width:
            starts.append(k)
    count = np.diff([*starts, depth.size])
    means = {what: np.add.reduceat(values, starts) / count for what, values in samples.columns.items()}
    return samples.taking(starts, **means), int(depth.size - count.size)
