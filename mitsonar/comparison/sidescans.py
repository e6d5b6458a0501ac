"""Comparison of a recorded sidescan with a rendered one: pictures, statistics, and clues that tell them apart."""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr

from mitsonar.imaging.picture_statistics import PictureStatistics, first_return, measure
from mitsonar.io.sidescan_lines.record import SIDES

from .record import SIDESCANS, LineComparison, comparison
from .sidescan_amplitudes import (
    ClueItems,
    SidescanAmplitudes,
    amplitudes_of,
    auc,
    auc_error,
    bed_items,
    run_items,
)

KINDS: dict[str, Callable[[SidescanAmplitudes], ClueItems]] = {"patches of bed": bed_items, "runs of pings": run_items}
DISTANCES = 200                    # of the mean over range
DATED = 1e8                        # [s] above which times count from 1970
SLACK = 0.05                       # [s] between the clocks of two records of one line
ROWS, COLUMNS = 480, 800           # most pixels of a picture
STATISTICS: dict[str, Callable[[PictureStatistics], float]] = {
    "coefficient of variation": lambda one: one.variation,
    "correlation in range, lag 1": lambda one: one.range_correlation[0],
    "correlation along track, lag 1": lambda one: one.ping_correlation[0],
    "correlation in range with texture": lambda one: one.range_texture,
    "correlation along track with texture": lambda one: one.ping_texture,
    **{f"quantile {share}": lambda one, number=number: one.quantiles[number]
       for number, share in enumerate(("1 %", "10 %", "50 %", "90 %", "99 %"))},
    "depth of shadows [dB]": lambda one: one.shadow_db[1],
    "first return: rise [m]": lambda one: one.rise,
    "first return: peak [dB]": lambda one: one.peak_db,
    "water column: level [dB]": lambda one: one.water_db,
    "dynamic range [dB]": lambda one: one.dynamic_range_db,
    "steps of the recorder": lambda one: one.values,
    "saturated share": lambda one: one.saturated,
}


def compare_sidescans(real: xr.Dataset, simulated: xr.Dataset, names: tuple[str, str]) -> LineComparison:
    """Return the comparison of two sidescans; raise `ValueError` if they are too short or lack a side."""
    real, simulated, remarks = _of_one_time(real, simulated)
    lines = amplitudes_of(real, names[0]), amplitudes_of(simulated, names[1])
    for line in lines:
        if min(line.sides[0].shape) < 2:
            raise ValueError(f"{line.name} has {line.sides[0].shape[0]} ping of {line.sides[0].shape[1]} samples; a "
                             "comparison takes two or more.")
    remarks += [f"{name}: {line.about.partition(';')[0]}, {' pings of '.join(map(str, line.sides[0].shape))} samples "
                f"of {100 * line.spacing:.3g} cm" for name, line in zip(("real", "simulated"), lines)]
    values, coords = _clues(lines, remarks)
    reach = min(line.sides[0].shape[1] * line.spacing for line in lines)
    distance = (np.arange(DISTANCES) + 0.5) * reach / DISTANCES
    values |= {"value": np.stack([_statistics(line, remarks) for line in lines]),
               "mean_db": np.stack([_mean_db(line, distance) for line in lines]),
               "picture": np.stack([_picture(line, reach) for line in lines])}
    coords |= {"line": ["real", "simulated"], "side": list(SIDES), "statistic": list(STATISTICS),
               "distance": ("distance", distance, {"units": "m", "long_name": "slant range"}),
               "column": ("column", (np.arange(COLUMNS) + 0.5 - COLUMNS / 2) * 2 * reach / COLUMNS,
                          {"units": "m", "long_name": "slant range, port negative"})}
    return comparison(values, SIDESCANS, coords, {"of": "sidescan", "real": names[0], "simulated": names[1],
                                                  "remarks": remarks})


