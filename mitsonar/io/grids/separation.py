"""Separation of a vertical datum from the ellipsoid: a constant, or a grid in a file, such as a geoid.

    ellipsoidal height = height above the datum + separation

A grid is any raster that GDAL reads from one file, in degrees on WGS 84 or in a system that it names: GTX, GeoTIFF
(also PROJ's own), BYN, NGS binary, ISG, netCDF. Between its nodes separations are bilinear, as in PROJ. Only the part
about the places asked for is read, and nothing is fetched over a network.
"""
from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mitsonar.device.earth import WGS84, Frame
from mitsonar.device.files import FilePath

from . import raster_files, rasters

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader

FARTHEST = 200.0                   # [m]: no geoid is farther from the ellipsoid than 107 m, and tides add a few
MOST_READ = 5e7                    # nodes about the places of a line


@dataclass(frozen=True, kw_only=True)
class Separation:
    """Height of a vertical datum above the ellipsoid.

    Parameters
    ----------
    constant : float [m]
        Everywhere the same; added to the grid's values if there is a file.
    path : path or None
        File of a grid.
    """

    constant: float = 0.0
    path: FilePath | None = None

    def __post_init__(self):
        if not abs(self.constant) <= FARTHEST:
            raise ValueError(f"separation is {self.constant:g} m; give the height of the datum above the ellipsoid, "
                             f"within +-{FARTHEST:g} m, or the file of a grid.")
        if self.path is not None:
            self._read(None)

    def at(self, x: np.ndarray, y: np.ndarray, frame: Frame | None) -> np.ndarray:
        """Return the separation [m] at places.

        Parameters
        ----------
        x, y : array (N,) [m]
            East and north of the frame's origin.
        frame : mitsonar.device.earth.Frame or None
            Place of the scene on Earth, which a grid needs.

        Returns
        -------
        array (N,) [m]

        Raises
        ------
        ValueError
            If the scene has no place on Earth, or the grid has no value at a place.
        """
        x, y = np.asarray(x, float), np.asarray(y, float)
        if self.path is None:
            return np.full(x.shape, float(self.constant))
        if frame is None or not frame.crs:
            raise ValueError(f"the separation {self.path} is a grid, and the line has no place on Earth; give a track "
                             "or a bathymetry with a coordinate system, or a constant separation [m].")
        latitude, longitude, _ = frame.on_globe(np.stack([x, y], -1))
        return self.constant + self._read((longitude, latitude))

    def _read(self, places: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
        """Return the grid at longitudes and latitudes [degrees]; without any, check that it is one."""
        try:
            with raster_files.opened(self.path or "", what="separation grid") as (raster, source):
                rasters.check(raster, 1)
                if raster.driver == "GTX" and os.path.getsize(self.path or "") < 40 + 4 * raster.width * raster.height:
                    raise ValueError("it is shorter than its header says; it is cut off.")
                if places is None:
                    return np.zeros(0)
                x, y = self._in_grid(raster, source, *places)
                return _bilinear(raster, x, y)
        except ValueError as error:
            raise ValueError(f"cannot read the separation {self.path}: {error}") from None

    @staticmethod
    def _in_grid(raster: DatasetReader, source: CRS | None, longitude: np.ndarray,
                 latitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return columns and rows of places, counted between nodes."""
        if source is None or source.is_geographic:
            middle = 0.5 * (raster.bounds.left + raster.bounds.right)
            x, y = middle + (longitude - middle + 180.0) % 360.0 - 180.0, latitude
        else:
            import pyproj

            x, y = pyproj.Transformer.from_crs(WGS84, source.to_wkt(), always_xy=True).transform(longitude, latitude)
        x, y, back = np.asarray(x), np.asarray(y), ~raster.transform
        return back.a * x + back.b * y + back.c - 0.5, back.d * x + back.e * y + back.f - 0.5


def _bilinear(raster: DatasetReader, column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return the first band at columns and rows (N,), read no farther than they reach."""
    from rasterio.windows import Window

    inside = [(at >= -1e-6) & (at <= most - 1 + 1e-6) for at, most in ((column, raster.width), (row, raster.height))]
    if not np.all(inside):
        raise ValueError("the grid does not reach all places of the line; give one that covers it.")
    first = [int(np.floor(max(values.min(), 0))) for values in (column, row)]
    size = [min(int(np.floor(values.max())) + 2, most) - start
            for values, most, start in zip((column, row), (raster.width, raster.height), first)]
    if size[0] * size[1] > MOST_READ:
        raise ValueError(f"the line spans {size[0]} x {size[1]} nodes of the grid; give a coarser one.")
    values = raster.read(1, window=Window(*first, *size), masked=True).astype(float).filled(np.nan)
    values = values * raster.scales[0] + raster.offsets[0]
    from scipy.ndimage import map_coordinates

    at = [np.clip(row - first[1], 0, size[1] - 1), np.clip(column - first[0], 0, size[0] - 1)]
    missing = ~np.isfinite(values) | (np.abs(values) > FARTHEST)
    found = map_coordinates(np.where(missing, 0.0, values), at, order=1)
    if missing.any() and (map_coordinates(missing.astype(float), at, order=1) > 1e-9).any():
        raise ValueError(f"the grid has no value, or none within +-{FARTHEST:g} m, at places of the line.")
    return found
