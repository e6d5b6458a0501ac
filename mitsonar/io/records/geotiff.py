"""Write maps and focused images as GeoTIFF files, for GIS.

Missing values are NaN; in integer rasters they are the largest value of the type, and the file's nodata tag names it.
The coordinate system is that of the map or the scene; without one the file holds plain metres.

`write` makes one band of square pixels, which stand for areas, the first row in the north. Tags state how the map was
made, and what the numbers of labels mean.

`write_focused` makes float32 bands, because the bands of a file have one type and GIS do not draw complex ones: for
every bank ``level``, ``image.real`` and ``image.imag``, then the other variables over the grid (phase, coherence,
height, shadow, labels and so on). No value is resampled: a grid that is turned against north
has a turned transform, which GDAL, QGIS and ArcGIS support. The first row is the farthest ahead,
and columns go to starboard.
"""
from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mitsonar.device.earth import metric_system, origin, system
from mitsonar.device.files import FilePath, replacing
from mitsonar.imaging.focused import even_grid
from mitsonar.synthetic_aperture.record import check_image

if TYPE_CHECKING:
    from rasterio.io import DatasetWriter
    from rasterio.transform import Affine
__all__ = ["opened", "write"]
TAGS = ("cell", "place", "blend", "gain", "fill", "nadir_deg", "rule")      # of a mosaic or a grid
UNITS = {"cell": " m", "fill": " m", "nadir_deg": " degrees"}
TILE = 256


def write(chart: xr.Dataset, path: FilePath) -> None:
    """Write a map as a GeoTIFF, whole or not at all.

    Parameters
    ----------
    chart : xarray.Dataset
        One variable over (y, x) in even steps, with y falling. Has the attributes ``cell`` [m] and ``crs``.
    path : str or path

    Raises
    ------
    ValueError
        If the dataset is no such map, or its coordinate system is unknown.
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
    about = {name: (value if isinstance(value, str) else f"{value:.6g}") + UNITS.get(name, "") for name in TAGS
             if (value := chart.attrs.get(name)) is not None}
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
    """Open a GeoTIFF to write to; the file appears complete at the end of the block, or not at all.

    Parameters
    ----------
    path : str or path
    shape : (int, int)
        Numbers of rows and columns.
    bands : int
        Number of bands.
    kind : numpy.dtype
        Type of all bands.
    crs : str or None
        Coordinate system as rasterio accepts it.
    transform : Affine
        Maps columns and rows of the corners of elements to eastings and northings [m].
    nodata : float
        Value that stands for missing ones.

    Raises
    ------
    ValueError
        If the coordinate system is unknown, or GDAL refuses to write.
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


FOCUSED_TAGS = ("sonar", "frequency", "seed", "window", "range_window", "file")
PLACE = ("x", "y")
MOST_LABEL = 1 << 24               # the last whole number that float32 separates from its neighbours


def write_focused(image: xr.Dataset, path: FilePath) -> None:
    """Write a focused image as a GeoTIFF, whole or not at all.

    Parameters
    ----------
    image : xarray.Dataset
        Image as `synthetic_aperture.record` describes it. Its ``x`` and ``y`` are an even grid of any heading. The
        attributes ``crs`` and ``local_origin`` [m] place it on Earth.
    path : str or path

    Raises
    ------
    ValueError
        If the dataset is no such image, its grid is not even on the map, or its coordinate system is unknown.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.
    """
    check_image(image)
    crs = system(image.attrs)
    if crs is not None:
        metric_system(crs)
    bands = list(_bands(image))
    shape = image.sizes["along_track"], image.sizes["across_track"]
    about = {name: str(image.attrs[name]) for name in FOCUSED_TAGS if image.attrs.get(name) is not None}
    if image.attrs.get("labels"):
        about["labels"] = json.dumps(image.attrs["labels"], ensure_ascii=False)
    with opened(path, shape, len(bands), np.dtype(np.float32), crs, _transform(image), np.nan) as raster:
        raster.update_tags(AREA_OR_POINT="Area", SOFTWARE="mitsonar", **about)
        for number, (name, values, unit) in enumerate(bands, 1):
            raster.write(np.ascontiguousarray(values[::-1], np.float32), number)
            raster.set_band_description(number, name)
            raster.set_band_unit(number, unit)


def _bands(image: xr.Dataset) -> Iterator[tuple[str, np.ndarray, str]]:
    """Yield the name, values (along_track, across_track) and unit of every band."""
    order = ("bank", "along_track", "across_track")
    for bank in range(image.sizes["bank"]):
        of_banks = [(name, variable) for name, variable in image.data_vars.items() if variable.dims == order]
        for name, variable in sorted(of_banks, key=lambda item: item[1].dtype.kind == "c"):  # GIS show the first
            values, unit = variable.values[bank], str(variable.attrs.get("units", "1"))
            parts = {f"{name}.real": values.real, f"{name}.imag": values.imag} if values.dtype.kind == "c" else {
                name: values}
            yield from ((f"bank{bank}.{part}", numbers, unit) for part, numbers in sorted(parts.items(), reverse=True))
    for name, variable in image.data_vars.items():
        if variable.dims != order[1:] or name in PLACE:
            continue
        if variable.dtype.kind not in "biuf":
            raise ValueError(f"{name} is {variable.dtype}, and a GeoTIFF holds numbers; drop it, or write .nc.")
        if variable.dtype.kind in "iu" and variable.size and np.abs(variable.values.astype(float)).max() > MOST_LABEL:
            raise ValueError(f"{name} has numbers above {MOST_LABEL}, which bands of float32 do not tell apart; drop "
                             "it, or write .nc.")
        yield str(name), variable.values, str(variable.attrs.get("units", "1"))


def _transform(image: xr.Dataset) -> Affine:
    """Return the transform from corners of elements to eastings and northings; rows run against the track."""
    from rasterio.transform import Affine

    rows, columns = image.sizes["along_track"], image.sizes["across_track"]
    if min(rows, columns) < 2:
        raise ValueError(f"a GeoTIFF places a grid of at least 2 x 2 points, and this image has {rows} x {columns}; "
                         "write .exr, .nc or .h5.")
    grid = even_grid(image)
    if grid is None:
        raise ValueError("the points of this image are no even grid on the map, as those of a slant grid or about a "
                         "circle may not be; focus on a ground grid, or write .exr, .nc or .h5.")
    corner = np.array(origin(image.attrs)) + grid.first + (rows - 0.5) * grid.ahead - 0.5 * grid.abeam
    return Affine(grid.abeam[0], -grid.ahead[0], corner[0], grid.abeam[1], -grid.ahead[1], corner[1])