def _of_one_time(real, simulated):
    """Return the pings of each record within the time that both cover, and remarks; all pings without common times."""
    lines, remarks = [real, simulated], []
    times = [line["ping_time"].values if "ping_time" in line else np.zeros(1) for line in lines]
    if min(time[0] for time in times) > DATED:
        first, last = max(time[0] for time in times) - SLACK, min(time[-1] for time in times) + SLACK
        within = [(time >= first) & (time <= last) for time in times]
        if min(some.sum() for some in within) > 1:
            remarks = [f"{some.sum()} of {some.size} {name} pings are of the time that both records cover"
                       for some, name in zip(within, ("real", "simulated")) if not some.all()]
            lines = [line.isel(ping=some) for line, some in zip(lines, within)]
    return *lines, remarks


def _clues(lines, remarks):
    """Return the terms of clues and their coordinates, of the kinds of items that both lines have enough of."""
    found = {"clue": [], "kind": [], "median": [], "auc": [], "auc_error": [], "auc_control": []}
    for kind, items_of in KINDS.items():
        try:
            real, simulated = (items_of(line) for line in lines)
        except ValueError as error:
            remarks.append(f"no clues of {kind}: {str(error).rstrip('.')}")
            continue
        for number, name in enumerate(real.names):
            if name not in simulated.names:
                continue
            one, other = real.clues[:, number], simulated.clues[:, simulated.names.index(name)]
            scores, is_real = np.concatenate([one, other]), np.arange(one.size + other.size) < one.size
            row = {"clue": name, "kind": kind, "median": [_median(one), _median(other)], "auc": auc(one, other),
                   "auc_error": auc_error(scores, is_real, np.concatenate([real.runs, simulated.runs])),
                   "auc_control": auc(one[real.sides == 0], one[real.sides == 1])}
            for key, value in row.items():
                found[key].append(value)
    if not found["clue"]:
        return {}, {}
    return ({"clue_median": np.array(found["median"]).T, **{name: found[name] for name in (
        "auc", "auc_error", "auc_control")}}, {"clue": found["clue"], "kind": ("clue", found["kind"])})


def _median(values):
    return float(np.nanmedian(values)) if np.isfinite(values).any() else np.nan


def _statistics(line, remarks):
    """Return the statistics (side, statistic) of a line; NaN of a side that has too little bed."""
    rows = []
    for side, amplitude in zip(SIDES, line.sides):
        try:
            found = measure(amplitude, line.spacing)
            rows.append([float(of(found)) for of in STATISTICS.values()])
        except ValueError as error:
            remarks.append(f"no statistics of {line.name}, {side}: {str(error).rstrip('.')}")
            rows.append([np.nan] * len(STATISTICS))
    return np.array(rows)


def _mean_db(line, distance):
    """Return the mean intensity (side, distance) over that of all ranges beyond the first return."""
    count = line.sides[0].shape[1]
    at = np.minimum((distance / line.spacing).astype(int), count - 1)
    rows = []
    for amplitude in line.sides:
        power = amplitude ** 2
        cells = np.add.reduceat(power.mean(0), at) / np.maximum(np.diff(np.append(at, count)), 1)
        rows.append(10 * np.log10(np.maximum(cells / max(_beyond(line, amplitude, power).mean(), 1e-300), 1e-12)))
    return np.array(rows)


def _beyond(line, amplitude, values):
    """Return values beyond the first return, of pings where any are; all values where no first return is found."""
    try:
        first = first_return(amplitude, line.spacing)
    except ValueError:
        return values
    beyond = np.arange(amplitude.shape[1]) > first[:, None]
    return values[beyond] if beyond.any() else values


def _picture(line, reach):
    """Return amplitudes (row, column) over their median beyond the first return, port mirrored on the left."""
    half = COLUMNS // 2
    ping = np.linspace(0, len(line.sides[0]) - 1, ROWS).round().astype(int)
    sample = np.minimum((np.arange(half) + 0.5) * reach / half / line.spacing, line.sides[0].shape[1] - 1).astype(int)
    port, starboard = (amplitude[np.ix_(ping, sample)] / max(np.median(_beyond(line, amplitude, amplitude)), 1e-12)
                       for amplitude in line.sides)
    return np.concatenate([port[:, ::-1], starboard], axis=1).astype(np.float32)
