"""The bed that soundings should find: what lies at x, y, whose it is, and how strongly it scatters there."""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of, upload
from ...scene.geometry import Geometry
from ...scene.materials import scattering_strength
from ...tracing.hits import Hits
from ...tracing.tracer import registry_index

__all__ = ["BedPoints", "bed_at", "bed_depth"]

ASIDE = 1e-3                       # [m] beside an edge of facets, where a ray that slips between them is sent again


@dataclass(frozen=True, kw_only=True, eq=False)
class BedPoints:
    """What lies below places, (N,) each.

    Attributes
    ----------
    label : uint32
        Of the instance; 0 where nothing lies.
    strength : [-]
        By the material's law, for sound that comes from where it was sent; NaN where nothing lies.
    """

    label: np.ndarray
    strength: np.ndarray


def bed_depth(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float) -> np.ndarray:
    """Give the depth of what lies below places, (N,) [m]; NaN where nothing does.

    Parameters
    ----------
    geometry : Geometry
    x, y : (N,) [m]
    above : float [m]
        Depth that is looked from: what floats above it does not count.
    """
    depth = np.full(len(x), np.nan)
    for aside in (0.0, ASIDE):
        lost = np.flatnonzero(np.isnan(depth) & np.isfinite(x))
        if lost.size:
            si = geometry.scene.ray_intersect(_down(x[lost] + aside, y[lost] + 0.6 * aside, above))
            depth[lost] = np.where(si.is_valid().numpy(), above + si.t.numpy(), np.nan)
    return depth


def bed_at(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float, arrival: np.ndarray,
           sound_speed: float, frequency: float) -> BedPoints:
    """Give what lies below places.

    Parameters
    ----------
    geometry, x, y, above
        As of `bed_depth`.
    arrival : (N, 3)
        Unit vectors along the travel of sound there, scene.
    sound_speed : float [m/s]
        At the bed.
    frequency : float [Hz]
    """
    ray = _down(x, y, above)
    si, pi = geometry.scene.ray_intersect(ray), geometry.scene.ray_intersect_preliminary(ray)
    valid = si.is_valid()
    towards = mi.Vector3f(*(upload(mi.Float, np.nan_to_num(part).astype(np.float32)) for part in arrival.T))
    hits = Hits.on_surface(valid=valid, point=arrays_of(mi.Float).Array3f64(si.p), normal=mi.Vector3f(si.n),
                           arrival_direction=towards, sound_speed=dr.opaque(mi.Float64, sound_speed), shape=si.shape,
                           primitive=si.prim_index, uv=si.uv)
    strength, _ = scattering_strength(hits, valid, frequency)
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), valid)
    there = valid.numpy() & np.isfinite(x)
    return BedPoints(label=np.where(there, label.numpy(), 0).astype(np.uint32),
                     strength=np.where(there, strength.numpy(), np.nan))


def _down(x: np.ndarray, y: np.ndarray, above: float) -> mi.Ray3f:
    """Rays straight down."""
    place = (upload(mi.Float, np.nan_to_num(v).astype(np.float32)) for v in (x, y))
    return mi.Ray3f(mi.Point3f(*place, dr.opaque(mi.Float, -float(above))), mi.Vector3f(0, 0, -1))
