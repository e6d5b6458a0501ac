"""Launch directions of an array's rays, drawn where time and beams need them, each with its solid angle.

A share of the rays is spread evenly over directions. The others are spread evenly over the time at which a flat bed,
and a surface if there is one, send echoes back. All rays follow the beams. A ray's weight is the reciprocal of the
density it was drawn with (`launch`), so no choice of density can bias a level.
"""
from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.chance import pair, stratified, uniform
from mitsonar.water.profile import SoundSpeedProfile

from .launch import Strata, draw, quantiles

AZIMUTHS, ELEVATIONS = 256, 512    # cells of the density that rays are drawn from
EVEN_SHARE = 0.2                   # of the rays, which is spread evenly over directions
FAINTEST = 1e-3                    # least beam intensity that directions count with, relative to the strongest


class DrawnRays:
    """Random launch directions of rays whose echoes come back within a window of time [s]."""

    def __init__(self, profile: SoundSpeedProfile, *, window: tuple[float, float], rays: int,
                 pattern: Callable | None, surface: bool):
        self.speed, self.window, self.rays = float(np.mean(profile.sound_speed)), window, rays
        self.pattern, self.surface = pattern, surface

    def draw(self, origin: dr.ArrayBase, rotation: np.ndarray, depth_below: float | None,    # [m]
             key: int) -> tuple[mi.Vector3f, mi.Float, Strata]:
        """Draw the rays of a source; return directions (R,), solid angles (R,) [sr] and strata."""
        azimuth, across, level, towards = _cells()
        beam = np.ones(level.shape) if self.pattern is None else self.pattern(towards, rotation)
        beam = np.maximum(beam / max(beam.max(), 1e-30), FAINTEST)      # beams of other directions leave nothing
        everywhere = level * beam
        density = everywhere / everywhere.sum()
        if depth_below is not None:
            above = abs(float(np.ravel(origin.z.numpy())[0])) if self.surface else None
            even = np.abs(np.diff(self._times(across, depth_below, above)))[None] * np.sqrt(beam)
            density = (1 - EVEN_SHARE) * even / max(even.sum(), 1e-30) + EVEN_SHARE * density
        rows = density.sum(1)
        first = quantiles(azimuth, rows[None] / np.diff(azimuth), AZIMUTHS)
        second = quantiles(across, density / np.diff(across), ELEVATIONS)
        return _rays(self.rays, first, second, azimuth, key)

    def _times(self, across, below, above):
        """Return the two-way times, within the window, at which rays of these depressions meet level planes."""
        with np.errstate(divide="ignore"):
            time = np.where(across > 0, 2 * abs(below) / (self.speed * np.sin(across)), np.inf)
            if above is not None:
                time = np.where(across < 0, -2 * above / (self.speed * np.sin(across)), time)
        return np.clip(time, *self.window)


@lru_cache(maxsize=1)
def _cells():
    """Return edges of azimuth (A + 1,) and elevation (E + 1,), and cosines (A, E) and directions (A, E, 3) of cells."""
    azimuth, across = np.linspace(-np.pi, np.pi, AZIMUTHS + 1), np.linspace(-np.pi / 2, np.pi / 2, ELEVATIONS + 1)
    a, e = (0.5 * (edges[1:] + edges[:-1]) for edges in (azimuth, across))
    a, e = np.meshgrid(a, e, indexing="ij")
    level = np.cos(e)
    return azimuth, across, level, np.stack([np.sin(a) * level, np.cos(a) * level, -np.sin(e)], -1)


def _rays(rays, first, second, azimuth, key):
    """Draw stratified directions through the quantile tables of azimuth, and of elevation in each cell of azimuth."""
    steps = max(4, 4 * round(np.sqrt(rays / 4) / 2))
    rows = max(4, 4 * round(rays / (4 * steps)))
    lib = arrays_of(mi.Float)
    strata = Strata(lib, 1, steps, rows)
    index = dr.arange(mi.UInt32, strata.rays)
    _, _, i, j = strata.split(index)
    x, y = pair(index, dr.opaque(mi.UInt32, key))
    x = stratified(lib, i, uniform(lib, x), strata.first)
    y = stratified(lib, j, uniform(lib, y), strata.second)
    a, width_a, _ = draw(upload(mi.Float, first.astype(np.float32)), mi.UInt32(0), x, AZIMUTHS)
    cell = dr.clip((a - float(azimuth[0])) * (AZIMUTHS / (2 * np.pi)), 0, AZIMUTHS - 1)
    e, width_e, _ = draw(upload(mi.Float, second.astype(np.float32)), mi.UInt32(cell), y, ELEVATIONS)
    sine, cosine = dr.sincos(e)
    sine_a, cosine_a = dr.sincos(a)
    direction = mi.Vector3f(sine_a * cosine, cosine_a * cosine, -sine)
    return direction, cosine * width_a * width_e / dr.opaque(mi.Float, steps * rows), strata
