"""Georeference of a record: its coordinate system, its origin, and its pings in another system.

    p' = P' + A (p - P)            within a swath of P; A the derivative of the projection there

x, y -> ``x``, ``y`` [m] of the scene plus ``local_origin``. Over a swath of a few hundred metres, the second
order of the projection is below a millimetre (Snyder, Map Projections, 1987: scale changes by at most 1e-9 per metre).
"""
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

AROUND = 100.0                     # [m]: step of the derivative
FARTHEST = 1e8                     # [m]: largest coordinate


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPlaces:
    """Pings of a record on a map."""

    position: np.ndarray  # (P, 2) [m]: easting and northing
    derivative: np.ndarray  # (P, 2, 2): of easting and northing by scene x and y


def origin(attrs: Mapping[str, Any]) -> tuple[float, float]:
    """Return the easting and northing of a record's x = y = 0; 0 without an origin."""
    values = attrs.get("local_origin")
    if values is None:
        return 0.0, 0.0
    try:
        east, north = (float(value) for value in tuple(values)[:2])
    except (TypeError, ValueError):
        raise ValueError(f"the record's local_origin is {values!r}; it takes easting and northing [m].") from None
    if not max(abs(east), abs(north)) < FARTHEST:
        raise ValueError(f"the record's local_origin is {values!r}, farther than any place on Earth.")
    return east, north


def system(attrs: Mapping[str, Any]) -> str | None:
    """Return a record's coordinate system, or None."""
    crs = attrs.get("crs")
    if crs is not None and not isinstance(crs, str):
        raise ValueError(f"the record's crs is {crs!r}; it takes text such as \"EPSG:32632\".")
    return crs or None


def named_system(crs: str) -> str:
    """Return a coordinate system; `ValueError` if PROJ lacks it or it is not in metres."""
    import pyproj
    from pyproj.exceptions import ProjError

    try:
        known = pyproj.CRS.from_user_input(crs)
    except ProjError as error:
        raise ValueError(f"the coordinate system {crs[:80]!r} is none that PROJ knows "
                         f"({' '.join(str(error).split())[:80]}).") from None
    units = {axis.unit_name for axis in known.axis_info[:2]}
    if not known.is_projected or units != {"metre"}:
        raise ValueError(f"the coordinate system {known.name} is in {', '.join(sorted(units)) or 'no units'}; give a "
                         "projected system in metres, such as UTM.")
    return crs


def map_places(record: xr.Dataset, crs: str | None) -> MapPlaces:
    """Return a record's pings in a coordinate system."""
    position = np.stack([np.asarray(record[axis].values, float) for axis in "xy"], -1) + origin(record.attrs)
    source = system(record.attrs)
    if source is None or crs is None or _same(source, crs):
        return MapPlaces(position=position, derivative=np.broadcast_to(np.eye(2), (len(position), 2, 2)))
    import pyproj

    transformer = pyproj.Transformer.from_crs(named_system(source), named_system(crs), always_xy=True)
    around = position[:, None] + AROUND * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    moved = np.stack(transformer.transform(around[..., 0], around[..., 1]), -1)
    if not np.isfinite(moved).all():
        raise ValueError(f"the track lies outside the region that {crs[:80]} can map; take another coordinate system.")
    derivative = np.stack([moved[:, 1] - moved[:, 2], moved[:, 3] - moved[:, 4]], -1) / (2 * AROUND)
    return MapPlaces(position=moved[:, 0], derivative=derivative)


def _same(first, second):
    import pyproj

    return first == second or (pyproj.CRS.from_user_input(named_system(first))
                               == pyproj.CRS.from_user_input(named_system(second)))
