"""Navigation in files, and its conversion to a scene: east and north in metres about the scene's origin.

A file's positions are metres of its own, metres of a projection (eastings and northings), or degrees of latitude and
longitude on WGS 84. A `Frame` is the place on Earth of a scene's x = y = 0. Degrees are projected to its coordinate
system by PROJ; the convergence of the meridians is subtracted from headings, which refer to true north:

    heading from the scene's y axis = heading from true north - convergence

(convergence: from true to grid north, clockwise; Snyder, Map Projections, 1987, p. 19).
"""
from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mitsonar.device.files import FilePath
from mitsonar.sonar.motion.track import Track

WGS84 = "EPSG:4326"
_COURSE_TIME = 1.0                 # [s] before and after, over which a course is measured
_SLOWEST = 0.1                     # [m/s] at which there is a course
_REPEATED = 0.2                    # share of positions that repeat the one before, where fixes are repeated
_FEWEST = 4                        # fixes that are
_STANDS = 3.0                      # times as long as fixes usually are repeated, a platform stands still


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
        import pyproj

        if not self.crs:
            raise ValueError("the seabed's file names no coordinate system, so latitudes and longitudes have no place "
                             'over it; say the bathymetry\'s crs, such as "EPSG:32632".')
        crs = pyproj.CRS.from_user_input(self.crs)
        if not crs.is_projected:
            raise ValueError(f"the seabed's coordinate system {crs.name} is not one in metres; latitudes and "
                             "longitudes cannot be laid over it.")
        east, north = pyproj.Transformer.from_crs(WGS84, crs, always_xy=True).transform(longitude_deg, latitude_deg)
        outside = np.flatnonzero(~(np.isfinite(east) & np.isfinite(north)))
        if outside.size:
            first = outside[0]
            raise ValueError(f"{latitude_deg[first]:.5f} N {longitude_deg[first]:.5f} E lies outside what {crs.name} "
                             "can map; check the coordinates.")
        factors = pyproj.Proj(crs).get_factors(longitude_deg, latitude_deg)
        return np.stack([east, north], -1) - self.origin, np.deg2rad(factors.meridian_convergence)

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
        import pyproj
        from pyproj.exceptions import ProjError

        try:
            crs = pyproj.CRS.from_user_input(self.crs)
            if not crs.is_projected:
                raise ValueError(f"the coordinate system {crs.name} is not one in metres; give a projected one.")
            projection = pyproj.Transformer.from_crs(crs, WGS84, always_xy=True)
        except ProjError as error:
            raise ValueError(f"the coordinate system {self.crs[:80]!r} is none that PROJ knows "
                             f"({' '.join(str(error).split())[:80]}).") from None
        place = np.asarray(position, float) + self.origin
        longitude, latitude = projection.transform(place[:, 0], place[:, 1])
        if not (np.isfinite(longitude) & np.isfinite(latitude)).all():
            raise ValueError(f"the track lies outside what {crs.name} can map; check the origin and the coordinate "
                             "system.")
        factors = pyproj.Proj(crs).get_factors(longitude, latitude)
        return latitude, longitude, np.deg2rad(factors.meridian_convergence)


