"""Maps as GeoTIFF files: what `mitsonar.imaging.mosaic` makes, for GIS.

One band, square pixels that stand for areas, the first row in the north. Nothing is NaN, or of whole numbers the
largest, and named as such (nodata). The coordinate system is the map's; without one the file holds plain metres. Tags
say how the map was made, and what the numbers of labels mean.
"""
from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from .files import FilePath, replacing

if TYPE_CHECKING:
    from rasterio.io import DatasetWriter
    from rasterio.transform import Affine

__all__ = ["opened", "write"]

TAGS = ("cell", "place", "blend", "gain", "fill", "nadir_deg", "rule")      # of a mosaic, or a grid
UNITS = {"cell": " m", "fill": " m", "nadir_deg": " degrees"}
TILE = 256


def write(chart: xr.Dataset, path: FilePath) -> None:
    """Write a map as a GeoTIFF, whole or not at all.

    Parameters
    ----------
    chart : xarray.Dataset
        One variable over (y, x), in even steps; y falls. With the attributes ``cell`` [m] and ``crs``.
    path : str or path

    Raises
    ------
    ValueError
        If it is no such map, or its coordinate system is unknown.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.
    """
    from rasterio.transform import Affine

    names = [str(name) for name, variable in chart.data_vars.items() if variable.dims == ("y", "x")]
    if len(names) != 1:
        raise ValueError(f"a GeoTIFF takes one variable over (y, x); there are {', '.join(names) or 'none'}.")
    band, cell = chart[names[0]], float(chart.attrs["cell"])
    west, north = float(chart["x"].values[0]) - 0.5 * cell, float(chart["y"].values[0]) + 0.5 * cell
    values = np.ascontiguousarray(band.values)
    nodata = float("nan") if values.dtype.kind == "f" else band.attrs["nodata"]
    about = {name: _words(chart.attrs[name]) + UNITS.get(name, "") for name in TAGS
             if chart.attrs.get(name) is not None}
    if chart.attrs.get("names"):
        about["names"] = json.dumps(chart.attrs["names"], ensure_ascii=False)
    with opened(path, values.shape, 1, values.dtype, chart.attrs.get("crs"),
                Affine(cell, 0.0, west, 0.0, -cell, north), nodata) as raster:
        raster.write(values, 1)
        raster.update_tags(AREA_OR_POINT="Area", SOFTWARE="mitsonar", **about)
        raster.set_band_description(1, names[0])
        raster.set_band_unit(1, str(band.attrs.get("units", "1")))


@contextlib.contextmanager
def opened(path: FilePath, shape: tuple[int, ...], bands: int, kind: np.dtype, crs: str | None, transform: Affine,
           nodata: float) -> Iterator[DatasetWriter]:
    """Open a GeoTIFF to write to; it is there whole once the block ends, or not at all.

    Parameters
    ----------
    path : str or path
    shape : (int, int)
        Rows and columns.
    bands : int
    kind : numpy.dtype
        Of all bands.
    crs : str or None
        As rasterio takes it.
    transform : Affine
        Columns and rows of the corners of elements to eastings and northings [m].
    nodata : float

    Raises
    ------
    ValueError
        If the coordinate system is unknown, or GDAL refuses.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.
    """
    import rasterio
    from rasterio.crs import CRS
    from rasterio.errors import NotGeoreferencedWarning, RasterioError

    with replacing(path) as temporary:
        try:
            system = None if crs is None else CRS.from_user_input(crs)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                with rasterio.open(temporary, "w", driver="GTiff", width=shape[1], height=shape[0], count=bands,
                                   dtype=kind, crs=system, nodata=nodata, compress="deflate",
                                   predictor=3 if kind.kind == "f" else 2, tiled=True, blockxsize=TILE,
                                   blockysize=TILE, bigtiff="if_safer", transform=transform,
                                   **({"interleave": "band"} if bands > 1 else {})) as raster:
                    yield raster
        except RasterioError as error:
            raise ValueError(f"cannot write {path}: {' '.join(str(error).split())}") from None


def _words(value):
    return value if isinstance(value, str) else f"{value:.6g}"
