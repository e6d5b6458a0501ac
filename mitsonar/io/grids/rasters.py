"""Rasters prepared for `bathymetry`: checked, in metres, not rotated, and cut to a part."""
import contextlib
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from rasterio.crs import CRS
    from rasterio.io import DatasetReader
    from rasterio.vrt import WarpedVRT
    from rasterio.windows import Window

    from .survey_relief import FinerGrid


MOST_NODES = 2e8
_METRES = ("", "m", "metre", "metres", "meter", "meters")


def check(raster: "DatasetReader", band: int) -> None:
    """Raise `ValueError` if a raster lacks the band or a place on Earth, or has heights in another unit than metres."""
    if raster.count == 0:
        parts = f"; it holds {', '.join(raster.subdatasets)}: name one of them" if raster.subdatasets else ""
        raise ValueError(f"the file has no grid of its own{parts}.")
    if not 1 <= band <= raster.count:
        names = ", ".join(f"{i} {name or 'unnamed'}" for i, name in enumerate(raster.descriptions, 1))
        raise ValueError(f"there is no band {band}; the file has {names}.")
    if (raster.units[band - 1] or "").lower() not in _METRES:
        raise ValueError(f"heights are in {raster.units[band - 1]}; convert them to metres.")
    if raster.crs is None and raster.transform.is_identity:
        raise ValueError("the file has no georeference; add one (gdal_translate -a_ullr), or save .npy.")
    if not np.isfinite(raster.transform).all() or raster.transform.determinant == 0:
        raise ValueError("the file's georeference puts all nodes on a line or nowhere; repair it.")


@contextlib.contextmanager
def in_metres(raster: "DatasetReader", source: "CRS | None", resolution: float | None, nodata: float | None,
              smooth: bool = False) -> "Iterator[DatasetReader | WarpedVRT]":
    """Yield the raster, or a view of it in metres, with rows running east, at the given resolution.

    Views interpolate linearly, or by cubics if ``smooth``, which keep more of the short waves.
    """
    from rasterio.crs import CRS
    from rasterio.enums import Resampling
    from rasterio.transform import from_origin
    from rasterio.vrt import WarpedVRT

    metric = is_metric(source)
    is_upright = raster.transform.b == 0 and raster.transform.d == 0 and raster.transform.a > 0
    if metric and is_upright and (resolution is None or raster.res == (resolution, resolution)):
        yield raster
        return
    target = source
    if source is not None and not metric:
        x, y = raster.xy(raster.height / 2, raster.width / 2, offset="ul")
        target = utm(x, y, source)
    view = {"crs": target or CRS(), "src_crs": source or CRS(), "dtype": "float32", "nodata": np.nan,
            "src_nodata": nodata if nodata is not None else np.nan if raster.nodata is None else raster.nodata,
            "resampling": Resampling.cubic if smooth else Resampling.bilinear}
    bounds, native = raster.bounds, max(raster.res)
    if not (metric and is_upright):
        with WarpedVRT(raster, **view) as natural:
            bounds, native = natural.bounds, max(natural.res)
    west, east, south, north = *sorted(bounds[::2]), *sorted(bounds[1::2])
    if resolution is None:
        resolution = native
    elif resolution > native:
        view["resampling"] = Resampling.average
    width, height = (max(round(extent / resolution), 1) for extent in (east - west, north - south))
    if max(width, height) > MOST_NODES:                # more than the library can count
        raise ValueError(f"cells of {resolution:g} m would be {height:.3g} rows of {width:.3g}; give a larger "
                         "resolution.")
    with WarpedVRT(raster, transform=from_origin(west, north, resolution, resolution), width=width, height=height,
                   **view) as grid:
        yield grid


def source_crs(raster: "DatasetReader", crs: str | None) -> "CRS | None":
    """Return the coordinate system of a raster, or the one stated for a raster that names none."""
    if raster.crs is not None and crs is not None:
        raise ValueError(f"the file names its coordinate system, {name_of(raster.crs)}; leave out {crs}.")
    if raster.crs is None and crs is None and max(raster.res) < 0.1:
        refuse_degrees(raster.bounds)
    return raster.crs if crs is None else crs_of(crs)


def refuse_degrees(bounds: Sequence[float]) -> None:
    """Raise `ValueError` if west, south, east and north, without a named system, look like degrees."""
    if np.all(np.abs(bounds) <= (360, 90, 360, 90)):
        raise ValueError("no coordinate system is named and the coordinates look like degrees; "
                         'say crs "EPSG:4326", or what they are.')


def crs_of(text: str) -> "CRS":
    """Return the coordinate system of a text, such as an EPSG code."""
    from rasterio import Env
    from rasterio.crs import CRS
    from rasterio.errors import CRSError

    try:
        # GDAL would fetch an address or read a file
        if re.match(r"\s*(\w+:)?[/\\]", str(text)) or os.path.exists(str(text)):
            raise CRSError
        with Env():                                    # keeps GDAL from printing its own error
            return CRS.from_user_input(text)
    except CRSError:
        raise ValueError(f'"{text}" is no coordinate system; write an EPSG code such as "EPSG:32632".') from None


def is_metric(crs: "CRS | None") -> bool:
    """Return True if coordinates are in metres; coordinates without a system count as metres."""
    return crs is None or not (crs.is_geographic or (crs.is_projected and crs.linear_units_factor[1] != 1))


