"""Dataset of a comparison of a real record with a simulated one, and the evidence that each of its terms gives.

Dimensions: ``line`` (real, simulated) and, of lines of soundings, ``angle``: middles of bins of the angle from the
vertical [rad], positive to starboard; of sidescans ``clue``, ``side``, ``statistic``, ``distance`` [m], and ``row``,
``column`` of the pictures. Differences are simulated - real. Spreads are 1.4826 times the median absolute
deviation, which is the standard deviation of a Gaussian.
"""
from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.device.record_table import RecordTable, rows
from mitsonar.io.records.records import SonarImage
from mitsonar.units import deg_from_radians

LINES = ("real", "simulated")
STRONGEST = 12                     # clues of the printed table
INNER = 60.0                       # [deg] from the vertical: the part of the swath that figures are of
_ANGLE, _BOTH, _LINE = ("angle",), ("line", "angle"), ("line",)

SOUNDINGS = RecordTable([
    *rows("times", _LINE, False,
          ("ray_time_bare", "f8", "m", "rays to the real places less the real times, times c / 2, rms"),
          ("ray_time", "f8", "m", "the same after three lever arms a ping, rms")),
    *rows("times", _BOTH, False,
          ("ray_time_by_angle", "f8", "m", "rays less times after three lever arms, mean"),
          ("ray_time_rms_by_angle", "f8", "m", "the same, rms")),
    *rows("times", _ANGLE, False,
          ("echo_time_difference", "f8", "m", "detected times at the same places times c / 2, after three lever arms a "
                                              "ping, median"),
          ("echo_time_spread", "f8", "m", "of the same, from sounding to sounding")),
    *rows("depths", _ANGLE, False,
          ("depth_difference", "f8", "%", "depth at the same places, over the depth, median"),
          ("depth_spread", "f8", "%", "of the same, from sounding to sounding")),
    *rows("strengths", _BOTH, False, ("strength", "f8", "dB", "backscattering strength of the mean intensity")),
    *rows("strengths", _ANGLE, False,
          ("strength_difference", "f8", "dB", "difference of strengths"),
          ("strength_shape", "f8", "dB", "the same less the best constant within 60 degrees"),
          ("strength_error", "f8", "dB", "standard error of the difference by the speckle of both, were soundings "
                                         "independent")),
    *rows("noise", _BOTH, False,
          ("depth_noise_beams", "f8", "%", "depth less the mean of both neighbouring beams, as one's noise"),
          ("depth_noise_pings", "f8", "%", "depth less the mean of the pings before and after, as one's noise"),
          ("strength_noise", "f8", "dB", "strength less the mean of both neighbouring beams, as one's noise")),
    *rows("detections", _BOTH, False,
          ("valid_share", "f8", "%", "beams with a sounding"),
          ("phase_share", "f8", "%", "soundings detected by phase")),
    *rows("detections", _ANGLE, False,
          ("silent", "i4", "1", "1 where only the real line has soundings, in a quarter of its pings or more")),
    *rows("quality", _BOTH, False,
          ("quality", "f8", "1", "depth over its spread by detection, as log10, median"),
          ("uncertainty", "f8", "m", "stated standard deviation of the depth, median")),
    *rows("water column", _BOTH, False,
          ("column_water", "f8", "dB", "mean level before the first return, less that of the bed in the beam"),
          ("column_ring", "f8", "dB", "mean level at the first return's time, less that of the bed in the beam"),
          ("column_noise", "f8", "dB", "spread of levels before the first return")),
])

SIDESCANS = RecordTable([
    *rows("clues", ("line", "clue"), False, ("clue_median", "f8", "1", "median of a clue over its items")),
    *rows("clues", ("clue",), False,
          ("auc", "f8", "1", "chance that a real item has the larger value"),
          ("auc_error", "f8", "1", "standard error of auc, runs of pings drawn anew"),
          ("auc_control", "f8", "1", "auc of real port against real starboard")),
    *rows("statistics", ("line", "side", "statistic"), False, ("value", "f8", "1", "statistic of a side")),
    *rows("statistics", ("line", "side", "distance"), False,
          ("mean_db", "f8", "dB", "mean intensity, over the mean of all ranges beyond the first return")),
    *rows("pictures", ("line", "row", "column"), False,
          ("picture", "f4", "1", "amplitudes over their median beyond the first return, port mirrored on the left")),
])

EVIDENCE = {
    "times":
        "Times along rays to the real places test the water and the rays, not the detector. Detected times at the "
        "same places also test both detectors; three lever arms a ping take out offsets of the arrays, heave and "
        "roll, so that errors of these do not show.",
    "depths":
        "Differences of depth test the reduction, the mounting and the bias of the detector. If the simulated bed "
        "was made of the real soundings, they cannot prove that this bed is there, and detail finer than its cells "
        "is missing.",
    "strengths":
        "The shape over the angle tests the bed's law and the patterns of the beams. A bed that took its strengths "
        "from the real line proves only that they come back. The constant proves nothing: recorded strengths are "
        "seldom calibrated, and instruments flatten them near nadir.",
    "noise":
        "Differences of neighbours test the detector and the speckle. The real line's also hold the relief of the "
        "bed between neighbours and its filters, which average or discard soundings, so equal numbers do not prove "
        "equal detectors.",
    "detections":
        "Shares show where the simulated sounder loses the bed. Rules by which instruments reject or interpolate "
        "soundings are not public, so small differences prove nothing.",
    "quality":
        "Both are each instrument's own statements. They show whether the simulation states its errors alike, not "
        "whether either statement is true.",
    "water column":
        "Levels over that of the bed test the side lobes, the noise and the volume. Gain over range that a file "
        "does not state, and life or bubbles in the real water, change them too.",
    "clues":
        "A clue near 0.5 does not give the simulation away; the control is what two sides of one real record "
        "reach. One line of each kind cannot prove that other lines are alike, and no clue proves that objects "
        "look right.",
    "statistics":
        "Ratios of neighbours test speckle, pulse, beam and the recorder's filter whatever the gain. The mean over "
        "range also holds the recorder's gain, which files do not state.",
    "pictures":
        "Pictures have the same gain: over the median beyond the first return. They show what no statistic "
        "measures, and prove nothing.",
}


