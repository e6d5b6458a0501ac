"""Points under the seabed, found by vertical rays that pass through everything else."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload

from ..geometry import Geometry
from ..labels import SEABED
from ..tracing.tracer import registry_index

SURFACES = 4                       # at most, over the bed or between it and what is under it
ROUNDING = 2e-6                    # relative error of a height from a hit
BEYOND = 1e-4                      # [m] behind a hit, where the next ray begins


def bed_height(geometry: Geometry, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the heights of the bed at places (N,) [m], under anything that lies over it; NaN where there is no bed."""
    start, found = np.full(len(x), float(-geometry.depth_range[0]) + 1.0), np.full(len(x), np.nan)
    if not len(x):                 # a launch without rays ends the process
        return found
    for _ in range(SURFACES):
        point = mi.Point3f(*(upload(mi.Float, column.astype(np.float32)) for column in (x, y, start)))
        pi = geometry.still.ray_intersect_preliminary(mi.Ray3f(point, mi.Vector3f(0, 0, -1)), coherent=mi.Bool(False))
        kind = dr.gather(mi.UInt32, geometry.kinds, registry_index(pi), pi.is_valid())
        distance, met = pi.t.numpy().astype(float), pi.is_valid().numpy()
        height = start - distance
        bed = met & (kind.numpy() == SEABED) & np.isnan(found)
        found[bed] = height[bed]
        more = met & np.isnan(found)
        if not more.any():
            break
        start = np.where(more, height - ROUNDING * np.abs(height) - BEYOND, start)
    return found


def covered(geometry: Geometry, point: mi.Point3f, active: mi.Bool) -> mi.Bool:
    """Return True for points (R,) that the bed lies over."""
    up, start, found = mi.Vector3f(0, 0, dr.opaque(mi.Float, 1.0)), mi.Point3f(point), mi.Bool(False)
    for _ in range(2):
        pi = geometry.still.ray_intersect_preliminary(mi.Ray3f(start, up), coherent=mi.Bool(False), active=active)
        active = active & pi.is_valid()
        bed = active & (dr.gather(mi.UInt32, geometry.kinds, registry_index(pi), active) == SEABED)
        found, active = found | bed, active & ~bed
        start = mi.Point3f(start.x, start.y, start.z + dr.select(active, pi.t, 0) + BEYOND)
    return found
