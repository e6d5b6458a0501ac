"""What stands above a picture."""
from collections.abc import Mapping

import numpy as np
import xarray as xr

from ..units import khz_from_hertz
from .grid import Grid

__all__ = ["in_metres", "subtitle", "title"]


def title(dataset: xr.Dataset) -> str:
    """Name the sonar and its frequency."""
    frequency = dataset.attrs.get("frequency")
    words = f" {khz_from_hertz(float(frequency)):g} kHz" if frequency else ""
    return f"{dataset.attrs.get('sonar', 'sonar')}{words}"


def subtitle(dataset: xr.Dataset, grid: Grid, more_db: Mapping[str, float] | None = None) -> str:
    """Say how many pings and how far, how long the bins are, the altitude, and gains [dB] of parts of it by name."""
    pings = dataset.sizes["ping"]
    parts = [f"{pings} ping{'s' * (pings != 1)}" + f" over {in_metres(grid.along[-1] - grid.along[0])}" * grid.moving,
             in_metres(grid.across[-1]) + (" to each side" if grid.across[0] < 0 else " range")]
    if "bin_width" in dataset.attrs:
        parts.append(f"bins of {in_metres(float(dataset.attrs['bin_width']))}")
    if "altitude" in dataset.coords and np.isfinite(dataset["altitude"].values).any():
        parts.append(f"altitude {in_metres(float(np.nanmean(dataset['altitude'].values)))}")
    parts += [f"{name} + {gain:g} dB" for name, gain in (more_db or {}).items()]
    return "   ·   ".join(parts)


def in_metres(length: float) -> str:
    """Give a length to three digits, without a power of ten."""
    return f"{100 * length:.3g} cm" if length < 1 else f"{length:.3g} m" if length < 999.5 else f"{length:.0f} m"
