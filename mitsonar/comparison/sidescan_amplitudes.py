"""Amplitudes of a sidescan, recorded or rendered, and items that clues are taken from: patches of bed, runs of pings.

A rendered record is compared by its variable `recorded`, the counts of its recorder, as it is. Without one, by

    A = 10^((L + 30 log R + 2 a R) / 20)

L -> `level`, R -> `range`, held before the bed's first return at the altitude: a gain that fell with R there would hide
the transmission. a -> the attribute absorption_db.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import ndimage

from mitsonar.dataset.scores import auc as area_under
from mitsonar.imaging.picture_statistics import first_return
from mitsonar.io.sidescan_lines.picture import as_image
from mitsonar.io.sidescan_lines.record import SIDES, is_recorded

from .clue_features import RUN, patch_clues, run_clues

PATCHES = 14                       # across the bed of a run
NEAR = 2.0                         # [m] beyond the first return, no bed
DARK = 0.15                        # of the median: patches that are darker lie in shadow
FEWEST = 8                         # items
SILENT_DB = -190.0                 # levels below have no echo
DRAWS = 200                        # of runs, for the standard error of an AUC


@dataclass(frozen=True, kw_only=True, eq=False)
class SidescanAmplitudes:
    """Amplitudes of a sidescan's line, and how they came about."""

    name: str
    sides: tuple[np.ndarray, np.ndarray]  # (ping, sample): port and starboard, near range first
    spacing: float  # [m]: of samples
    about: str  # what is known of it


@dataclass(frozen=True, kw_only=True, eq=False)
class ClueItems:
    """Items that clues are taken from."""

    names: tuple[str, ...]  # of clues, F
    clues: np.ndarray  # (n, F)
    runs: np.ndarray  # (n,): number of the run of pings, or of the sector of a fan; both sides share it
    sides: np.ndarray  # (n,): 0 port, 1 starboard; halves of a fan
    pictures: list[np.ndarray]  # n arrays (row, sample), to look at


def amplitudes_of(record: xr.Dataset, name: str) -> SidescanAmplitudes:
    """Return the amplitudes of a sidescan; raise `ValueError` if the record has not both sides."""
    sides = [str(side) for side in np.atleast_1d(record["side"].values)] if "side" in record.dims else []
    if sides != list(SIDES):
        raise ValueError(f"{name} is no sidescan of two sides, it has {', '.join(sides) or 'none'}; give a sidescan's "
                         "record of port and starboard.")
    if is_recorded(record):
        amplitude = np.nan_to_num(10 ** (as_image(record)["level"].values.astype(float) / 20))
        step = 0.75 * np.exp2(-record["weight"].values.astype(float))[..., None]
        amplitude, about = np.where(amplitude < step, 0.0, amplitude), "as recorded"
    else:
        rendered, about = rendered_amplitudes(record)
        amplitude = rendered.transpose("ping", "side", "range").values
    spacing = float(np.median(np.diff(record["range"].values)))
    return SidescanAmplitudes(name=name, sides=(amplitude[:, 0], amplitude[:, 1]), spacing=spacing, about=about)


def rendered_amplitudes(image: xr.Dataset) -> tuple[xr.DataArray, str]:
    """Return the amplitudes of a rendered image, and what they are."""
    given = " ".join(f"{name}={value}" for name, value in image.attrs.get("parameters", {}).items())
    scene = f"{image.attrs.get('file', 'scene')} {given}".strip()
    if "recorded" in image:
        return image["recorded"].astype(float), f"counts of its recorder; {scene}"
    distance = image["range"].astype(float)
    if "altitude" in image:
        distance = np.maximum(distance, float(image["altitude"].median()))
    level = image["level"].astype(float)
    gain = 30 * np.log10(np.maximum(distance, 1e-2)) + 2 * image.attrs.get("absorption_db", 0.0) * distance
    amplitude = (10 ** ((level + gain - 120) / 20)).where(level > SILENT_DB, 0.0)
    return amplitude.transpose(*level.dims), f"levels, no recorder; {scene}"


