"""Navigation in files, and its conversion to a scene: east and north in metres about the scene's origin.

A file's positions are metres of its own, metres of a projection (eastings and northings), or degrees of latitude and
longitude on WGS 84. Degrees are projected to the coordinate system of a `Frame` (`device.earth`); the convergence of
the meridians is subtracted from headings, which refer to true north.
"""
from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath
from mitsonar.sonar.motion.track import Track

_COURSE_TIME = 1.0                 # [s] before and after, over which a course is measured
_SLOWEST = 0.1                     # [m/s] at which there is a course
_REPEATED = 0.2                    # share of positions that repeat the one before, where fixes are repeated
_FEWEST = 4                        # fixes that are
_STANDS = 3.0                      # times as long as fixes usually are repeated, a platform stands still


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
    height : array (P,) [m] or None
        Above the ellipsoid; None if the file has none.
    week : bool
        True if times are seconds of a week that the file does not name.
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
    height: np.ndarray | None = None
    week: bool = False

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
