"""Survey on a finer grid, with relief in place of the waves that it could not resolve.

The survey's heights are interpolated by cubic splines. A random surface adds the waves that splines leave out: its
spectrum continues the survey's own spectrum at its shortest waves by the power law there (`mitsonar.scattering.Fractal`
with ``surveyed``). Longer waves stay as surveyed.
"""
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mitsonar.seabed.fractal import Fractal
from mitsonar.seabed.measured_roughness import SMALLEST_PATCH, fit_power_law
from mitsonar.seabed.roughness import RoughnessSpectrum

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader
    from rasterio.transform import Affine
    from rasterio.vrt import WarpedVRT


MARGIN = 12                        # nodes around a part; those farther away do not change its splines
_PATCHES, _TRIED = 64, 24          # patches that suffice; places tried along each side of the file
_FEW = 4                           # large patches that suffice, so that smaller ones need not be tried


class FinerGrid(NamedTuple):
    """Nodes of a finer grid, in the attributes of a raster."""

    transform: "Affine"
    width: int
    height: int
    crs: "CRS | None"

    @classmethod
    def over(cls, grid: "DatasetReader | WarpedVRT", resolution: float | None) -> "FinerGrid":
        """Make the grid whose nodes a raster would have after resampling to ``resolution`` [m]."""
        from rasterio.transform import from_origin

        step = min(grid.res)
        if resolution is None or not resolution < step:
            asked = "none is given" if resolution is None else f"it is {resolution:g} m"
            raise ValueError(f"relief needs a resolution finer than the survey's {step:g} m; {asked}.")
        west, south, east, north = grid.bounds
        low, high = sorted((south, north))
        return cls(from_origin(west, high, resolution, resolution), round((east - west) / resolution),
                   round((high - low) / resolution), grid.crs)


def measure(read_window: Callable[[int, int, int], np.ndarray], shape: tuple[int, int], steps: tuple[float, float],
            gamma: float | None = None) -> RoughnessSpectrum:
    """Return the roughness of a survey from patches without holes all over the file, whatever part is used."""
    # steps [m]
    for size in (2 * SMALLEST_PATCH, SMALLEST_PATCH):
        patches = _patches(read_window, shape, size)
        if len(patches) >= _FEW or (patches and size == SMALLEST_PATCH):
            break
    else:
        raise ValueError(f"relief continues the survey's spectrum, but no {SMALLEST_PATCH} x {SMALLEST_PATCH} nodes of "
                         "it are without holes; give relief_w2 and relief_gamma.")
    return fit_power_law(patches, steps, gamma)


def _patches(read_window, shape, size):
    starts = [np.unique(np.linspace(0, length - size, min(_TRIED, length // size)).astype(int))
              if length >= size else [] for length in shape]
    places = [(row, column) for row in starts[0] for column in starts[1]]
    patches = []
    for index in np.random.default_rng(0).permutation(len(places)):         # spread over the file
        heights = read_window(*places[index], size)
        if np.isfinite(heights).all():
            patches.append(heights)
        if len(patches) == _PATCHES:
            break
    return patches


def refine(x: np.ndarray, y: np.ndarray, heights: np.ndarray, finer_x: np.ndarray, finer_y: np.ndarray,
           spectrum: RoughnessSpectrum, seed: int) -> np.ndarray:
    """Interpolate a survey to a finer grid and add the relief below its resolution."""
    # x (X,), y (Y,), heights (Y, X), finer_x (P,), finer_y (Q,) [m] -> (Q, P) [m]
    from scipy import ndimage

    holes = np.isnan(heights)
    if holes.any():                # NaN would spread through the splines
        nearest = ndimage.distance_transform_edt(holes, return_distances=False, return_indices=True)
        heights = heights[tuple(np.asarray(nearest))]
    steps = [(axis[-1] - axis[0]) / (axis.size - 1) for axis in (y, x)]
    finer_steps = [(axis[-1] - axis[0]) / (axis.size - 1) for axis in (finer_y, finer_x)]
    first = finer_y[0] - y[0], finer_x[0] - x[0]
    placed = {"matrix": np.divide(finer_steps, steps), "offset": np.divide(first, steps),
              "output_shape": (finer_y.size, finer_x.size)}
    level = float(heights.mean())
    coefficients = ndimage.spline_filter(np.asarray(heights, np.float64) - level, order=3, mode="mirror")
    fine = ndimage.affine_transform(coefficients, **placed, order=3, mode="mirror", prefilter=False) + level
    relief = Fractal(spectrum=spectrum, seed=seed, surveyed=(abs(steps[1]), abs(steps[0])))
    upward = finer_y[::-1] if finer_y[0] > finer_y[-1] else finer_y
    added = relief.on_grid(finer_x, upward)
    fine += added[::-1] if upward is not finer_y else added
    share = ndimage.affine_transform((~holes).astype(np.float32), **placed, order=1, mode="nearest")
    fine[share < 0.999] = np.nan
    return fine.astype(np.float32)
