"""Messages of a platform's poses: odometry, transforms, attitude, and the position on Earth."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from mitsonar.device import earth

from . import axes
from .bag_messages import BagMessage, header, nanoseconds, vector

UNKNOWN = -1.0                     # first number of a covariance whose values are not measured
MAP = "map"
GPS = 1                            # NavSatStatus.service; status 0 is a fix


@dataclass(frozen=True, kw_only=True)
class BagNames:
    """Names of a record's topics and frames in a bag."""

    topics: str = "/sonar"
    base: str = "base_link"
    sonar: str = "sonar"

    @classmethod
    def of(cls, name: str) -> BagNames:
        """Return the names of one of several records."""
        return cls(topics=f"/{name}", base=f"{name}/base_link", sonar=f"{name}/sonar")


@dataclass(frozen=True, kw_only=True, eq=False)
class BagPoses:
    """Poses of a platform: times (P,) [s] after a start, positions (P, 3) [m], roll, pitch and heading (P, 3) [rad]."""

    time: np.ndarray
    position: np.ndarray
    attitude: np.ndarray
    start: float  # [s] since 1970
    by_sensors: bool = False  # of motion sensors, which have a record of the whole line, rather than of pings

    def beside(self, before: BagPoses | None, after: BagPoses | None) -> tuple[BagPoses, np.ndarray]:
        """Return the poses with the last ones of a part before and the first of one after, and their own numbers."""
        parts = [*([] if before is None else [before.part(slice(-1, None))]), self,
                 *([] if after is None else [after.part(slice(0, 1))])]
        joined = BagPoses(start=self.start, time=np.concatenate([part.time for part in parts]),
                          position=np.concatenate([part.position for part in parts]),
                          attitude=np.concatenate([part.attitude for part in parts]))
        return joined, np.arange(self.time.size) + (before is not None)

    def part(self, which: slice) -> BagPoses:
        """Return some of the poses."""
        return BagPoses(start=self.start, time=self.time[which], position=self.position[which],
                        attitude=self.attitude[which])


def poses_of(record: xr.Dataset, start: float) -> BagPoses | None:
    """Return the poses of an image's pings, or of the motion sensors of soundings; None if it has neither."""
    sensors = {"motion_time", "motion_x"} <= set(record.variables)
    if sensors:
        names = ("motion_time", "motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading")
    else:
        place = "sonar_" if "sonar_x" in record.coords else ""
        names = ("ping_time", f"{place}x", f"{place}y", f"{place}z", "roll", "pitch", "heading")
    if "ping" not in record.dims or not set(names[:4]) <= set(record.variables):
        return None
    columns = [np.asarray(record[name].values, float) if name in record.variables else None for name in names]
    time, x, y, z, *angles = (np.zeros_like(columns[0]) if column is None else column for column in columns)
    z = -z if names[3] == "motion_depth" else z
    return BagPoses(time=time, position=np.stack([x, y, z], -1), attitude=np.stack(angles, -1), start=start,
                    by_sensors=sensors)


