"""A scene before it is rendered, in space: bed, objects, track, rays of a ping, and what of the bed every ping sees.

All of it is that of `mitsonar.show` (`verbs.overview`), with which it shares its limits.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import colormaps
from scipy.interpolate import RegularGridInterpolator

from mitsonar.io.bags import axes
from mitsonar.plots.images.truth import class_colours
from mitsonar.scene.labels import class_name
from mitsonar.verbs.overview import SEEN, SHADOW, Overview, overview

from .poses import BODY, TRACK
from .view_log import ViewLog

RAY, SWATH, HIDDEN = (255, 255, 255, 90), (90, 220, 255), (40, 80, 200)
LIFT = 0.05                        # [m] by which points of the bed stand above it
RADIUS = 2.0                       # [pixels] of a point


def log_scene(log: ViewLog, name: str, scene: Any, sensor: int | str, parameters: Mapping[str, object]) -> None:
    """Log a scene given by path, by name or as loaded."""
    plan = overview(scene, sensor, None, parameters)
    rr = log.rr
    _log_bed(log, name, plan)
    colours = class_colours(class_name(one.name) for one in plan.objects)
    for one in plan.objects:
        colour, place = colours[class_name(one.name)], f"{name}/objects/{one.name}"
        low, high = one.points.min(0), one.points.max(0)
        log.place(f"{place}/points", rr.Points3D(one.points, colors=[colour], radii=rr.Radius.ui_points(RADIUS)),
                  still=True)
        log.place(f"{place}/box", rr.Boxes3D(mins=[low], sizes=[high - low], labels=[one.name], colors=[colour],
                                             show_labels=True, radii=rr.Radius.ui_points(0.7)), still=True)
        if one.path is not None:
            log.place(f"{place}/path", rr.LineStrips3D([one.path], colors=[colour]), still=True)
    _log_rays(log, name, plan)
    _log_pings(log, name, plan)


def _log_bed(log: ViewLog, name: str, plan: Overview) -> None:
    """Log the bed as a mesh whose colours are its depths."""
    rows, columns = plan.depth.shape
    there = np.isfinite(plan.depth)
    if rows < 2 or columns < 2 or not there.any():
        return
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    whole = there.ravel()[np.stack([a, b, c, d])].all(0)
    faces = np.concatenate([np.stack([a, b, c], -1)[whole], np.stack([a, c, d], -1)[whole]])
    low, high = float(np.nanmin(plan.depth)), float(np.nanmax(plan.depth))
    shade = np.nan_to_num((plan.depth - low) / max(high - low, 1e-3))
    x, y = np.meshgrid(plan.x, plan.y)
    # shaded as if the light came from above, so that slopes show
    slope = np.hypot(*np.gradient(np.nan_to_num(plan.depth, nan=low), plan.y, plan.x))
    colours = colormaps["viridis_r"](shade)[..., :3] / np.sqrt(1 + slope ** 2)[..., None]
    log.place(f"{name}/bed", log.rr.Mesh3D(
        vertex_positions=np.stack([x, y, -np.nan_to_num(plan.depth)], -1).reshape(-1, 3), triangle_indices=faces,
        vertex_colors=(255 * colours).astype(np.uint8).reshape(-1, 3)), still=True)


def _log_rays(log: ViewLog, name: str, plan: Overview) -> None:
    """Log the rays of the section's ping, bent by its water."""
    section = plan.section
    place = plan.track.position[section.ping]
    strips = [np.column_stack([place[:2] + ray[:, :1] * section.direction, -ray[:, 1]]) for ray in section.rays]
    if strips:
        log.place(f"{name}/rays_of_ping_{section.ping}", log.rr.LineStrips3D(
            strips, colors=[RAY], radii=log.rr.Radius.ui_points(0.8)), still=True)


def _log_pings(log: ViewLog, name: str, plan: Overview) -> None:
    """Log the track, the sonar at every ping, and the bed that it sees at some."""
    rr, track = log.rr, plan.track
    log.place(f"{name}/track", rr.LineStrips3D([track.position], colors=[TRACK], radii=rr.Radius.ui_points(1.5)),
              still=True)
    log.place(f"{name}/sonar", rr.TransformAxes3D(BODY), still=True)
    attitude = np.stack([track.roll, track.pitch, track.heading], -1)
    quaternion = axes.quaternions(attitude)
    for ping, time in enumerate(track.time):
        log.at(ping, float(time))
        log.place(f"{name}/sonar", rr.Transform3D(translation=track.position[ping], quaternion=quaternion[ping]))
    height = RegularGridInterpolator((plan.y, plan.x), -plan.depth, bounds_error=False) if min(
        plan.depth.shape) > 1 else None
    everything = []
    for number, ping in enumerate(plan.pings):
        place, state = plan.place[number].reshape(-1, 2), plan.state[number].ravel()
        z = height(place[:, ::-1]) if height is not None else np.full(len(place), -float(np.nanmean(plan.depth)))
        points = np.column_stack([place, z + LIFT])
        known = np.isfinite(z)
        log.at(int(ping), float(track.time[ping]))
        for part, wanted, colour in (("seen", SEEN, SWATH), ("shadow", SHADOW, HIDDEN)):
            log.place(f"{name}/{part}", rr.Points3D(points[known & (state == wanted)], colors=[colour],
                                                    radii=rr.Radius.ui_points(RADIUS)))
        everything.append(points[known & (state == SEEN)])
    log.place(f"{name}/seen_by_all", rr.Points3D(np.concatenate(everything), colors=[SWATH],
                                                 radii=rr.Radius.ui_points(0.5 * RADIUS)), still=True, shown=False)
