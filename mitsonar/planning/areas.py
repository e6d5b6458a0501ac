"""Reader of survey areas: corners in one line of text, or the polygons of a GeoJSON file.

    "0 0, 900 0, 900 400"      "37.75N 122.38W, 37.76N 122.38W, 37.76N 122.36W"      area.geojson

Corners in metres are in the bathymetry's own coordinates. GeoJSON (RFC 7946) has longitudes and latitudes on WGS 84,
unless a member ``crs`` (from before that standard) names another system. A point is inside if it lies in an odd number
of rings, so holes stay holes. Points and lines in the file are ignored.
"""
from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from shapely.geometry import shape

from mitsonar.device.earth import WGS84, Frame, transformed
from mitsonar.device.files import FilePath, check_readable
from mitsonar.io.grids import rasters
from mitsonar.io.tracks import tracks

LARGEST_FILE = 10_000_000          # bytes; parsed corners take about twenty times as much memory
MOST_CORNERS = 200_000
_WITHIN = {"FeatureCollection": "features", "GeometryCollection": "geometries", "Feature": "geometry"}
_NO_POLYGON = TypeError, ValueError, LookupError, ArithmeticError, AttributeError, shapely.GEOSException


@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """Rings (N, 2) of an area as written, x and y [m] or longitude and latitude [degrees], and their system."""

    rings: tuple[np.ndarray, ...]
    crs: str

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Return the smallest and largest coordinates: west, south, east, north."""
        corners = np.concatenate(self.rings)
        (west, south), (east, north) = corners.min(0), corners.max(0)
        return float(west), float(south), float(east), float(north)

    def utm(self) -> str:
        """Return the UTM system of the middle of the area; empty for metres without a system."""
        if not self.crs:
            return ""
        west, south, east, north = self.bounds
        return rasters.name_of(rasters.utm((west + east) / 2, (south + north) / 2, rasters.crs_of(self.crs)))

    def placed(self, frame: Frame) -> list[np.ndarray]:
        """Return the rings relative to the origin of a frame, as arrays (N, 2) [m]."""
        if not self.crs:
            return [ring - frame.origin for ring in self.rings]
        if self.crs == WGS84:
            return [frame.project(ring[:, 1], ring[:, 0])[0] for ring in self.rings]
        if not frame.crs:
            raise ValueError(f"the area is in {self.crs}, but the bathymetry names no coordinate system; give it by "
                             "--crs.")
        return [np.stack(transformed(self.crs, frame.crs, *ring.T), -1) - frame.origin for ring in self.rings]


def read(text: FilePath) -> Corners:
    """Read an area from a text of corners, or from a GeoJSON file."""
    if os.path.exists(text) or not re.search(r"\d[^/\\]*[,;\s]", str(text)):
        return _of_file(text)
    try:
        points = tracks.waypoints(str(text))
    except ValueError as error:
        raise ValueError(f"the area: {str(error).replace('way point', 'corner')}") from None
    return Corners(rings=(np.stack([points.x, points.y], -1),), crs=WGS84 if points.geographic else "")


def _of_file(path):
    check_readable(path, "the area", "a GeoJSON file")
    name = f"cannot read the area {path}"
    size = os.path.getsize(path)
    if size > LARGEST_FILE:
        raise ValueError(f"{name}: it has {size / 1e6:.0f} MB, more than {LARGEST_FILE / 1e6:g}; simplify it.")
    try:
        with open(path, encoding="utf-8-sig") as file:
            content = json.load(file)
    except (ValueError, RecursionError):
        raise ValueError(f"{name}: it is no GeoJSON; give a file with a polygon, or the corners as text.") from None
    try:
        return Corners(rings=tuple(_rings(content)), crs=_system(content))
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None


def _rings(content: Any) -> list[np.ndarray]:
    """Return the rings (N, 2) of all polygons."""
    rings, waiting = [], [content]
    while waiting:
        element = waiting.pop()
        type_name = str(element.get("type")) if isinstance(element, dict) else ""       # a feature may have no geometry
        if type_name in _WITHIN:
            within = element.get(_WITHIN[type_name])
            waiting += within if isinstance(within, list) else [within]
        elif type_name in ("Polygon", "MultiPolygon"):
            try:
                parts = shapely.get_rings(shapely.get_parts(shape(element)))
                rings += (corners := [shapely.get_coordinates(ring) for ring in parts])
                if not all(np.isfinite(ring).all() for ring in corners):
                    raise ValueError
            except _NO_POLYGON:
                raise ValueError("the rings of a polygon are not lists of finite corners x, y; save it as GeoJSON "
                                 "again.") from None
    if not rings:
        raise ValueError("it holds no polygon with corners; draw one around the area.")
    if sum(map(len, rings)) > MOST_CORNERS:
        raise ValueError(f"it has more than {MOST_CORNERS} corners; simplify its polygons.")
    return rings


def _system(content: Any) -> str:
    """Return the coordinate system of a GeoJSON file; the member ``crs`` is from before RFC 7946."""
    named = content.get("crs") if isinstance(content, dict) else None
    if named is None:
        return WGS84
    properties = named.get("properties") if isinstance(named, dict) else None
    name = properties.get("name") if isinstance(properties, dict) else None
    if not isinstance(name, str) or len(name) > 200:
        raise ValueError("its crs has no name; save it in longitudes and latitudes on WGS 84.")
    if name.upper().endswith("CRS84"):
        return WGS84
    return rasters.name_of(rasters.crs_of(name))
