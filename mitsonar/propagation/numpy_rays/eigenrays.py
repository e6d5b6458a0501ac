"""Eigenrays: the exact rays between two points in water whose sound speed depends on depth alone.

A direct ray between depths with the fastest speed c_m between them is found by the tangent q = tan(angle from the
vertical) it has there,

    p = sin(arctan q) / c_m,    X(q) rising and concave,    q <- q + (X - X(q)) / (dX/dq)

so Newton's method converges from any start to its left. Rays that turn are found in `turned`. Of every ray:

    area per steradian   A = X |dX/d(launch)| |sin(arrival)| / cos(launch) = (X / p) |dX/dp| |s_0 s_1| / c_0^2

X -> ``horizontal_range`` [m], p -> ``ray_parameter`` = cos(angle) / c [s/m], s_0 and s_1 the sines at source and
target. Depths and angles are positive down.
"""
from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.water.profile import SoundSpeedProfile

from .layers import Layers
from .turned import BATCH, CONVERGED, ROUNDING, TINY_SINE, rays_turned_below

NEWTON_STEPS = 64
SAME_TIME, SAME_ANGLE = 1e-13, 1e-9  # relative, [rad]: closer arrivals are duplicates of one ray


@dataclass(frozen=True, kw_only=True)
class Eigenray:
    """Eigenrays; all fields have one shape and are NaN where there is no ray.

    Parameters
    ----------
    travel_time : array [s]
    arc_length : array [m]
    launch_angle : array [rad]
        At the source, from the horizontal, positive down.
    arrival_angle : array [rad]
        Direction of travel at the target, positive down.
    spreading_area : array [m^2/sr]
        Cross-section of the ray tube at the target per steradian at the source; infinite for a ray that grazes a
        faster layer, zero at a caustic.
    ray_parameter : array [s/m]
        Cosine of the angle over sound speed, the same all along the ray.
    turning_depth : array [m]
        Where the ray is horizontal; NaN for a direct ray.
    """

    travel_time: np.ndarray
    arc_length: np.ndarray
    launch_angle: np.ndarray
    arrival_angle: np.ndarray
    spreading_area: np.ndarray
    ray_parameter: np.ndarray
    turning_depth: np.ndarray

    @property
    def exists(self) -> np.ndarray:
        """Return True where there is a ray."""
        return np.isfinite(self.travel_time)


FIELDS = tuple(field.name for field in fields(Eigenray))
LAUNCH = FIELDS.index("launch_angle")
# What mirroring the depth axis does to each field.
DOWN_IS_UP = np.array([-1 if name in ("launch_angle", "arrival_angle", "turning_depth") else 1 for name in FIELDS])


def eigenray(profile: SoundSpeedProfile, source_depth: ArrayLike, target_depth: ArrayLike,
             horizontal_range: ArrayLike) -> Eigenray:
    """Find the earliest arrival between two points, direct or turned once.

    Parameters
    ----------
    profile : SoundSpeedProfile
    source_depth, target_depth : array [m]
        Positive down; beyond the profile's ends the water is uniform. Surface and seabed are ignored.
    horizontal_range : array [m]
        Not negative. All three broadcast.

    Returns
    -------
    Eigenray
        Fields of the broadcast shape, NaN in a shadow zone. At zero distance all but the ray parameter is zero; of
        two points at one depth in uniform water the ray is the straight line.

    Raises
    ------
    ValueError
        If an argument is not finite, a range is negative or the shapes do not broadcast.

    Notes
    -----
    Time is stationary about the ray, so it carries rounding error alone (about 1e-15 relative).
    """
    shape, case, rays = _find(profile, source_depth, target_depth, horizontal_range, earliest_only=True)
    first = np.flatnonzero(np.diff(case, prepend=-1))
    return _fill(shape, (case[first],), rays[:, first])


def eigenrays(profile: SoundSpeedProfile, source_depth: ArrayLike, target_depth: ArrayLike,
              horizontal_range: ArrayLike) -> Eigenray:
    """List every direct and once-turned arrival between two points, turned above or below both, earliest first.

    Arguments, errors and conventions as `eigenray`.

    Returns
    -------
    Eigenray
        Fields of the broadcast shape and one more dimension, ``arrival``, at least one long and padded with NaN;
        ``exists.sum(-1)`` counts the arrivals.

    Notes
    -----
    No arrival is left out, however sharp the profile: see `turned` for why. Two closer than 1e-9 rad count as one.
    """
    shape, case, rays = _find(profile, source_depth, target_depth, horizontal_range, earliest_only=False)
    position = np.arange(case.size) - np.searchsorted(case, case)
    return _fill((*shape, 1 + position.max(initial=0)), (case, position), rays)


