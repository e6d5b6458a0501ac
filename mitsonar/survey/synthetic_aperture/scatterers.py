"""The scatterers that a strip's echoes are made of: the truth of its speckle.

Each is a point of a surface with a complex Gaussian amplitude g of its own, E[|g|²] = 1, and the area dA of the cell
that it stands for. Its echo has the energy |g|² σ dA, σ -> the strength of the surface (`echoes.scatterers`).
"""
from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import numpy as np
import xarray as xr

from mitsonar.echoes.scatterers.pieces import pieces_in_reach
from mitsonar.echoes.scatterers.scatterers import Scatterers

from .plan import StripSurvey
from .truth import MeanLine

MOST = 100_000_000                 # that a table holds: 5 GB
BLOCK = 1 << 20


def scatterers_of(survey: StripSurvey) -> xr.Dataset:
    """Return the scatterers within the range of a strip."""
    cells = Scatterers(survey.geometry, survey.cell_size, survey.pass_number)
    middle = survey.track.position.mean(0)
    longest = float(np.linalg.norm(survey.track.position - middle, axis=1).max())
    farthest = 0.5 * survey.time[-1] * survey.water.fastest
    facets = cells.in_reach(middle, 0.0, farthest + longest)
    runs = pieces_in_reach(cells, facets, middle, 0.0, farthest + longest).runs()
    found = list(_blocks(survey, cells, runs, farthest))
    columns = {name: np.concatenate([block[name] for block in found]) if found else np.empty(0)
               for name in ("x", "y", "depth", "amplitude", "area", "label")}
    about = {"x": ("m", "east"), "y": ("m", "north"), "depth": ("m", "below the still surface"),
             "amplitude": ("1", "complex Gaussian of mean square 1"), "area": ("m²", "that it stands for"),
             "label": ("1", "number of its shape")}
    return xr.Dataset({name: ("scatterer", values, dict(zip(("units", "long_name"), about[name])))
                       for name, values in columns.items()})


def _blocks(survey: StripSurvey, cells: Scatterers, runs: tuple[np.ndarray, np.ndarray, np.ndarray],
            farthest: float) -> Iterator[dict[str, np.ndarray]]:
    """Yield the scatterers that are near enough to some ping, block by block."""
    line, total = MeanLine.of(survey.track), 0
    nearest = 0.5 * survey.time[0] * survey.water.slowest          # their pulses last into the record
    for facet, s in cells.listed(runs, BLOCK):
        some = cells.at(facet, s)
        dr.eval(some.point, some.area, some.amplitude)
        point = some.point.numpy().T
        near = _within(survey, line, point, nearest, farthest)
        total += int(near.sum())
        if total > MOST:
            raise ValueError(f"more than {MOST:.0e} scatterers lie within the strip's range; take larger cells, or a "
                             "shorter strip")
        real, imaginary = (part.numpy()[near] for part in some.amplitude)
        yield {"x": point[near, 0], "y": point[near, 1], "depth": -point[near, 2],
               "amplitude": (real + 1j * imaginary).astype(np.complex64), "area": some.area.numpy()[near],
               "label": cells.label[facet.numpy()[near]].astype(np.uint32)}


def _within(survey: StripSurvey, line: MeanLine | None, point: np.ndarray, nearest: float,
            farthest: float) -> np.ndarray:
    """Return True if points (N, 3) lie within range of the track and, of a straight one, in its beams."""
    place = survey.track.position
    if line is None:
        distance = np.min([np.linalg.norm(point - one, axis=1) for one in place], axis=0)
        return (distance > nearest) & (distance < farthest)
    ahead = np.array([np.sin(line.heading), np.cos(line.heading)])
    feet = line.feet(point[:, 0], point[:, 1])
    away = point - feet
    distance = np.linalg.norm(away, axis=1)
    along, ends = (feet - line.middle)[:, :2] @ ahead, (place - line.middle)[:, :2] @ ahead
    shortest = min(survey.transmit.length, survey.receive.length)
    wide = distance * min(survey.wavelength / max(shortest, 1e-6), 1.0)        # to the first null
    starboard = np.array([ahead[1], -ahead[0]])
    side = away[:, :2] @ starboard * survey.look[1] >= 0
    return (side & (distance > nearest) & (distance < farthest) & (along > ends.min() - wide)
            & (along < ends.max() + wide))
