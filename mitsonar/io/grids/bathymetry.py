"""Surveyed bathymetry from grids (GeoTIFF, BAG, netCDF, ESRI ASCII, other formats of GDAL, ``.npy``) and soundings.

`read` returns heights as they are meshed: z up, rows running north, columns east, metres about a local origin, NaN
without data. Grids in degrees, in feet or rotated against north are warped to a grid in metres; nodes are interpolated
from measured nodes only, so that fill values never spread into the seabed.

Holes of a survey are filled by the smoothest surface without overshoot:

    laplacian(height) = 0 in the hole, heights of the survey on its rim

Its highest and lowest points lie on the rim. The equation uses five nodes with the grid's steps; it is solved by
conjugate gradients, which start from the solution on a grid with half as many rows and columns.
"""
from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt

from mitsonar.device.files import FilePath
from mitsonar.seabed.roughness import RoughnessSpectrum

from . import enc, raster_files, rasters, survey_relief

if TYPE_CHECKING:
    from rasterio.windows import Window

_MOST_NODES = 5_000_000       # unknowns: about 1.5 GB
_FEW = 1000                   # unknowns that need no first guess
_TOLERANCE = 3e-4             # relative residual; what it leaves beyond the heights of the rim is clipped
_DEEPEST = 12000.0            # [m], beyond any ocean: larger numbers are undeclared fill values

_log = logging.getLogger(__name__)


def fill_holes(heights: np.ndarray, steps: tuple[float, float], widest: float | None = None) -> np.ndarray:
    """Fill the holes that the survey surrounds; holes at the grid's edge stay open.

    Parameters
    ----------
    heights : float32 array (Y, X) [m]
        Heights; NaN is a hole. Not changed.
    steps : tuple of 2 floats [m]
        Distance between columns and between rows.
    widest : float [m], optional
        Width of the widest hole to fill: the diameter of the largest circle within it.

    Returns
    -------
    float32 array (Y, X) [m]

    Raises
    ------
    ValueError
        If the holes to be filled have too many nodes for the memory.
    """
    from scipy import ndimage

    holes, count = cast("tuple[np.ndarray, int]", ndimage.label(np.isnan(heights)))
    edge = np.concatenate((holes[0], holes[-1], holes[:, 0], holes[:, -1]))
    surrounded = np.ones(count + 1, bool)
    surrounded[0] = surrounded[edge] = False
    if widest is not None and surrounded.any():
        radius = ndimage.maximum(ndimage.distance_transform_edt(holes > 0, sampling=steps[::-1]), holes,
                               np.arange(count + 1))
        surrounded &= 2 * radius <= widest
    unknown = surrounded[holes]
    number = np.count_nonzero(unknown)
    if number == 0:
        return heights
    if number > _MOST_NODES:
        raise ValueError(f"the holes to be filled have {number} nodes, more than {_MOST_NODES:.0e}; fill smaller ones "
                         "by holes_max, or use a coarser resolution.")
    filled = heights.copy()
    filled[unknown] = _harmonic(heights, unknown, steps)
    # Keep each hole within the heights of its rim.
    rim = ndimage.grey_dilation(np.where(unknown, holes, 0), footprint=ndimage.generate_binary_structure(2, 1))
    rim = np.where(unknown | np.isnan(heights), 0, rim)
    index = np.arange(count + 1)
    lowest, highest = (extreme(filled, rim, index)[holes[unknown]] for extreme in (ndimage.minimum, ndimage.maximum))
    filled[unknown] = np.clip(filled[unknown], lowest, highest)
    return filled