class LineComparison(SonarImage):
    """Comparison of a real record with a simulated one, as an `xarray.Dataset` that prints its terms and evidence."""

    __slots__ = ()

    @property
    def sentences(self) -> list[str]:
        """Return sentences: the remarks of the comparison, then the evidence of each of its terms."""
        terms = dict.fromkeys(str(one.attrs["term"]) for one in self.data_vars.values() if "term" in one.attrs)
        return [*self.attrs.get("remarks", []), *(f"{term}: {EVIDENCE[term]}" for term in terms)]

    def __repr__(self) -> str:
        sidescan = {"line", "side", "statistic"} | ({"clue"} if "auc" in self else set())
        if not {"line", "angle"} <= set(self.dims) and not sidescan <= set(self.dims):
            return super().__repr__()                                    # of a part, such as one line
        head = f"Comparison of {self.attrs['real']} with {self.attrs['simulated']}"
        return "\n".join([head, *("    " + row for row in table_of(self)), *(f"  - {one}" for one in self.sentences)])


def comparison(values: dict[str, Any], table: RecordTable, coords: dict[str, Any],
               attrs: dict[str, Any]) -> LineComparison:
    """Return a comparison of variables of a table; those whose values are None are left out."""
    variables = {}
    for name, value in values.items():
        if value is not None:
            variables[name] = table.variable(name, value)
            variables[name].attrs |= {"term": table[name].group, "evidence": EVIDENCE[table[name].group]}
    return LineComparison(variables, coords, {"kind": "comparison", **attrs})


def restored(dataset: xr.Dataset) -> LineComparison:
    """Return a comparison that was read from a file; raise `ValueError` if it is another record."""
    if dataset.attrs.get("kind") != "comparison":
        raise ValueError("this record is no comparison; give a file that `mitsonar compare` wrote.")
    return LineComparison(dataset.data_vars, dataset.coords, dataset.attrs)


def opened(path: FilePath) -> LineComparison:
    """Return the comparison in a file."""
    from mitsonar.io.records import netcdf

    found = netcdf.read(path)
    return restored(found if isinstance(found, xr.Dataset) else found.to_dataset(name="signals"))


def inner(dataset: xr.Dataset) -> np.ndarray:
    """Return True for the bins of angle within 60 degrees of the vertical."""
    return np.abs(deg_from_radians(dataset["angle"].values)) < INNER


def table_of(dataset: xr.Dataset) -> list[str]:
    """Return the lines of a table of figures: medians within 60 degrees, or the strongest clues and the statistics."""
    if "angle" not in dataset.dims:
        return _sidescan_rows(dataset)
    here = inner(dataset)
    cells: list[tuple[str, ...]] = [("within 60 degrees", "unit", "real", "simulated", "difference", "largest")]
    for name, one in dataset.data_vars.items():
        values = one.values if "angle" not in one.dims else one.values[..., here]
        if "line" in one.dims:
            real, simulated = (_middle(part) for part in values)
            apart = np.abs(np.diff(values, axis=0))
            row = real, simulated, simulated - real, _largest(apart) if "angle" in one.dims else np.nan
        else:
            row = np.nan, np.nan, values.sum() if name == "silent" else _middle(values), _largest(values)
        unit = "" if one.attrs["units"] == "1" else one.attrs["units"]
        cells.append((str(name), unit, *(f"{value:.3g}" if np.isfinite(value) else "" for value in row)))
    return _columns(cells)


def _sidescan_rows(dataset):
    """Return the tables of the clues that tell the records apart most, and of the statistics of both sides."""
    rows: list[str] = []
    if "auc" in dataset:
        cells: list[tuple[str, ...]] = [("strongest clues", "real", "simulated", "AUC", "error", "control")]
        for number in np.argsort(-excess(dataset), kind="stable")[:STRONGEST]:
            one = dataset.isel(clue=number)
            cells.append((str(one["clue"].values), *(f"{float(value):.3g}" for value in (
                *one["clue_median"].values, one["auc"], one["auc_error"], one["auc_control"]))))
        rows += _columns(cells)
    cells = [("statistics, port and starboard", "real", "", "simulated", "")]
    for number, name in enumerate(dataset["statistic"].values):
        cells.append((str(name), *(f"{value:.3g}" for value in dataset["value"].values[:, :, number].ravel())))
    return [*rows, *_columns(cells)]


def excess(dataset: xr.Dataset) -> np.ndarray:
    """Return how far each clue's AUC is from 0.5 beyond its control; -1 if unknown."""
    away, control = (np.abs(dataset[name].values - 0.5) for name in ("auc", "auc_control"))
    return np.where(np.isfinite(away), away - np.nan_to_num(control), -1.0)


def _middle(values):
    return float(np.median(values[np.isfinite(values)])) if np.isfinite(values).any() else np.nan


def _largest(values):
    return float(np.max(np.abs(values[np.isfinite(values)]))) if np.isfinite(values).any() else np.nan


def _columns(cells):
    widths = [max(len(row[column]) for row in cells) for column in range(len(cells[0]))]
    return ["  ".join([row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:]))])
            for row in cells]