def utm(x: float, y: float, source: "CRS") -> "CRS":
    """Return the UTM system of a place given in the system ``source``."""
    from pyproj.aoi import AreaOfInterest
    from pyproj.database import query_utm_crs_info
    from rasterio.crs import CRS
    from rasterio.warp import transform

    (longitude,), (latitude,) = transform(source, CRS.from_epsg(4326), [x], [y])[:2]
    longitude = (longitude + 180) % 360 - 180
    zones = query_utm_crs_info(datum_name="WGS 84", contains=True, area_of_interest=AreaOfInterest(
        longitude, latitude, longitude, latitude))
    if not zones:
        raise ValueError(f"no UTM zone holds {latitude:.2f} N {longitude:.2f} E; reproject the file to metres "
                         "(gdalwarp -t_srs).")
    return CRS.from_epsg(zones[0].code)


@dataclass(frozen=True, kw_only=True)
class RasterPart:
    """Part of a raster to read: a ``crop``, a ``size`` about a ``centre``, or all of it.

    ``crop`` is west, south, east, north. ``frame`` is the frame of ``crop`` and ``centre``: the file's own coordinates
    ("projected"), or metres from the middle of the file's extent, rounded to metres ("local").
    """

    crop: Sequence[float] | None = None
    centre: Sequence[float] | None = None
    size: Sequence[float] | None = None
    frame: str = "projected"

    def __post_init__(self):
        if self.crop is not None and (self.centre is not None or self.size is not None):
            raise ValueError("give crop, or centre and size, not both.")
        if self.centre is not None and self.size is None:
            raise ValueError("a centre needs a size.")
        if self.crop is not None and not (self.crop[0] <= self.crop[2] and self.crop[1] <= self.crop[3]):
            raise ValueError(f"the crop {_listed(self.crop)} is not west, south, east, north.")
        if self.size is not None and not min(self.size) > 0:
            raise ValueError(f"size is {_listed(self.size)} m; both must be above 0.")
        if self.frame not in ("projected", "local"):
            raise ValueError(f'frame is "{self.frame}"; it must be "projected" or "local".')

    def bounds(self, middle: tuple[float, float], source: "CRS | None",
               target: "CRS | None") -> tuple[float, float, float, float]:
        """Return west, south, east and north in the system ``target`` of a grid with the given middle."""
        from rasterio.warp import transform_bounds

        def placed(west: float, south: float, east: float, north: float) -> tuple[float, float, float, float]:
            if self.frame == "local":
                return west + middle[0], south + middle[1], east + middle[0], north + middle[1]
            if source == target or not target:
                return west, south, east, north
            return transform_bounds(source, target, west, south, east, north)

        if self.crop is not None:
            return placed(*self.crop)
        if self.size is None:
            return -np.inf, -np.inf, np.inf, np.inf
        east, north = middle if self.centre is None else placed(*self.centre, *self.centre)[:2]
        return east - self.size[0] / 2, north - self.size[1] / 2, east + self.size[0] / 2, north + self.size[1] / 2


def window(grid: "DatasetReader | WarpedVRT | FinerGrid", part: RasterPart,
           source: "CRS | None") -> "tuple[np.ndarray, np.ndarray, Window]":
    """Return the coordinates of the columns and rows in ``part``, and their window in the grid.

    Rows are in the order of the file, mostly from the north. Fewer than two rows or columns raise `ValueError`.
    """
    at = grid.transform
    x = at.c + (np.arange(grid.width) + 0.5) * at.a
    y = at.f + (np.arange(grid.height) + 0.5) * at.e
    middle = round((x[0] + x[-1]) / 2), round((y[0] + y[-1]) / 2)
    west, south, east, north = part.bounds(middle, source, grid.crs)
    edge = 1e-6 * at.a
    columns = np.flatnonzero((x >= west - edge) & (x <= east + edge))
    rows = np.flatnonzero((y >= south - edge) & (y <= north + edge))
    if columns.size < 2 or rows.size < 2:
        covers = x[0], min(y[0], y[-1]), x[-1], max(y[0], y[-1])
        raise ValueError(f"{rows.size} x {columns.size} nodes are left in {_listed((west, south, east, north))}; the "
                         f"file covers {_listed(covers)} (west, south, east, north).")
    if columns.size * rows.size > MOST_NODES:
        raise ValueError(f"{rows.size} x {columns.size} nodes are more than {MOST_NODES:.0e}; read a part or a "
                         "coarser resolution.")
    return x[columns], y[rows], window_at(columns[0], rows[0], columns.size, rows.size)


def window_at(column: int, row: int, width: int, height: int) -> "Window":
    """Return the window of ``width`` columns and ``height`` rows from a column and a row."""
    from rasterio.windows import Window

    return Window(column, row, width, height)  # pyright: ignore[reportCallIssue]  its fields are declared untyped


def window_about(grid: "DatasetReader | WarpedVRT", x: np.ndarray, y: np.ndarray,
                 margin: int) -> "tuple[np.ndarray, np.ndarray, Window]":
    """Return the columns, rows and window of a grid that cover columns x (P,) and rows y (Q,) [m], plus a margin."""
    at = grid.transform
    spans = []
    for places, first, step, number in ((x, at.c, at.a, grid.width), (y, at.f, at.e, grid.height)):
        index = np.sort((places[[0, -1]] - first) / step - 0.5)
        low, high = max(int(index[0]) - margin, 0), min(int(np.ceil(index[1])) + margin, number - 1)
        spans.append((low, high - low + 1, first + (np.arange(low, high + 1) + 0.5) * step))
    (column, width, x), (row, height, y) = spans
    return x, y, window_at(column, row, width, height)


def name_of(crs: "CRS | None") -> str:
    """Return the EPSG code of a coordinate system, else its WKT; an empty text for None."""
    if not crs:
        return ""
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else crs.to_wkt()


def _listed(values):
    return ", ".join(f"{value:.12g}" for value in values)