def bed_items(record: SidescanAmplitudes) -> ClueItems:
    """Cut patches of bed, RUN pings by RUN samples, over the median of their range."""
    patches, runs, sides = [], [], []
    for number, amplitude in enumerate(record.sides):
        first = first_return(amplitude, record.spacing)
        count = amplitude.shape[1]
        bed = np.ma.array(amplitude, mask=np.arange(count) < first[:, None] + 3)
        middle = np.maximum(ndimage.gaussian_filter1d(np.ma.median(bed, 0).filled(1.0), 6), 1e-9)
        for run, start in enumerate(range(0, len(amplitude) - RUN + 1, RUN)):
            near = int(first[start:start + RUN].max() + NEAR / record.spacing)
            for place in np.linspace(near, .97 * count - RUN, PATCHES).astype(int) if near < .97 * count - RUN else ():
                patch = amplitude[start:start + RUN, place:place + RUN] / middle[place:place + RUN]
                if patch.mean() >= DARK:
                    patches.append(patch)
                    runs.append(run)
                    sides.append(number)
    return items_of(record.name, patches, patch_clues, runs, sides)


def run_items(record: SidescanAmplitudes) -> ClueItems:
    """Take runs of RUN pings of a side as a whole."""
    pictures, runs, sides, clues = [], [], [], []
    for number, amplitude in enumerate(record.sides):
        first, other = first_return(amplitude, record.spacing), record.sides[1 - number]
        for run, start in enumerate(range(0, len(amplitude) - RUN + 1, RUN)):
            part = slice(start, start + RUN)
            clues.append(run_clues(amplitude[part], other[part], first[part], record.spacing))
            pictures.append(amplitude[part])
            runs.append(run)
            sides.append(number)
    names = tuple(dict.fromkeys(name for one in clues for name in one))
    return items_of(record.name, pictures, None, runs, sides, names,
                    np.array([[one.get(name, np.nan) for name in names] for one in clues]))


def items_of(name: str, pictures: list[np.ndarray], clues_of: Callable[[np.ndarray], dict[str, np.ndarray]] | None,
             runs: Sequence[int], sides: Sequence[int], names: tuple[str, ...] = (),
             clues: np.ndarray | None = None) -> ClueItems:
    """Return items with their clues; raise `ValueError` if there are fewer than eight."""
    if len(pictures) < FEWEST:
        raise ValueError(f"{name} has {len(pictures)} items to compare; at least {FEWEST} are needed: give more pings, "
                         "or a longer range.")
    if clues_of:
        found = clues_of(np.stack(pictures))
        names, clues = tuple(found), np.stack(list(found.values()), 1)
    return ClueItems(names=tuple(names), clues=np.asarray(clues), runs=np.array(runs), sides=np.array(sides),
                     pictures=pictures)


def auc(real: Sequence[float] | np.ndarray, rendered: Sequence[float] | np.ndarray) -> float:
    """Return the chance that a real value is above a rendered one; NaN of fewer than four."""
    real, rendered = (np.asarray(values, float)[np.isfinite(values)] for values in (real, rendered))
    if min(real.size, rendered.size) < 4:
        return np.nan
    return area_under(np.concatenate((real, rendered)), np.arange(real.size + rendered.size) < real.size)


def auc_error(scores: np.ndarray, real: np.ndarray, runs: np.ndarray) -> float:
    """Return the standard error of the AUC of scores: whole runs drawn anew."""
    rng, names = np.random.default_rng(0), np.unique(runs)
    places = [np.flatnonzero(runs == name) for name in names]
    drawn = []
    for _ in range(DRAWS):
        chosen = np.concatenate([places[one] for one in rng.integers(0, names.size, names.size)])
        drawn.append(auc(scores[chosen][real[chosen]], scores[chosen][~real[chosen]]))
    return float(np.nanstd(drawn)) if np.isfinite(drawn).any() else np.nan
