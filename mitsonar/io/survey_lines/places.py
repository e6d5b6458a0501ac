"""Convert positions from degrees to metres of a zone, and attitudes and lever arms between sensor, vessel and level.

The zone is the UTM zone (UPS beyond 84 degrees) of the line's first position. Offsets of soundings from their ping are
not multiplied by the zone's scale (0.9996 to 1.0010): distances of a record are metres, as those of a scene. Headings
are clockwise from grid north, so that x and y follow from them.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.rotations import mounted, mounting_angles, mounting_matrix

STEP = 1e-5                        # [degrees] of latitude over which the direction of north is measured


@dataclass(frozen=True, kw_only=True)
class Zone:
    """Plane of projection of a line."""

    crs: str
    origin: tuple[float, float]  # [m]: easting and northing of x = y = 0
    convergence: float  # [rad]: bearing of true north there, clockwise from grid north

    @cached_property
    def _projection(self):
        import pyproj

        return pyproj.Transformer.from_crs("EPSG:4326", self.crs, always_xy=True)

    def places(self, longitude: np.ndarray, latitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return x and y [m] of longitudes and latitudes [degrees], NaN where these are invalid."""
        on_earth = (np.abs(latitude) <= 90) & (np.abs(longitude) <= 360)
        east, north = self._projection.transform(np.where(on_earth, longitude, np.nan),
                                                 np.where(on_earth, latitude, np.nan))
        return (np.where(np.isfinite(east), east - self.origin[0], np.nan),
                np.where(np.isfinite(north), north - self.origin[1], np.nan))


def zone_of(longitude: float, latitude: float) -> Zone:
    """Return the zone of a position [degrees]."""
    import pyproj

    if not (abs(latitude) <= 90 and abs(longitude) <= 360):
        raise ValueError(f"the first position is {latitude:g}, {longitude:g} degrees, nowhere on Earth.")
    if abs(latitude) > 84:
        crs = f"EPSG:{5041 if latitude > 0 else 5042}"
    else:
        crs = f"EPSG:{326 if latitude >= 0 else 327}{int((longitude + 180) % 360 // 6) + 1:02d}"
    projection = pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    east, north = projection.transform(longitude, latitude)
    step = -STEP if latitude > 0 else STEP        # towards the equator: a pole has no north
    next_east, next_north = projection.transform(longitude, latitude + step)
    convergence = np.arctan2((next_east - east) / step, (next_north - north) / step)
    return Zone(crs=crs, origin=(float(np.round(east)), float(np.round(north))), convergence=float(convergence))


def levelled(offset: np.ndarray, roll: ArrayLike, pitch: ArrayLike) -> np.ndarray:
    """Return lever arms (..., 3) of the body as forward, starboard and down of the levelled vessel."""
    return mounted(offset, np.asarray(roll), np.asarray(pitch))


def from_sensor(roll: np.ndarray, pitch: np.ndarray, heading: np.ndarray,
                mounting: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vessel's roll, pitch and heading from those of a sensor and its mounting (roll, pitch, heading)."""
    if heading.size == 0 or not np.any(mounting):
        return roll, pitch, heading
    vessel = mounting_matrix(roll, pitch, heading) @ mounting_matrix(*mounting).T
    roll, pitch, heading = mounting_angles(vessel).T
    return roll, pitch, heading


def straight(mounting: np.ndarray) -> tuple[np.ndarray, bool]:
    """Return the mounting (roll, pitch, heading) of an array with its cable turned aft, and True if it left forward.

    An array turned by half a circle about its normal is the same array with forward and starboard exchanged for aft and
    port: Rz(h) Ry(p) Rx(r) Rz(180) = Rz(h + 180) Ry(-p) Rx(-r).
    """
    roll, pitch, heading = mounting
    heading = np.remainder(heading + np.pi, 2 * np.pi) - np.pi
    if abs(heading) <= np.pi / 2:
        return np.array([roll, pitch, heading]), False
    return np.array([-roll, -pitch, heading - np.copysign(np.pi, heading)]), True


def across_and_along(x: ArrayLike, y: ArrayLike, heading: ArrayLike, across: np.ndarray,
                     along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of points at distances across and along track from a position."""
    sine, cosine = np.sin(heading), np.cos(heading)
    return x + along * sine + across * cosine, y + along * cosine - across * sine
