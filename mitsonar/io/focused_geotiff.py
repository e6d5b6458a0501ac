"""Focused images as GeoTIFF files, for GIS.

A band each, float32: of every bank ``level``, ``image.real`` and ``image.imag``, then what else the image has over its
grid: phase, coherence, height, shadow, labels and so on. (Bands of one file are of one type, and GIS do not draw
complex ones.) A grid that is turned against north stays as it is: the place is a turned transform, which GDAL, QGIS and
ArcGIS know; no value is resampled. The first row is the farthest ahead, columns go to starboard. The coordinate system
is the scene's; without one the file holds plain metres of the scene.
"""
from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from ..imaging.focused import even_grid
from ..imaging.georeference import named_system, system
from ..synthetic_aperture.record import check_image
from . import geotiff
from .files import FilePath

if TYPE_CHECKING:
    from rasterio.transform import Affine

__all__ = ["write"]

TAGS = ("sonar", "frequency", "seed", "window", "range_window", "file")
PLACE = ("x", "y")
MOST_LABEL = 1 << 24               # the last whole number that float32 tells from its neighbours


def write(image: xr.Dataset, path: FilePath) -> None:
    """Write a focused image as a GeoTIFF, whole or not at all.

    Parameters
    ----------
    image : xarray.Dataset
        As `synthetic_aperture.record` says; its ``x`` and ``y`` are an even grid, of any heading. The attributes
        ``crs`` and ``local_origin`` [m] place it on Earth.
    path : str or path

    Raises
    ------
    ValueError
        If it is no such image, its grid is not even on the map, or its coordinate system is unknown.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.
    """
    check_image(image)
    found = system(image.attrs)
    crs = None if found is None else named_system(found)
    bands = list(_bands(image))
    shape = image.sizes["along_track"], image.sizes["across_track"]
    about = {name: str(image.attrs[name]) for name in TAGS if image.attrs.get(name) is not None}
    if image.attrs.get("labels"):
        about["labels"] = json.dumps(image.attrs["labels"], ensure_ascii=False)
    with geotiff.opened(path, shape, len(bands), np.dtype(np.float32), crs, _transform(image), np.nan) as raster:
        raster.update_tags(AREA_OR_POINT="Area", SOFTWARE="mitsonar", **about)
        for number, (name, values, unit) in enumerate(bands, 1):
            raster.write(np.ascontiguousarray(values[::-1], np.float32), number)
            raster.set_band_description(number, name)
            raster.set_band_unit(number, unit)


def _bands(image: xr.Dataset) -> Iterator[tuple[str, np.ndarray, str]]:
    """Name, values (along_track, across_track) and unit of every band."""
    order = ("bank", "along_track", "across_track")
    for bank in range(image.sizes["bank"]):
        of_banks = [(name, variable) for name, variable in image.data_vars.items() if variable.dims == order]
        for name, variable in sorted(of_banks, key=lambda one: one[1].dtype.kind == "c"):  # GIS show the first: levels
            values, unit = variable.values[bank], str(variable.attrs.get("units", "1"))
            parts = {f"{name}.real": values.real, f"{name}.imag": values.imag} if values.dtype.kind == "c" else {
                name: values}
            yield from ((f"bank{bank}.{part}", some, unit) for part, some in sorted(parts.items(), reverse=True))
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
    """Corners of elements to eastings and northings; rows run against the track."""
    from rasterio.transform import Affine

    rows, columns = image.sizes["along_track"], image.sizes["across_track"]
    if min(rows, columns) < 2:
        raise ValueError(f"a GeoTIFF places a grid of at least 2 x 2 points, and this image has {rows} x {columns}; "
                         "write .exr, .nc or .h5.")
    grid = even_grid(image)
    if grid is None:
        raise ValueError("the points of this image are no even grid on the map, as those of a slant grid or about a "
                         "circle may not be; focus on a ground grid, or write .exr, .nc or .h5.")
    origin = np.asarray(image.attrs.get("local_origin") or (0.0, 0.0), float)[:2]
    corner = origin + grid.first + (rows - 0.5) * grid.ahead - 0.5 * grid.abeam
    return Affine(grid.abeam[0], -grid.ahead[0], corner[0], grid.abeam[1], -grid.ahead[1], corner[1])