def _harmonic(heights, unknown, steps):
    """Return the heights of the unknown nodes, in the order of the array, by conjugate gradients."""
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import cg

    nodes = np.argwhere(unknown)
    level = float(np.nanmean(heights))                  # heights near 0 lose fewer digits in sums
    known = np.where(unknown | np.isnan(heights), 0.0, heights - level)
    index = np.full(heights.shape, -1, np.int32)
    index[unknown] = np.arange(len(nodes))
    right_side, entries = np.zeros(len(nodes)), []
    across, along = 1 / steps[0] ** 2, 1 / steps[1] ** 2
    for weight, down, right in (along, 1, 0), (along, -1, 0), (across, 0, 1), (across, 0, -1):
        beside = nodes[:, 0] + down, nodes[:, 1] + right                # a hole never touches the edge
        neighbour = index[beside]
        inside = np.flatnonzero(neighbour >= 0)
        right_side += weight * np.where(neighbour < 0, known[beside], 0)
        entries.append((np.full(inside.size, weight), inside, neighbour[inside]))
    weight, row, column = (np.concatenate(part) for part in zip(*entries))
    beside = coo_array((weight, (row, column)), shape=(len(nodes), len(nodes))).tocsr()
    matrix = (diags_array(np.full(len(nodes), 2 * across + 2 * along)) - beside).tocsr()
    start = _coarse(heights, unknown, steps, nodes) - level if len(nodes) > _FEW else None
    solution, _ = cg(matrix, right_side, x0=start, rtol=_TOLERANCE, maxiter=5000)
    return solution + level


