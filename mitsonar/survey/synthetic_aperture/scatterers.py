"""Scatterers of a strip: the truth of its speckle.

A scatterer is a point of a surface with a complex Gaussian amplitude g of its own, E[|g|²] = 1, and represents a cell
of the area dA. Its echo has the energy |g|² σ dA, σ -> scattering strength of the surface (`echoes.scatterers`).
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

MOST = 100_000_000                 # scatterers in a table: 5 GB
BLOCK = 1 << 20                    # scatterers computed at once


def scatterers_of(survey: StripSurvey) -> xr.Dataset:
    """Return the scatterers within the range of a strip."""
    cells = Scatterers(survey.world.still, survey.cell_size, survey.pass_number, survey.world.seed)
    middle = survey.track.position.mean(0)
    longest = float(np.linalg.norm(survey.track.position - middle, axis=1).max())
    farthest = 0.5 * survey.time[-1] * survey.waters.fastest
    facets = cells.in_reach(middle, 0.0, farthest + longest)
    runs = pieces_in_reach(cells, facets, middle, 0.0, farthest + longest).runs()
    blocks = list(_blocks(survey, cells, runs, farthest))
    columns = {name: np.concatenate([block[name] for block in blocks]) if blocks else np.empty(0)
               for name in ("x", "y", "depth", "amplitude", "area", "label")}
    about = {"x": ("m", "east"), "y": ("m", "north"), "depth": ("m", "below the still surface"),
             "amplitude": ("1", "complex Gaussian of mean square 1"), "area": ("m²", "area it represents"),
             "label": ("1", "number of the shape")}
    return xr.Dataset({name: ("scatterer", values, dict(zip(("units", "long_name"), about[name])))
                       for name, values in columns.items()})


def _blocks(survey: StripSurvey, cells: Scatterers, runs: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
            farthest: float) -> Iterator[dict[str, np.ndarray]]:
    """Yield the scatterers within range of at least one ping, block by block."""
    line, total = MeanLine.of(survey.track), 0
    nearest = 0.5 * survey.time[0] * survey.waters.slowest          # echoes from there last into the record
    for facet, k in cells.listed(runs, BLOCK):
        block = cells.at(facet, k)
        block = cells.glinted(block, block.area)
        dr.eval(block.point, block.area, block.amplitude)
        point = block.point.numpy().T
        near = _within(survey, line, point, nearest, farthest)
        total += int(near.sum())
        if total > MOST:
            raise ValueError(f"More than {MOST:.0e} scatterers lie within range of the strip. Use larger cells or a "
                             "shorter strip.")
        real, imaginary = (part.numpy()[near] for part in block.amplitude)
        yield {"x": point[near, 0], "y": point[near, 1], "depth": -point[near, 2],
               "amplitude": (real + 1j * imaginary).astype(np.complex64), "area": block.area.numpy()[near],
               "label": cells.label[facet.numpy()[near]].astype(np.uint32)}


def _within(survey: StripSurvey, line: MeanLine | None, point: np.ndarray, nearest: float,
            farthest: float) -> np.ndarray:
    """Return True for points (N, 3) within range of the track and, if it is straight, within its beams."""
    place = survey.track.position
    if line is None:
        distance = np.min([np.linalg.norm(point - ping, axis=1) for ping in place], axis=0)
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
