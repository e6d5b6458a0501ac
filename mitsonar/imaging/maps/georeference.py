"""Pings of a record on a map, in the coordinate system of the record or in another.

    p' = P' + A (p - P)            within a swath of P; A the derivative of the projection there

x, y -> ``x``, ``y`` [m] of the scene plus ``local_origin``. Over a swath of a few hundred metres, the second
order of the projection is below a millimetre (Snyder, Map Projections, 1987: scale changes by at most 1e-9 per metre).
"""
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.device.earth import metric_system, origin, same_system, system, transformed

AROUND = 100.0                     # [m]: step of the derivative


@dataclass(frozen=True, kw_only=True, eq=False)
class MapPlaces:
    """Pings of a record on a map."""

    position: np.ndarray  # (P, 2) [m]: easting and northing
    derivative: np.ndarray  # (P, 2, 2): of easting and northing by scene x and y


def map_places(record: xr.Dataset, crs: str | None) -> MapPlaces:
    """Return a record's pings in a coordinate system."""
    position = np.stack([np.asarray(record[axis].values, float) for axis in "xy"], -1) + origin(record.attrs)
    source = system(record.attrs)
    if source is None or crs is None or same_system(source, crs):
        return MapPlaces(position=position, derivative=np.broadcast_to(np.eye(2), (len(position), 2, 2)))
    around = position[:, None] + AROUND * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    moved = np.stack(transformed(metric_system(source), metric_system(crs), around[..., 0], around[..., 1]), -1)
    derivative = np.stack([moved[:, 1] - moved[:, 2], moved[:, 3] - moved[:, 4]], -1) / (2 * AROUND)
    return MapPlaces(position=moved[:, 0], derivative=derivative)
