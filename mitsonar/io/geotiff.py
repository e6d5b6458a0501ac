"""Maps as GeoTIFF files: what `mitsonar.imaging.mosaic` makes, for GIS.

One band, square pixels that stand for areas, the first row in the north. Nothing is NaN, or of whole numbers the
largest, and named as such (nodata). The coordinate system is the map's; without one the file holds plain metres. Tags
say how the map was made, and what the numbers of labels mean.
"""
import json
import warnings

import numpy as np
import xarray as xr

from .files import FilePath, replacing

__all__ = ["write"]

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
    import rasterio
    from rasterio.crs import CRS
    from rasterio.errors import NotGeoreferencedWarning, RasterioError
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
    with replacing(path) as temporary:
        try:
            crs = None if chart.attrs.get("crs") is None else CRS.from_user_input(chart.attrs["crs"])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", NotGeoreferencedWarning)
                with rasterio.open(temporary, "w", driver="GTiff", width=values.shape[1], height=values.shape[0],
                                   count=1, dtype=values.dtype, crs=crs, nodata=nodata, compress="deflate",
                                   predictor=3 if values.dtype.kind == "f" else 2, tiled=True, blockxsize=TILE,
                                   blockysize=TILE, bigtiff="if_safer",
                                   transform=Affine(cell, 0.0, west, 0.0, -cell, north)) as raster:
                    raster.write(values, 1)
                    raster.update_tags(AREA_OR_POINT="Area", SOFTWARE="mitsonar", **about)
                    raster.set_band_description(1, names[0])
                    raster.set_band_unit(1, str(band.attrs.get("units", "1")))
        except RasterioError as error:
            raise ValueError(f"cannot write {path}: {' '.join(str(error).split())}") from None


def _words(value):
    return value if isinstance(value, str) else f"{value:.6g}"