def _fill(shape: tuple[int, ...], where: tuple[np.ndarray, ...], rays: np.ndarray) -> Eigenray:
    """Put rays (field, R) at their places in arrays of NaN."""
    cases = shape[:-1] if len(where) == 2 else shape
    table = np.full((len(rays), int(np.prod(cases)), *shape[len(cases):]), np.nan)
    table[(slice(None), *where)] = rays
    return Eigenray(**{name: field.reshape(shape)[()] for name, field in zip(FIELDS, table)})


def _find(profile: SoundSpeedProfile, source_depth: ArrayLike, target_depth: ArrayLike, horizontal_range: ArrayLike,
          earliest_only: bool) -> tuple[tuple[int, ...], np.ndarray, np.ndarray]:
    """Return the shape of the cases, and of all rays the case (R,) and the fields (field, R), by case and time."""
    source, target, horizontal_range = _checked(source_depth, target_depth, horizontal_range)
    shape = source.shape
    source, target, horizontal_range = source.ravel(), target.ravel(), horizontal_range.ravel()
    mirrored = profile.upside_down()
    size = max(1, BATCH // (profile.depth.size + 1))
    cases, rays = [np.empty(0, int)], [np.empty((len(FIELDS), 0))]
    for start in range(0, source.size, size):
        points = source[start:start + size], target[start:start + size], horizontal_range[start:start + size]
        found = [_direct(profile, *points), _level(profile, *points)]
        latest = np.full(points[0].size, np.inf)
        if earliest_only:
            for case, fields in found:
                latest[case] = fields[0]
        found.append(_turned(profile, *points, latest))
        case, fields = _turned(mirrored, -points[0], -points[1], points[2], latest)
        found.append((case, fields * DOWN_IS_UP[:, None]))
        case, fields = (np.concatenate(part, axis=-1) for part in zip(*found))
        case, fields = _sorted(case, fields)
        cases.append(case + start)
        rays.append(fields)
    return shape, np.concatenate(cases), np.concatenate(rays, axis=1)


def _checked(*arguments: ArrayLike) -> tuple[np.ndarray, ...]:
    names = "source_depth", "target_depth", "horizontal_range"
    arrays = [np.asarray(value, float) for value in arguments]
    try:
        arrays = np.broadcast_arrays(*arrays)
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in zip(names, arrays))
        raise ValueError(f"eigenray: the shapes {shapes} do not broadcast together.") from None
    for name, array in zip(names, arrays):
        if not np.isfinite(array).all():
            raise ValueError(f"eigenray: {name} holds {array[~np.isfinite(array)].flat[0]}; it must be finite.")
    if (arrays[2] < 0).any():
        raise ValueError(f"eigenray: horizontal_range holds {arrays[2].min():g} m; it must not be negative.")
    return arrays


