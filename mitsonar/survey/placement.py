"""Tracks laid over a scene, and checked against its seabed."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.types import Real
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.tracer import registry_index
from mitsonar.sonar.motion.track import Track

SOUNDINGS = 96                     # soundings per side of the grid that finds the surveyed area
SMOOTHING = 10.0                   # [m] along which a towed sonar follows the seabed
ASIDE, ROUNDING = 1e-3, 1e-6       # [m] and share of the coordinate that a ray beside an edge of facets is moved by
FAR = 10_000.0                     # [m] from the scene at which a track belongs to another place


def soundings(geometry: Geometry, x: Real, y: Real) -> np.ndarray:
    """Return the depth [m] of the lowest surface at points (x, y) [m], NaN where there is none.

    The lowest surface is the seabed, except above buried objects. Rays go up from below the scene, so a ship does not
    count; the sea surface does not count either.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    below = geometry.depth_range[1] + 1.0
    return below - _distance(geometry, x, y, np.full(x.shape, -below), up=True)


def _distance(geometry: Geometry, x: np.ndarray, y: np.ndarray, z: np.ndarray, *, up: bool) -> np.ndarray:
    """Return the distance [m] to the first surface straight above or below points, NaN where there is none."""
    distance = _hit_distance(geometry, x, y, z, up)
    lost = np.isnan(distance)
    if lost.any():
        # a ray along the common edge of two triangles may slip between them, so it is sent again from beside
        x, y = (v[lost] + share * (ASIDE + ROUNDING * np.abs(v[lost])) for v, share in ((x, 1.0), (y, 0.6)))
        distance[lost] = _hit_distance(geometry, x, y, z[lost], up)
    return distance


def _hit_distance(geometry: Geometry, x: np.ndarray, y: np.ndarray, z: np.ndarray, up: bool) -> np.ndarray:
    point = (upload(mi.Float, np.ravel(v).astype(np.float32)) for v in (x, y, z))
    ray = mi.Ray3f(mi.Point3f(*point), mi.Vector3f(0, 0, 1 if up else -1))
    pi = geometry.still.ray_intersect_preliminary(ray, coherent=mi.Bool(True))
    hit = pi.is_valid()
    if up:
        hit &= dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), hit) != geometry.surface_label
    return np.where(hit.numpy(), pi.t.numpy(), np.nan).reshape(x.shape)