def navigation(poses: BagPoses, shown: np.ndarray, names: BagNames, attrs: dict[str, Any], *,
               velocity: ArrayLike | None = None, turn_rate: ArrayLike | None = None) -> Iterator[BagMessage]:
    """Yield the messages of the poses of some numbers in the order of time.

    ``velocity`` [m/s] and ``turn_rate`` [rad/s] are those in the scene's frame; without them they follow from
    neighbouring poses, and are unknown of a single one.
    """
    quaternion = axes.quaternions(poses.attitude)
    pings = poses.time.size
    known = pings > 1 and bool(np.all(np.diff(poses.time) > 0))
    zero = np.zeros((pings, 3))
    linear, angular = axes.velocities(poses.time, poses.position, quaternion) if known else (zero, zero)
    inverse = Rotation.from_quat(quaternion).inv()
    if velocity is not None:
        linear = inverse.apply(np.tile(np.asarray(velocity, float), (pings, 1)))
    if turn_rate is not None:
        angular = inverse.apply(np.tile(np.asarray(turn_rate, float), (pings, 1)))
    rate_known, speed_known = known or turn_rate is not None, known or velocity is not None
    place = _on_earth(poses, attrs)
    for number in shown:
        stamp = nanoseconds(float(poses.time[number]), poses.start)
        turn, where = dict(zip("xyzw", map(float, quaternion[number]))), vector(poses.position[number])
        yield BagMessage(topic="/tf", type="tf2_msgs/msg/TFMessage", stamp=stamp, fields={"transforms": [
            {"header": header(stamp, MAP), "child_frame_id": names.base,
             "transform": {"translation": where, "rotation": turn}}]})
        yield BagMessage(topic=f"{names.topics}/odometry", type="nav_msgs/msg/Odometry", stamp=stamp, fields={
            "header": header(stamp, MAP), "child_frame_id": names.base,
            "pose": {"pose": {"position": where, "orientation": turn}},
            "twist": {"twist": {"linear": vector(linear[number]), "angular": vector(angular[number])},
                      "covariance": _unknown(36, not (rate_known and speed_known))}})
        yield BagMessage(topic=f"{names.topics}/imu", type="sensor_msgs/msg/Imu", stamp=stamp, fields={
            "header": header(stamp, names.base), "orientation": turn, "angular_velocity": vector(angular[number]),
            "angular_velocity_covariance": _unknown(9, not rate_known),
            "linear_acceleration_covariance": _unknown(9, True)})
        if place is not None:
            latitude, longitude = place
            yield BagMessage(topic=f"{names.topics}/fix", type="sensor_msgs/msg/NavSatFix", stamp=stamp, fields={
                "header": header(stamp, names.base), "status": {"status": 0, "service": GPS},
                "latitude": float(latitude[number]), "longitude": float(longitude[number]),
                "altitude": float(poses.position[number, 2])})


def pose_of(odometry: Any, start: float = 0.0) -> dict[str, Any]:
    """Return the arguments of `mitsonar.Sonar.ping` from a message of odometry.

    Parameters
    ----------
    odometry : nav_msgs/Odometry
        Message of rclpy, or any object with the same fields. Its frame is the scene's: x east, y north, z up.
    start : float [s]
        Date of time 0, since 1970. Whole seconds near the run keep nanoseconds exact.

    Returns
    -------
    dict
        ``position``, ``attitude``, ``velocity``, ``turn_rate`` and ``time``.
    """
    pose, twist, stamp = odometry.pose.pose, odometry.twist.twist, odometry.header.stamp
    quaternion = [getattr(pose.orientation, axis) for axis in "xyzw"]
    turn = Rotation.from_quat(quaternion)
    place, linear, angular = (np.array([getattr(value, axis) for axis in "xyz"])
                              for value in (pose.position, twist.linear, twist.angular))
    return {"position": place, "attitude": axes.attitudes(np.array([quaternion]))[0], "velocity": turn.apply(linear),
            "turn_rate": turn.apply(angular), "time": stamp.sec - start + 1e-9 * stamp.nanosec}


def mounting(stamp: int, names: BagNames, frame: np.ndarray, offset: np.ndarray) -> BagMessage:
    """Return the static transform of a sonar: its frame's columns (3, 3) and place (3,) [m] in the body."""
    turn = dict(zip("xyzw", map(float, axes.mounting_quaternion(frame))))
    return BagMessage(topic="/tf_static", type="tf2_msgs/msg/TFMessage", stamp=stamp, fields={"transforms": [
        {"header": header(stamp, names.base), "child_frame_id": names.sonar,
         "transform": {"translation": vector(axes.flu(offset)), "rotation": turn}}]})


def _unknown(size: int, unknown: bool) -> np.ndarray:
    """Return a covariance: 0 for exact values, and -1 first for values that are not known."""
    covariance = np.zeros(size)
    covariance[0] = UNKNOWN if unknown else 0.0
    return covariance


def _on_earth(poses: BagPoses, attrs: dict[str, Any]) -> tuple[np.ndarray, np.ndarray] | None:
    """Return latitudes and longitudes (P,) [degrees], or None for a scene without a place."""
    crs = earth.system(attrs)
    if crs is None:
        return None
    # lines of soundings call their local origin `origin`
    name = "local_origin" if attrs.get("local_origin") is not None else "origin"
    latitude, longitude, _ = earth.Frame(crs=crs, origin=earth.origin(attrs, name)).on_globe(poses.position[:, :2])
    return latitude, longitude
