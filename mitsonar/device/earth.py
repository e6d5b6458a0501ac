"""Places on Earth: coordinate systems in metres, and the frame of a scene in one of them.

A `Frame` is the place on Earth of a scene's x = y = 0. Degrees are on WGS 84; PROJ projects them. Headings in files
refer to true north,

    heading from the scene's y axis = heading from true north - convergence

(convergence: from true to grid north, clockwise; Snyder, Map Projections, 1987, p. 19).
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

WGS84 = "EPSG:4326"
FARTHEST = 1e8                     # [m]: largest coordinate
POLAR = 84.0                       # [degrees] of latitude, beyond which UTM gives way to UPS


def metric_system(crs: str) -> CRS:
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
        raise ValueError(f"the coordinate system {known.name} is not one in metres, but in "
                         f"{', '.join(sorted(units)) or 'no units'}; give a projected system in metres, such as UTM.")
    return known


def transformed(source: str | CRS, target: str | CRS, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates, east or longitude first, in another system; `ValueError` if that does not reach there."""
    import pyproj

    there = pyproj.CRS.from_user_input(target)
    x, y = pyproj.Transformer.from_crs(source, there, always_xy=True).transform(x, y)
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise ValueError(f"some places lie outside the region that {there.name} can map; check them, or take another "
                         "coordinate system.")
    return x, y


def same_system(first: str, second: str) -> bool:
    """Return True if two texts name the same coordinate system in metres."""
    return first == second or metric_system(first) == metric_system(second)


def system(attrs: Mapping[str, Any]) -> str | None:
    """Return a record's coordinate system, or None."""
    crs = attrs.get("crs")
    if crs is not None and not isinstance(crs, str):
        raise ValueError(f"the record's crs is {crs!r}; it takes text such as \"EPSG:32632\".")
    return crs or None


def origin(attrs: Mapping[str, Any], name: str = "local_origin", what: str = "the record") -> tuple[float, float]:
    """Return the easting and northing of a record's x = y = 0; 0 without an origin."""
    values = attrs.get(name)
    if values is None:
        return 0.0, 0.0
    try:
        east, north = (float(value) for value in tuple(values)[:2])
    except (TypeError, ValueError):
        raise ValueError(f"{what}'s {name} is {values!r}; give easting and northing [m].") from None
    if not max(abs(east), abs(north)) < FARTHEST:
        raise ValueError(f"{what}'s {name} is {values!r}, farther than any place on Earth.")
    return east, north


@dataclass(frozen=True, kw_only=True)
class Frame:
    """Position of a scene on Earth.

    Parameters
    ----------
    crs : str
        Coordinate system in metres, as an EPSG code, WKT or PROJ string; empty if unknown.
    origin : tuple of 2 floats [m]
        Easting and northing of x = y = 0.
    """

    crs: str
    origin: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def about(cls, latitude_deg: float, longitude_deg: float) -> Frame:
        """Make a frame centred at a point: transverse Mercator, with scale 1 and grid north = true north there."""
        return cls(crs=f"+proj=tmerc +lat_0={latitude_deg:.9f} +lon_0={longitude_deg:.9f} +k=1 +x_0=0 +y_0=0 "
                       "+datum=WGS84 +units=m +no_defs")

    @classmethod
    def in_zone(cls, latitude_deg: float, longitude_deg: float) -> Frame:
        """Return the frame at a point, to a metre, in its UTM zone, or in UPS beyond 84 degrees."""
        if not (abs(latitude_deg) <= 90 and abs(longitude_deg) <= 360):
            raise ValueError(f"the first position is {latitude_deg:g}, {longitude_deg:g} degrees, nowhere on Earth.")
        if abs(latitude_deg) > POLAR:
            crs = f"EPSG:{5041 if latitude_deg > 0 else 5042}"
        else:
            crs = f"EPSG:{326 if latitude_deg >= 0 else 327}{int((longitude_deg + 180) % 360 // 6) + 1:02d}"
        east, north = cls(crs=crs)._projection.transform(longitude_deg, latitude_deg)
        return cls(crs=crs, origin=(float(np.round(east)), float(np.round(north))))

    @cached_property
    def _system(self) -> CRS:
        if not self.crs:
            raise ValueError("the seabed's file names no coordinate system, so latitudes and longitudes have no place "
                             'over it; say the bathymetry\'s crs, such as "EPSG:32632".')
        return metric_system(self.crs)

    @cached_property
    def _projection(self) -> Transformer:
        import pyproj

        return pyproj.Transformer.from_crs(WGS84, self._system, always_xy=True)

    def places(self, latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> np.ndarray:
        """Return points on WGS 84 (P,) as east and north of the origin (P, 2) [m], NaN for what is no place on Earth.
        """
        on_earth = (np.abs(latitude_deg) <= 90) & (np.abs(longitude_deg) <= 360)
        place = np.stack(self._projection.transform(np.where(on_earth, longitude_deg, np.nan),
                                                    np.where(on_earth, latitude_deg, np.nan)), -1)
        return np.where(np.isfinite(place), place, np.nan) - self.origin

    def convergence(self, latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> np.ndarray:
        """Return the angle [rad] from true north to the y axis at points (P,), clockwise."""
        import pyproj

        factors = pyproj.Proj(self._system).get_factors(longitude_deg, latitude_deg)
        return np.deg2rad(factors.meridian_convergence)

    def project(self, latitude_deg: np.ndarray, longitude_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Project points on WGS 84.

        Parameters
        ----------
        latitude_deg, longitude_deg : array (P,) [degrees]

        Returns
        -------
        position : array (P, 2) [m]
            East and north of the origin.
        convergence : array (P,) [rad]
            From true north to the y axis, clockwise.

        Raises
        ------
        ValueError
            If the frame has no coordinate system, or one without metres, or a point lies outside its area.
        """
        position = np.stack(self._projection.transform(longitude_deg, latitude_deg), -1) - self.origin
        outside = np.flatnonzero(~np.isfinite(position).all(-1))
        if outside.size:
            first = outside[0]
            raise ValueError(f"{latitude_deg[first]:.5f} N {longitude_deg[first]:.5f} E lies outside what "
                             f"{self._system.name} can map; check the coordinates.")
        return position, self.convergence(latitude_deg, longitude_deg)

    def on_globe(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return latitudes and longitudes of points: the inverse of `project`.

        Parameters
        ----------
        position : array (P, 2) [m]
            East and north of the origin.

        Returns
        -------
        latitude_deg, longitude_deg : array (P,) [degrees]
            On WGS 84.
        convergence : array (P,) [rad]
            From true north to the y axis, clockwise.

        Raises
        ------
        ValueError
            If the frame has no coordinate system that PROJ knows, or one without metres, or a point lies where it does
            not reach.
        """
        place = np.asarray(position, float) + self.origin
        longitude, latitude = self._projection.transform(place[:, 0], place[:, 1], direction="INVERSE")
        if not (np.isfinite(longitude) & np.isfinite(latitude)).all():
            raise ValueError(f"the track lies outside what {self._system.name} can map; check the origin and the "
                             "coordinate system.")
        return latitude, longitude, self.convergence(latitude, longitude)