def _sorted(case: np.ndarray, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Order rays by case and time, leaving out those found twice at a junction of two searches."""
    order = np.lexsort((fields[0], case))
    case, fields = case[order], fields[:, order]
    time, launch = fields[0], fields[LAUNCH]
    again = ((np.diff(case, prepend=-1) == 0) & (np.diff(time, prepend=-1) <= SAME_TIME * time)
             & (np.abs(np.diff(launch, prepend=-9)) <= SAME_ANGLE))
    return case[~again], fields[:, ~again]


def _direct(profile: SoundSpeedProfile, source: np.ndarray, target: np.ndarray,
            horizontal_range: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the rays that only rise or only sink between different depths; return their cases and fields."""
    case = np.flatnonzero(source != target)
    if not case.size:
        return case, np.empty((len(FIELDS), 0))
    upper, lower = np.minimum(source, target)[case], np.maximum(source, target)[case]
    layers, wanted = Layers.between(profile, upper, lower), horizontal_range[case]
    farthest = layers.reach(np.full(case.size, TINY_SINE), np.ones(case.size))[0] / layers.fastest
    reached = wanted <= farthest * (1 + SAME_TIME)
    case, layers, wanted = case[reached], layers[reached], wanted[reached]
    tangent = _newton(layers, wanted)
    sine, cosine = _sine_cosine(tangent)
    passed = layers.cross(sine, cosine)
    parameter = cosine / layers.fastest
    down = np.where(target[case] > source[case], 1, -1)
    upper_sine, lower_sine = passed.sines.T
    # Fermat: the time to the range asked for follows from the time to the range found to second order.
    time = passed.travel_time + parameter * (wanted - parameter * passed.range_per_parameter)
    return case, _fields(
        profile, source[case], target[case], time, passed.arc_length, parameter, passed.range_per_parameter,
        passed.range_slope, down * np.where(down > 0, upper_sine, lower_sine),
        down * np.where(down > 0, lower_sine, upper_sine), np.full(case.size, np.nan))


def _newton(layers: Layers, horizontal_range: np.ndarray) -> np.ndarray:
    """Return the tangent q at the fastest depth of the direct rays that reach ``horizontal_range`` (N,)."""
    thickness, upper, lower = layers.thickness, layers.speed[:, :-1], layers.speed[:, 1:]
    # The first tangent of straight rays never overshoots: X(q) is concave.
    safe = horizontal_range * layers.fastest / (thickness * (upper + lower) / 2).sum(axis=1)
    # The ray of uniform water with the same mean square slowness is closer, where it stays clear of the horizontal.
    square_slowness = (thickness / (upper * lower)).sum(axis=1)
    height = thickness.sum(axis=1)
    squared = square_slowness / height * (layers.fastest * horizontal_range / np.hypot(horizontal_range, height)) ** 2
    tangent = np.maximum(safe, np.sqrt(squared / np.maximum(1 - squared, 1e-4)) * (squared < 1 - 1e-4))
    rays = np.arange(tangent.size)
    for _ in range(NEWTON_STEPS):
        some = layers[rays]
        sine, cosine = _sine_cosine(tangent[rays])
        per_parameter, slope = some.reach(sine, cosine)
        short = horizontal_range[rays] - cosine / some.fastest * per_parameter
        step = short * some.fastest / (slope * sine**3)
        tangent[rays] = np.maximum(tangent[rays] + step, safe[rays])
        done = (np.abs(short) <= ROUNDING * horizontal_range[rays]) | (np.abs(step) <= CONVERGED * tangent[rays])
        rays = rays[~done]
        if not rays.size:
            break
    return tangent


def _sine_cosine(tangent: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sine and cosine of the grazing angle whose cotangent is ``tangent``."""
    sine = 1 / np.hypot(1, tangent)
    return sine, tangent * sine


def _level(profile: SoundSpeedProfile, source: np.ndarray, target: np.ndarray,
           horizontal_range: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the straight rays between equal depths: in uniform water, or of no length."""
    uniform = (profile.gradient(source, "above") == 0) | (profile.gradient(source, "below") == 0)
    case = np.flatnonzero((source == target) & (uniform | (horizontal_range == 0)))
    wanted, speed, nothing = horizontal_range[case], profile.at(source[case]), np.zeros(case.size)
    return case, np.array([wanted / speed, wanted, nothing, nothing, wanted**2, 1 / speed, nothing + np.nan])


def _turned(profile: SoundSpeedProfile, source: np.ndarray, target: np.ndarray, horizontal_range: np.ndarray,
            latest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the rays that turn below both ends; return their cases and fields."""
    upper, lower = np.minimum(source, target), np.maximum(source, target)
    rays = rays_turned_below(profile, upper, lower, horizontal_range, latest)
    case = rays.case
    downwards = source[case] <= target[case]
    return case, _fields(
        profile, source[case], target[case], rays.travel_time, rays.arc_length, rays.ray_parameter,
        horizontal_range[case] / rays.ray_parameter, rays.range_slope,
        np.where(downwards, rays.upper_sine, rays.lower_sine), -np.where(downwards, rays.lower_sine, rays.upper_sine),
        rays.turning_depth)


def _fields(profile: SoundSpeedProfile, source: np.ndarray, target: np.ndarray, time: np.ndarray, length: np.ndarray,
            parameter: np.ndarray, per_parameter: np.ndarray, slope: np.ndarray, source_sine: np.ndarray,
            target_sine: np.ndarray, turning: np.ndarray) -> np.ndarray:
    source_speed = profile.at(source)
    launch = np.arctan2(source_sine, parameter * source_speed)
    arrival = np.arctan2(target_sine, parameter * profile.at(target))
    area = per_parameter * np.abs(slope * source_sine * target_sine) / source_speed**2
    return np.array([time, length, launch, arrival, area, parameter, turning])
