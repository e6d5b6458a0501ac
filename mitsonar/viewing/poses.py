"""The sonar of a record in space: its track, where it is at a time, and the way its beams look."""
from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from mitsonar.io.bags import axes
from mitsonar.io.bags.beams import beams_of
from mitsonar.io.bags.poses import poses_of

from .view_log import ViewLog

SHOWN_BEAMS = 33                   # most beams that are drawn
TRACK, SONAR, BEAM = (255, 190, 60), (255, 255, 255), (90, 220, 255, 120)
MOST_POSES = 4000                  # of motion sensors, which have far more of them than pings
BODY = 1.0                         # [m]: length of the axes of the body


def log_poses(log: ViewLog, name: str, record: xr.Dataset) -> None:
    """Log the track of a record, and its sonar and beams at every ping; nothing of a record without poses."""
    rr, poses = log.rr, poses_of(record, 0.0)
    if poses is None or "ping" not in record.dims:
        return
    log.place(f"{name}/track", rr.LineStrips3D([poses.position], colors=[TRACK], radii=rr.Radius.ui_points(1.5)),
              still=True)
    beams = beams_of(record)
    far = float(record["range"].values[-1]) if "range" in record.coords else None
    turn = Rotation.from_quat(axes.quaternions(poses.attitude)).as_matrix() * axes.FLIP    # from the body to the scene
    quaternion = axes.quaternions(poses.attitude)
    log.place(f"{name}/sonar", rr.TransformAxes3D(BODY), still=True)
    for ping in range(0, poses.time.size, poses.time.size // MOST_POSES + 1):
        if poses.by_sensors:
            log.at_time(float(poses.time[ping]))
        else:
            log.at(ping, float(poses.time[ping]))
        log.place(f"{name}/sonar", rr.Transform3D(translation=poses.position[ping], quaternion=quaternion[ping]))
        if far is None or poses.by_sensors:
            continue
        direction = beams.directions(record.isel(ping=slice(ping, ping + 1)))
        direction = direction[np.unique(np.linspace(0, len(direction) - 1, SHOWN_BEAMS).round().astype(int))]
        log.place(f"{name}/beams", rr.LineStrips3D(
            [np.stack([poses.position[ping], poses.position[ping] + far * turn[ping] @ one]) for one in direction],
            colors=[BEAM], radii=rr.Radius.ui_points(0.6)))
