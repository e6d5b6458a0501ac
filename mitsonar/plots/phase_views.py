"""Views of what an interferometric sidescan measures: phase, coherence, angle, and how far depths are off."""
from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.figure import Figure

from . import canvas
from .grid import Grid
from .titles import subtitle, title

__all__ = ["PHASES"]

WIDEST = 98.0                      # per cent of errors that the colours tell apart


def _phase(dataset: xr.Dataset, grid: Grid) -> Figure:
    cosine = grid.mean(dataset, lambda part: np.cos(part["phase"].values))
    sine = grid.mean(dataset, lambda part: np.sin(part["phase"].values))
    return _map(dataset, grid, np.arctan2(sine, cosine), "phase between the outer rows", "phase [rad]", "twilight",
                (-np.pi, np.pi))


def _coherence(dataset: xr.Dataset, grid: Grid) -> Figure:
    image = grid.mean(dataset, lambda part: part["coherence"].values)
    return _map(dataset, grid, image, "coherence of the rows", "coherence", "inferno", (0.0, 1.0))


def _angle(dataset: xr.Dataset, grid: Grid) -> Figure:
    image = np.rad2deg(grid.mean(dataset, lambda part: part["angle"].values))
    return _map(dataset, grid, image, "angle of the echoes", "below the horizontal [degrees]", "viridis", (0.0, 90.0))


def _error(dataset: xr.Dataset, grid: Grid) -> Figure:
    image = grid.mean(dataset, lambda part: np.where(part["valid"].values, part["error"].values, np.nan))
    known = np.abs(image[np.isfinite(image)])
    most = max(float(np.percentile(known, WIDEST)) if known.size else 0.0, 1e-3)
    return _map(dataset, grid, image, "error of the depth", "measured less true [m]", "RdBu_r", (-most, most))


def _map(dataset: xr.Dataset, grid: Grid, image: np.ndarray, what: str, bar: str, colours: str,
         limits: tuple[float, float]) -> Figure:
    return canvas.picture(grid, image, f"{title(dataset)}: {what}", subtitle=subtitle(dataset, grid),
                          colours=colormaps[colours].with_extremes(bad="#000000"), limits=limits, bar=bar)[0]


PHASES = {"phase": (_phase, "phase"), "coherence": (_coherence, "coherence"), "angle": (_angle, "angle"),
          "depth_error": (_error, "uncertainty")}
