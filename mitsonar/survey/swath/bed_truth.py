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

__all__ = ["BedPoints", "bed_at"]

ASIDE = 1e-3                       # [m] beside an edge of facets, where a ray that slips between them is sent again


@dataclass(frozen=True, kw_only=True, eq=False)
class BedPoints:
    """What lies below places, (N,) each.

    Attributes
    ----------
    depth : [m]
        NaN where nothing does.
    label : uint32
        Of the instance; 0 where nothing does.
    strength : [-]
        By the material's law, for sound that comes from where it was sent; NaN where nothing lies, or nobody asks.
    """

    depth: np.ndarray
    label: np.ndarray
    strength: np.ndarray


def bed_at(geometry: Geometry, x: np.ndarray, y: np.ndarray, *, above: float, arrival: np.ndarray,
           sound_speed: float, frequency: float | None) -> BedPoints:
    """Look down at places.

    Parameters
    ----------
    geometry : Geometry
    x, y : (N,) [m]
    above : float [m]
        Depth that is looked from: what floats above it does not count.
    arrival : (N, 3)
        Unit vectors along the travel of sound there, scene.
    sound_speed : float [m/s]
        At the bed.
    frequency : float or None [Hz]
        That strengths are asked for.
    """
    found = _looked(geometry, x, y, above, arrival, sound_speed, frequency)
    lost = np.flatnonzero(np.isnan(found.depth) & np.isfinite(x))
    if lost.size:
        again = _looked(geometry, x[lost] + ASIDE, y[lost] + 0.6 * ASIDE, above, arrival[lost], sound_speed, frequency)
        for name in ("depth", "label", "strength"):
            getattr(found, name)[lost] = getattr(again, name)
    return found


def _looked(geometry: Geometry, x: np.ndarray, y: np.ndarray, above: float, arrival: np.ndarray, sound_speed: float,
            frequency: float | None) -> BedPoints:
    place = [upload(mi.Float, np.nan_to_num(v).astype(np.float32)) for v in (x, y)]
    ray = mi.Ray3f(mi.Point3f(*place, dr.opaque(mi.Float, -float(above))), mi.Vector3f(0, 0, -1))
    si = geometry.scene.ray_intersect(ray)
    valid = si.is_valid()
    pi = geometry.scene.ray_intersect_preliminary(ray)
    label = dr.gather(mi.UInt32, geometry.rows, 4 * registry_index(pi), valid)
    there = valid.numpy() & np.isfinite(x)
    strength = np.full(len(x), np.nan)
    if frequency is not None:
        strength = np.where(there, _strength(si, arrival, sound_speed, frequency), np.nan)
    return BedPoints(depth=np.where(there, above + si.t.numpy(), np.nan),
                     label=np.where(there, label.numpy(), 0).astype(np.uint32), strength=strength)


def _strength(si: mi.SurfaceInteraction3f, arrival: np.ndarray, sound_speed: float, frequency: float) -> np.ndarray:
    """By the materials' laws, (N,)."""
    lib, valid = arrays_of(mi.Float), si.is_valid()
    towards = mi.Vector3f(*(upload(mi.Float, np.nan_to_num(part).astype(np.float32)) for part in arrival.T))
    hits = Hits.on_surface(valid=valid, point=lib.Array3f64(si.p), normal=si.n, arrival_direction=towards,
                           sound_speed=dr.opaque(mi.Float64, sound_speed), shape=si.shape, primitive=si.prim_index,
                           uv=si.uv)
    strength, _ = scattering_strength(hits, valid, frequency)
    return strength.numpy()