@dataclass(frozen=True, kw_only=True, eq=False)
class Waypoints:
    """Way points as written.

    Parameters
    ----------
    x, y : array (N,) [m] or [degrees]
        Eastings and northings; longitudes and latitudes if ``geographic``.
    z : array (N,) [m] or None
        Up from the sea surface; None if not written.
    geographic : bool
        True for degrees.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray | None = None
    geographic: bool = False

    def placed(self, frame: Frame | None = None) -> np.ndarray:
        """Return the points in the scene, array (N, 2) [m]; raises `ValueError` as `Frame.project`."""
        return _placed(self, frame)[0]


@dataclass(frozen=True, kw_only=True, eq=False)
class Navigation:
    """Recorded track as in its file.

    Parameters
    ----------
    time : array (P,) [s]
        Strictly increasing times.
    x, y : array (P,) [m] or [degrees]
        Eastings and northings; longitudes (which may continue past 180) and latitudes if ``geographic``.
    z : array (P,) [m] or None
        Up from the mean sea surface, without heave; None if the file has none.
    heave, roll, pitch : array (P,) [m], [rad], [rad]
        Heave positive up.
    heading : array (P,) [rad] or None
        From true north if ``geographic``, else from the y axis; None if the file has none: the course.
    geographic : bool
        True for degrees.
    """

    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray | None
    heave: np.ndarray
    roll: np.ndarray
    pitch: np.ndarray
    heading: np.ndarray | None
    geographic: bool = False

    def placed(self, frame: Frame | None = None, depth: float = 0.0) -> Track:
        """Return the track in the coordinates of a scene.

        Parameters
        ----------
        frame : Frame or None
            None: metres as they are, degrees about the middle of the track.
        depth : float [m]
            Below the mean sea surface, where the file has no z.

        Returns
        -------
        Track
            Heave added to z.

        Raises
        ------
        ValueError
            As `Frame.project` and `Track`.
        """
        position, convergence = _placed(self, frame)
        z = np.full(self.time.size, -float(depth)) if self.z is None else self.z
        heading = course(self.time, position) if self.heading is None else self.heading - convergence
        return Track(time=self.time, position=np.column_stack([position, z + self.heave]), roll=self.roll,
                     pitch=self.pitch, heading=heading)


def middle(record: Waypoints | Navigation) -> Frame:
    """Return the `Frame` about the middle of a record in degrees."""
    return Frame.about(*(0.5 * (float(np.min(axis)) + float(np.max(axis))) for axis in (record.y, record.x)))


def _placed(record, frame):
    """Return east and north of the frame's origin [m] and the convergence [rad], from a record's x and y."""
    if record.geographic:
        return (frame or middle(record)).project(record.y, record.x)
    position = np.stack([record.x, record.y], -1)
    return (position if frame is None else position - frame.origin), 0.0


def unrepeated(path: FilePath, time: np.ndarray, place: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return places at the times of a record that may repeat each fix until the next one.

    Pings are logged faster than positions: with ten pings and one fix a second, the place repeats nine times and then
    jumps. In such records each new fix counts once; curves without overshoot connect the fixes.
    """
    # time (P,) [s]; place (P, 2) [degrees]; at (N,) [s] -> array (N, 2) [m] or [degrees]
    fixes = _fixes(time, place)
    if fixes is None:
        return np.stack([np.interp(at, time, axis) for axis in place.T], -1)
    usual = float(np.median(np.diff(time[fixes])))
    warnings.warn(f"{path} repeats positions: {fixes.size} fixes, one in {usual:.3g} s, stand in {time.size} records; "
                  "each is used once, and the places between are interpolated", stacklevel=4)
    from scipy.interpolate import PchipInterpolator

    way = PchipInterpolator(time[fixes], place[fixes])         # does not swing where the platform stops
    inside = np.clip(at, time[fixes[0]], time[fixes[-1]])
    return way(inside) + (at - inside)[:, None] * way(inside, 1)


def _fixes(time, place):
    """Return the numbers of the records with a new fix, or None if fixes are not repeated."""
    new = np.flatnonzero(np.r_[True, (np.diff(place, axis=0) != 0).any(1)])
    lasting = np.diff(np.r_[new, time.size])
    several = lasting > 1
    if new.size < _FEWEST or several.sum() < _FEWEST or new.size > (1 - _REPEATED) * time.size:
        return None
    usual = np.median(lasting[several])
    first = 1 if lasting[0] < usual else 0             # the record may begin in the middle of a fix
    stands = new + lasting - int(usual)                # the last fix of where it stood
    return np.unique(np.r_[new[first:], stands[first:][lasting[first:] > _STANDS * usual]])


def course(time: npt.ArrayLike, position: npt.ArrayLike) -> np.ndarray:
    """Return the course over ground."""
    # time (P,) [s]; position (P, 2) [m] -> (P,) [rad]
    time, position = np.asarray(time, float), np.asarray(position, float)
    number = np.arange(time.size)
    before = np.maximum(np.minimum(np.searchsorted(time, time - _COURSE_TIME), number - 1), 0)
    after = np.minimum(np.maximum(np.searchsorted(time, time + _COURSE_TIME, side="right") - 1, number + 1),
                       time.size - 1)
    way, lasting = position[after] - position[before], time[after] - time[before]
    moving = np.hypot(*way.T) > _SLOWEST * lasting
    if not moving.any():
        return np.zeros(time.size)
    last = np.maximum.accumulate(np.where(moving, number, -1))
    last[last < 0] = np.argmax(moving)
    return np.arctan2(way[:, 0], way[:, 1])[last]