def _wet(geometry: Geometry, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return True for points (x, y) [m] with seabed under water."""
    return np.nan_to_num(soundings(geometry, x, y), nan=-1.0) > 0


def lines_up(geometry: Geometry, *, heading: float | None, altitude: float, pings: int, interval: float,
             speed: float) -> Track:
    """Return a straight track over the middle of the surveyed area, at a fixed altitude."""
    # heading [rad]; altitude [m]
    (x0, y0), (x1, y1) = geometry.horizontal_bounds
    x, y = np.meshgrid(*(a + (b - a) * (np.arange(SOUNDINGS) + 0.5) / SOUNDINGS for a, b in ((x0, x1), (y0, y1))))
    covered = _wet(geometry, x, y)
    if not covered.any():
        if np.any((depth := soundings(geometry, x, y)) < 0):
            raise ValueError(_dry(np.nanmin(depth)))
        raise ValueError("the scene has no seabed below z = 0 under a track; give the sensor a start or a track")
    points = np.stack([x[covered], y[covered]], -1)
    centre = points.mean(0)
    if heading is None:
        spread, axes = np.linalg.eigh(np.cov((points - centre).T) + 1e-9 * np.eye(2))
        along = axes[:, 1] if spread[1] > 1.1 * spread[0] else np.array([0.0, 1.0])
        along = along * (1 if along[1] >= 0 else -1)
        heading = float(np.arctan2(along[0], along[1]))
    course = np.array([np.sin(heading), np.cos(heading)])
    reach = np.hypot(x1 - x0, y1 - y0)
    place = np.arange(-reach, reach, max(reach / 4000, 0.05))
    over = _wet(geometry, *(centre + place[:, None] * course).T)
    runs = np.flatnonzero(np.diff(np.concatenate([[False], over, [False]]).astype(int))).reshape(-1, 2)
    if not len(runs):
        raise ValueError(f"no seabed lies on the line through the middle of the scene at heading "
                         f"{np.rad2deg(heading):.0f} degrees; choose another heading or give the sensor a start")
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    room = place[last - 1] - place[first]
    length = speed * interval * (pings - 1)
    if length > room:
        raise ValueError(f"track outside the bathymetry: {pings} pings cover {length:.1f} m, but the seabed reaches "
                         f"only {room:.1f} m at heading {np.rad2deg(heading):.0f} degrees; take fewer pings or a lower "
                         "speed")
    middle = 0.5 * (place[first] + place[last - 1])
    path = middle + speed * interval * (np.arange(pings) - 0.5 * (pings - 1))
    position = centre + path[:, None] * course
    z = _raised(-_smoothed(geometry, position, course), altitude)
    return Track(time=np.arange(pings) * interval, position=np.column_stack([position, z]), roll=0.0, pitch=0.0,
                 heading=heading)


def heights_over(geometry: Geometry, track: Track, altitude: float) -> np.ndarray:
    """Return the z (P,) [m] of a track at an altitude [m] above the seabed, smoothed along its headings."""
    course = np.stack([np.sin(track.heading), np.cos(track.heading)], -1)
    seabed = _smoothed(geometry, track.position[:, :2], course)
    if np.any(np.isnan(seabed)):
        ping = int(np.argmax(np.isnan(seabed)))
        raise ValueError(f"track outside the bathymetry: no seabed lies around ping {ping} at x = "
                         f"{track.position[ping, 0]:.1f} m, y = {track.position[ping, 1]:.1f} m, and the sonar is to "
                         "hold an altitude over it; move the track")
    return _raised(-seabed, altitude)


def _raised(z: np.ndarray, altitude: float) -> np.ndarray:
    """Return z [m] raised by an altitude, which must stay under water."""
    z = np.asarray(z, float)
    if np.any(z + altitude > 0):
        raise ValueError(f"altitude {altitude} m puts the sonar above the sea surface: the seabed is {-z.max():.1f} m "
                         "deep; lower the altitude")
    return z + altitude


def _smoothed(geometry: Geometry, position: np.ndarray, course: np.ndarray) -> np.ndarray:
    """Return the mean seabed depth within ± SMOOTHING along the course at positions (P, 2), NaN where none lies there.
    """
    offset = np.linspace(-SMOOTHING, SMOOTHING, 21)
    line = position[:, None] + offset[:, None] * np.broadcast_to(course, position.shape)[:, None]
    depth = soundings(geometry, line[..., 0], line[..., 1])
    bed = np.isfinite(depth)
    return np.where(bed.any(1), np.where(bed, depth, 0).sum(1) / np.maximum(bed.sum(1), 1), np.nan)


def check_near(geometry: Geometry, position: np.ndarray, crs: str) -> None:
    """Refuse georeferenced positions (P, 2) [m] none of which lies near the scene."""
    away = _away(geometry, position)
    nearest = int(np.argmin(away))
    if away[nearest] > FAR:
        x, y = position[nearest]
        raise ValueError(f"the track lies {away[nearest] / 1000:.0f} km away from the seabed, at x = {x:.0f} m, "
                         f"y = {y:.0f} m of it in {crs.splitlines()[0] if crs else 'its coordinates'}; check zone and "
                         "hemisphere, and that latitude and longitude are not swapped")


def check_local(geometry: Geometry, position: np.ndarray) -> None:
    """Refuse positions (P, 2) [m] in the scene's coordinates none of which lies near the scene, such as eastings."""
    away = _away(geometry, position)
    if away.min() <= FAR:
        return
    x, y = position[int(np.argmin(away))]
    origin = geometry.local_origin
    eastings = origin is not None and _away(geometry, position - origin[:2]).min() <= FAR
    remedy = ("they are eastings and northings of the bathymetry: write georeferenced true" if eastings else "if they "
              "are eastings and northings, write georeferenced true, over a bathymetry that has a geographic origin")
    raise ValueError(f"the track lies {away.min() / 1000:.0f} km away from the seabed, at x = {x:.0f} m, y = {y:.0f} m "
                     f"of the scene; {remedy}")


def _away(geometry: Geometry, position: np.ndarray) -> np.ndarray:
    """Return the horizontal distance [m] of positions (P, 2) from the scene's bounds."""
    low, high = (np.asarray(corner, float) for corner in geometry.horizontal_bounds)
    return np.hypot(*np.maximum(np.maximum(low - position, position - high), 0).T)


def check(geometry: Geometry, track: Track, first: int = 0, *, level: Real = 0.0) -> np.ndarray:
    """Return the depth of the seabed below the sonar at every ping [m], (P,); refuse a track that leaves the water.

    `first` is the number of the track's first ping, for messages; `level` [m] the height of the water level.
    """
    x, y, z = track.position.T
    level = np.broadcast_to(level, z.shape)
    if geometry.sea is not None:
        geometry.sea.check(track.position[:, :2], first)
        level = level + geometry.sea.waves.height(track.position[:, :2], track.time)
    if np.any(z > level):
        ping = int(np.argmax(z > level))
        raise ValueError(f"ping {first + ping}: the sonar is {z[ping] - level[ping]:.2f} m above the sea surface (z = "
                         f"{level[ping]:.3g}); z is negative under water")
    depth = soundings(geometry, x, y)
    if np.any(np.isnan(depth)):
        ping = int(np.argmax(np.isnan(depth)))
        (x0, y0), (x1, y1) = geometry.horizontal_bounds
        raise ValueError(f"track outside the bathymetry: ping {first + ping} is at x = {x[ping]:.1f} m, "
                         f"y = {y[ping]:.1f} m, where no seabed lies below (the scene spans x {x0:.1f}..{x1:.1f}, "
                         f"y {y0:.1f}..{y1:.1f} m); move the track or crop it")
    below = _distance(geometry, x, y, z, up=False)
    if np.any(np.isnan(below)):
        ping = int(np.argmax(np.isnan(below)))
        if depth[ping] < 0:
            raise ValueError(f"at ping {first + ping} {_dry(depth[ping])}")
        raise ValueError(f"sonar below the seabed: at ping {first + ping} it is {-z[ping]:.2f} m deep, the seabed "
                         f"{depth[ping]:.2f} m; raise the track or the altitude")
    return below


def _dry(depth: float) -> str:
    """Return the error message about a seabed that rises above the sea surface."""
    return (f"the seabed is {-depth:.2f} m above the sea surface; depths are positive down: write the bed's depth as a "
            "number above 0, or move the bathymetry below z = 0")