def _coarse(heights, unknown, steps, nodes):
    """Return a first guess at the nodes, interpolated from the solution on a grid of half as many rows and columns."""
    from scipy.ndimage import map_coordinates

    rows, columns = (length + length % 2 for length in heights.shape)
    padded = [(0, rows - heights.shape[0]), (0, columns - heights.shape[1])]
    blocks = np.pad(np.where(unknown, np.nan, heights), padded, mode="edge").reshape(rows // 2, 2, columns // 2, 2)
    measured = np.isfinite(blocks)
    number = measured.sum((1, 3))
    halved = np.where(measured, blocks, 0).sum((1, 3)) / np.where(number, number, np.nan)
    hole = np.pad(unknown, padded).reshape(blocks.shape).any((1, 3)) & (number == 0)
    hole[[0, -1]] = hole[:, [0, -1]] = False
    halved[hole] = _harmonic(halved, hole, tuple(2 * step for step in steps))
    halved[np.isnan(halved)] = np.nanmean(halved)       # outside the survey
    return map_coordinates(halved, (nodes.T - 0.5) / 2, order=1, mode="nearest")


@dataclass(frozen=True, kw_only=True, eq=False)
class Bathymetry:
    """Heights of a seabed on a regular grid.

    Parameters
    ----------
    x, y : float64 array (X,), (Y,) [m]
        Local coordinates of columns (east) and rows (north), increasing by a constant step.
    heights : float32 array (Y, X) [m]
        z up from the survey's datum; NaN without a depth.
    local_origin : tuple of 2 floats [m]
        Easting and northing of x = 0, y = 0.
    crs : str
        Coordinate system of the origin, as an EPSG code or WKT; empty if the file has none.
    vertical : str
        Sign of the file's numbers: "elevation" (positive up) or "depth" (positive down).
    roughness : RoughnessSpectrum or None
        Spectrum of the relief that was added below the survey's resolution.
    """

    x: np.ndarray
    y: np.ndarray
    heights: np.ndarray
    local_origin: tuple[float, float]
    crs: str = ""
    vertical: str = "elevation"
    roughness: RoughnessSpectrum | None = None

    @property
    def valid(self) -> np.ndarray:
        """Return True where a node has a depth: bool array (Y, X)."""
        return np.isfinite(self.heights)

    @property
    def spacing(self) -> tuple[float, float]:
        """Return the distance between columns and between rows [m]."""
        across, along = (float((axis[-1] - axis[0]) / (axis.size - 1)) for axis in (self.x, self.y))
        return across, along

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return west, south, east and north [m] of the nodes in the coordinate system ``crs``."""
        east, north = self.local_origin
        return (float(self.x[0] + east), float(self.y[0] + north), float(self.x[-1] + east),
                float(self.y[-1] + north))

    def height_at(self, x: npt.ArrayLike, y: npt.ArrayLike) -> np.ndarray:
        """Return the height [m] at local points by bilinear interpolation; NaN beside holes and beyond the grid."""
        from scipy.interpolate import RegularGridInterpolator

        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        surface = RegularGridInterpolator((self.y, self.x), self.heights, bounds_error=False, fill_value=np.nan)
        return surface(np.stack((y, x), axis=-1)).reshape(x.shape)


@dataclass(frozen=True, kw_only=True)
class SurveyRelief:
    """Relief to be added below the resolution of a survey.

    Parameters
    ----------
    seed : int
        Seed of the random surface.
    w2 : float [m^(4 - gamma)], optional
        Spectral strength; by default measured on the survey. It needs ``gamma``.
    gamma : float, optional
        Spectral exponent; by default measured on the survey.

    Raises
    ------
    ValueError
        If the strength is given alone, or `RoughnessSpectrum` does not allow a number.
    """

    seed: int = 0
    w2: float | None = None
    gamma: float | None = None

    def __post_init__(self):
        if self.w2 is not None and self.gamma is None:
            raise ValueError("relief_w2 is given without relief_gamma, on which its unit depends; give both.")
        if self.gamma is not None:
            RoughnessSpectrum(w2=1.0 if self.w2 is None else self.w2, gamma=self.gamma)

    @property
    def spectrum(self) -> RoughnessSpectrum | None:
        """Return the spectrum if both numbers are given, else None."""
        if self.w2 is None or self.gamma is None:
            return None
        return RoughnessSpectrum(w2=self.w2, gamma=self.gamma, outer_scale=1e6)


def read(path: FilePath, *, crop: Sequence[float] | None = None, centre: Sequence[float] | None = None,
         size: Sequence[float] | None = None, frame: str = "projected", resolution: float | None = None,
         vertical: str = "auto", band: int = 1, variable: str | None = None, spacing: float | None = None,
         nodata: float | None = None, crs: str | None = None, local_origin: Sequence[float] | None = None,
         holes: str = "cut", holes_max: float | None = None, relief: SurveyRelief | None = None) -> Bathymetry:
    """Read a bathymetry grid.

    Parameters
    ----------
    path : path
        A raster GDAL can open, an ``.npy`` array (Y, X) whose rows run north, text of lines of x, y and z as
        `soundings.read` takes it, or an electronic chart (S-57) as `enc.read` takes it. A BAG of variable resolution is
        read at its finest resolution, to which the driver interpolates; the driver leaves out the northernmost row of
        nodes.
    crop : 4 floats, optional
        West, south, east and north of the part to read, nodes on its edge included.
    centre, size : 2 floats each, optional
        The same part by its middle (by default the file's) and its width and height [m].
    frame : str
        Coordinates of ``crop`` and ``centre``: "projected" for the file's own, metres or degrees, "local" for
        metres from the middle of the file's extent, rounded to metres.
    resolution : float [m], optional
        Node distance; a coarser one averages, a finer one interpolates. Default: the file's own; for scattered
        soundings their mean distance, which is logged.
    vertical : str
        "elevation" (positive up), "depth" (positive down), or "auto": depth if most numbers are positive or the
        file is S-102 or an electronic chart. The result is recorded and logged.
    band : int
        Number of the band in the file, from 1.
    variable : str, optional
        Grid of a netCDF file; needed if the names of several grids do not identify the one with heights.
    spacing : float [m], optional
        Node distance of a file without georeference, such as ``.npy``.
    nodata : float, optional
        Fill value, if the file does not declare it.
    crs : str, optional
        Coordinate system, if the file does not name it, such as "EPSG:4326".
    local_origin : 2 floats [m], optional
        Easting and northing of the local origin; by default the middle of the part that is read, rounded to metres.
        Several files in one scene need a common origin.
    holes : str
        "cut", or "filled" where soundings surround them, see `fill_holes`.
    holes_max : float [m], optional
        Width of the widest hole to fill.
    relief : SurveyRelief, optional
        Interpolate the survey to the finer ``resolution`` by splines and add relief that continues its spectrum, see
        `survey_relief`. The spectrum is measured on the whole file, so that all parts have the same.

    Returns
    -------
    Bathymetry

    Raises
    ------
    ValueError
        If the file does not exist or is no raster, an argument does not fit it, the crop is empty, or its numbers
        cannot be depths.
    """
    if vertical not in ("auto", "elevation", "depth"):
        raise ValueError(f'{path}: vertical is "{vertical}"; it must be "auto", "elevation" or "depth".')
    if holes not in ("cut", "filled"):
        raise ValueError(f'{path}: holes is "{holes}"; it must be "cut" or "filled".')
    if holes_max is not None and holes == "cut":
        raise ValueError(f'{path}: holes_max is {holes_max:g} m, but holes are cut; write holes "filled" too.')
    if resolution is not None and not resolution > 0:
        raise ValueError(f"{path}: resolution is {resolution} m; it must be above 0.")
    try:
        part = rasters.RasterPart(crop=crop, centre=centre, size=size, frame=frame)
        with raster_files.opened(path, spacing=spacing, variable=variable, crs=crs, nodata=nodata,
                                 resolution=None if relief else resolution) as (raster, source):
            rasters.check(raster, band)
            native = raster.crs or source
            with rasters.in_metres(raster, native, None if relief else resolution, nodata,
                                   smooth=relief is not None) as grid:
                def depths(window: Window) -> np.ndarray:
                    return _values(grid, raster, band, window, nodata)
                if relief:
                    finer = survey_relief.FinerGrid.over(grid, resolution)
                    finer_x, finer_y, _ = rasters.window(finer, part, source)
                    roughness = relief.spectrum or _measured(grid, depths, relief.gamma)
                    x, y, window = rasters.window_about(grid, finer_x, finer_y, survey_relief.MARGIN)
                else:
                    roughness = None
                    x, y, window = rasters.window(grid, part, source)
                values = depths(window)
                if vertical == "auto" and (raster.driver == "S102" or enc.recognised(path)):
                    vertical = "depth"
                crs = rasters.name_of(native if grid is raster else grid.crs)
        heights, vertical = _z_up(values, vertical)
        if holes == "filled":
            steps = tuple(abs(axis[-1] - axis[0]) / (axis.size - 1) for axis in (x, y))
            heights = fill_holes(heights, steps, holes_max)
        if relief and roughness:
            heights = survey_relief.refine(x, y, heights, finer_x, finer_y, roughness, relief.seed)
            x, y = finer_x, finer_y
            if np.isnan(heights).all():
                raise ValueError("the requested part has no depths, only holes; choose another part.")
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    _log.info("%s: taken as %s, heights from %g to %g m", path, vertical, np.nanmin(heights), np.nanmax(heights))
    if roughness:
        _log.info("%s: relief of w2 = %.3g m^(4 - gamma), gamma = %.3g", path, roughness.w2, roughness.gamma)
    if local_origin is None:
        local_origin = round((x[0] + x[-1]) / 2), round((y[0] + y[-1]) / 2)
    if y[0] > y[-1]:
        y, heights = y[::-1], heights[::-1]
    return Bathymetry(x=x - local_origin[0], y=y - local_origin[1], heights=np.ascontiguousarray(heights, np.float32),
                      local_origin=(float(local_origin[0]), float(local_origin[1])), crs=crs, vertical=vertical,
                      roughness=roughness)


def _values(grid, raster, band, window, nodata):
    masked = grid.read(band, window=window, masked=True)
    values = masked.astype(np.result_type(masked.dtype, np.float32)).filled(np.nan)
    if nodata is not None:
        values[values == values.dtype.type(nodata)] = np.nan
    values[~np.isfinite(values)] = np.nan
    scale, offset = raster.scales[band - 1], raster.offsets[band - 1]
    return values if (scale, offset) == (1, 0) else values * scale + offset


def _measured(grid, depths, gamma):
    def read_window(row: int, column: int, size: int) -> np.ndarray:
        return depths(rasters.window_at(int(column), int(row), size, size))
    return survey_relief.measure(read_window, grid.shape, grid.res, gamma)


def _z_up(values, vertical):
    """Return the heights, z up, and the sign assumed for the numbers, "depth" or "elevation"."""
    if np.isnan(values).all():
        raise ValueError("the requested part has no depths, only holes; choose another part.")
    low, high = np.nanmin(values), np.nanmax(values)
    if max(-low, high) > _DEEPEST:
        fill = low if -low > high else high
        raise ValueError(f"numbers reach from {low:g} to {high:g} m; if {fill:g} means no data, set nodata to it.")
    if vertical == "auto":
        vertical = "depth" if np.nanmedian(values) > 0 else "elevation"
    return (-values if vertical == "depth" else values), vertical
