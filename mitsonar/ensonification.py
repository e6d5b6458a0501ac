"""Which scatterers a ping lights, and how strongly: two ways, one answer.

    scatterers    every cell within reach is connected to the sonar along its own bent ray, and counts if the way is
                  free: |e|² = σ dA (c_h / c_0)² 10^(-2 ᾱ L / 10) / A²
    rays          rays find cells, the energies of the rays in a cell add:
                  |e|² = Σ_k ΔΩ_k (σ / sin θ_i) (c_h / c_0)² 10^(-2 ᾱ L / 10) / A

e = g |e| is the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements; symbols
as in `signal.echoes`, g the cell's Gaussian (`scattering.cells`). With enough rays both are the same; the first has
no noise of sampling and costs what lies within reach, the second costs what is sent.
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from .connection import Connector
from .echoes import Echoes, Leg
from .free_rays import FreeRays
from .materials import scattering_strength
from .propagation.device import arrays_of, upload
from .scatterers import TARGET_RADIUS
from .signal.echoes import Absorption
from .smooth_targets import SmoothTargets
from .sonar.launch import Strata, draw, quantiles
from .trace import Tracer

__all__ = ["LIGHTING", "Ensonification"]

LIGHTING = ("scatterers", "rays")
CELLS_PER_BLOCK = 1 << 19
MOST_CELLS = 10 ** 9               # of a ping: minutes of connecting
AZIMUTHS, ELEVATIONS = 256, 512    # cells of the density that rays are drawn from
EVEN_SHARE = 0.2                   # of the rays that are spread evenly over directions
NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a cell is not looked at
FAINTEST = 1e-3                    # beam intensity that directions count with at least, relative to the strongest


class Ensonification:
    """Light the scatterers of a scene from anywhere in its water.

    Parameters
    ----------
    scatterers : Scatterers
    profile : SoundSpeedProfile
    absorption : AbsorptionColumn
    frequency : float [Hz]
    window : (float, float) [s]
        Two-way times that matter.
    margin : float [m]
        How far the elements lie, and move, from the sources.
    lighting : str
        One of LIGHTING.
    rays : int
        Per source, for "rays".
    pattern : callable(direction, rotation (3, 3)) -> intensity
        Two-way intensity of the elements' patterns towards scene directions, NumPy (..., 3) or Dr.Jit: rays are sent
        where it is strong, and cells that it makes negligible are left out. None: nothing is.
    resolution : float [m]
        Ranges that are told apart; cells of smooth surfaces are smaller.
    max_depth : int
        Bounces that an echo of smooth surfaces may have made.
    """

    def __init__(self, scatterers, profile, absorption, *, frequency, window, margin, lighting, rays, pattern,
                 resolution=np.inf, max_depth=1):
        self.scatterers, self.frequency, self.window = scatterers, frequency, window
        self.lighting, self.rays, self.pattern = lighting, rays, pattern
        geometry = scatterers.geometry
        fastest, slowest = float(np.max(profile.sound_speed)), float(np.min(profile.sound_speed))
        self.nearest = 0.5 * window[0] * slowest - margin
        self.farthest = 0.5 * window[1] * fastest + margin
        self.lib = arrays_of(mi.Float)
        self.tracer = Tracer(geometry, profile, max_range=self.farthest)
        self.connector, self.free_rays = Connector(self.tracer), FreeRays(self.tracer)
        self.profile = profile
        self.loss_db = Absorption(absorption, profile, max(geometry.depth_range[1], 1.0), mi.Float)
        self.smooth = SmoothTargets(self.connector, self.loss_db, frequency=frequency, resolution=resolution,
                                    reach=margin, farthest=self.farthest, bounces=max_depth)

    def __call__(self, origin, rotation, depth_below, key):
        """Light the scatterers from a source.

        Parameters
        ----------
        origin : (3,) [m]
            Scene coordinates.
        rotation : (3, 3)
            Body to scene.
        depth_below : float [m]
            Seabed below the source: where rays go first.
        key : int
            Of the random numbers rays are drawn with.

        Yields
        ------
        Echoes
            Block by block; point targets and smooth surfaces come last.
        """
        sources = self.tracer.sources([-origin[2]])
        start = self.lib.Array3f64(*(dr.opaque(self.lib.Float64, float(v)) for v in origin))
        if self.lighting == "scatterers":
            facets = self.scatterers.in_reach(origin, self.nearest, self.farthest)
            stretches = self.scatterers.stretches(facets, origin, self.farthest)
            cells = int(stretches[2].sum())
            if cells > MOST_CELLS:
                raise ValueError(f"{cells:.2g} cells of the scene lie within reach of a ping, and {MOST_CELLS:.0e} is "
                                 "the most; take larger cells, a shorter range, or let rays light them")
            for facet, s in self.scatterers.listed(stretches, CELLS_PER_BLOCK):
                yield from self._echoes(sources, start, rotation, facet, s)
        else:
            facet, s, energy = self._found(sources, start, rotation, depth_below, key)
            for first in range(0, len(facet), CELLS_PER_BLOCK):
                some = slice(first, first + CELLS_PER_BLOCK)
                yield from self._echoes(sources, start, rotation, upload(mi.UInt32, facet[some]),
                                        upload(mi.UInt32, s[some]), upload(mi.Float, energy[some].astype(np.float32)))
        if self.scatterers.targets:
            yield from self._targets(sources, start)
        for _, _, echoes in self.smooth(sources, np.array([origin], float), np.zeros(1, np.uint32)):
            yield echoes

    def _echoes(self, sources, origin, rotation, facet, s, energy=None):
        """Echoes of cells, lit by connecting them, or with the energies (R,) that rays have brought."""
        if self.pattern is not None:
            # where the rays leave for: the straight line there may lie in another lobe
            point = self.scatterers.at(facet, s).point
            direction = self.connector.launch_direction(sources, origin, mi.UInt32(0), point)
            index = dr.compress(self.pattern(direction, rotation) > NEGLIGIBLE)
            if not dr.width(index):
                return
            facet, s = dr.gather(mi.UInt32, facet, index), dr.gather(mi.UInt32, s, index)
            energy = None if energy is None else dr.gather(mi.Float, energy, index)
            dr.eval(facet, s, energy)
        cells = self.scatterers.at(facet, s)
        way = self.connector(sources, origin, mi.UInt32(0), cells.point, cells.normal, occlusion=energy is None)
        lit = way.free & (way.travel_time < 0.55 * self.window[1] + 1e-3)
        if energy is None:
            hits = _Lit(cells, way)
            strength, sin_grazing = scattering_strength(hits, lit, self.frequency)
            energy = strength * cells.area * self._way_back(sources, cells.point, way) / way.spreading_area
            lit &= sin_grazing > 1e-6
        root = dr.sqrt(dr.maximum(energy, 0))
        lit &= (root > 0) & dr.isfinite(root)
        yield from self._kept(origin, cells.point, way, energy, tuple(root * part for part in cells.amplitude), lit)

    def _targets(self, sources, origin):
        """Echoes of the point targets."""
        point, strength_db, _ = zip(*self.scatterers.targets)
        point = self.lib.Array3f64(*(upload(mi.Float64, column) for column in np.array(point).T))
        # on no surface: what is drawn in its place must not shade it
        way = self.connector(sources, origin, mi.UInt32(0), point, mi.Vector3f(0, 0, 0), short=TARGET_RADIUS)
        pressure = upload(mi.Float, (10 ** (np.array(strength_db) / 20)).astype(np.float32))
        energy = dr.square(pressure) * self._way_back(sources, point, way) / way.spreading_area
        nothing = dr.zeros(mi.Float, dr.width(energy))
        yield from self._kept(origin, point, way, energy, (dr.sqrt(energy), nothing), way.free)

    def _way_back(self, sources, point, way):
        """What energy at the scatterer is worth back at the source: (c_h / c_0)² 10^(-2 ᾱ L / 10) / A."""
        source_depth, source_speed, _ = sources.state.gather(self.lib, mi.UInt32(0))
        loss_db = self.loss_db(mi.Float(source_depth), mi.Float(-point.z), way.arc_length, mi.Float(way.ray_parameter))
        ratio = mi.Float(way.sound_speed / source_speed)
        return ratio * ratio * dr.exp(loss_db * float(-np.log(10) / 10)) / way.spreading_area

    def _kept(self, origin, point, way, energy, amplitude, lit):
        leg = Leg.along(way, origin, point)
        echoes = Echoes(out=leg, back=leg, between=dr.zeros(mi.Float64, dr.width(lit)), energy=energy,
                        amplitude=amplitude).evaluated()
        dr.eval(lit)
        index = dr.compress(lit)
        if dr.width(index):
            yield echoes.chosen(index).evaluated()

    # ---- rays that find cells

    def _found(self, sources, origin, rotation, depth_below, key):
        """Cells that rays find: facets, numbers within them, and the energies of their rays."""
        direction, solid_angle = self._drawn(rotation, depth_below, key)
        hits = self.tracer(sources, origin, mi.UInt32(0), direction)
        strength, sin_grazing = scattering_strength(hits, hits.valid, self.frequency)
        energy = solid_angle * strength / dr.maximum(sin_grazing, 1e-6)
        energy *= self._way_back(sources, hits.point, hits)
        facet, s = self.scatterers.of(hits)
        dr.eval(facet, s, energy, hits.valid, sin_grazing)
        found = hits.valid.numpy() & (sin_grazing.numpy() > 1e-6) & (energy.numpy() > 0)
        facet, s, energy = facet.numpy()[found], s.numpy()[found], energy.numpy()[found]
        found = self.scatterers.scattering[facet]
        cell, which = np.unique((facet[found].astype(np.uint64) << np.uint64(32)) | s[found], return_inverse=True)
        return ((cell >> np.uint64(32)).astype(np.uint32), cell.astype(np.uint32),
                np.bincount(which, weights=energy[found], minlength=len(cell)))

    def _drawn(self, rotation, depth_below, key):
        """Directions, and the solid angle each stands for, even over time on a flat bed and over the beams."""
        azimuth, across = np.linspace(-np.pi, np.pi, AZIMUTHS + 1), np.linspace(-np.pi / 2, np.pi / 2, ELEVATIONS + 1)
        a, e = (0.5 * (edges[1:] + edges[:-1]) for edges in (azimuth, across))
        a, e = np.meshgrid(a, e, indexing="ij")
        towards = np.stack([np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)], -1)
        beam = np.ones(a.shape) if self.pattern is None else self.pattern(towards, rotation)
        beam = np.maximum(beam / max(beam.max(), 1e-30), FAINTEST)      # beams that look apart leave nothing
        speed = float(np.mean(self.profile.sound_speed))
        with np.errstate(divide="ignore"):
            time = np.where(across > 0, 2 * abs(depth_below) / (speed * np.sin(across)), np.inf)
        even = np.abs(np.diff(np.clip(time, *self.window)))[None] * np.sqrt(beam)
        everywhere = np.cos(e) * beam
        density = (1 - EVEN_SHARE) * even / max(even.sum(), 1e-30) + EVEN_SHARE * everywhere / everywhere.sum()
        rows = density.sum(1)
        first = quantiles(azimuth, rows[None] / np.diff(azimuth), AZIMUTHS)
        second = quantiles(across, density / np.diff(across), ELEVATIONS)
        return _rays(self.rays, first, second, azimuth, key)


class _Lit:
    """Cells as `materials.scattering_strength` looks at hits: normals on the side the ray comes from."""

    def __init__(self, cells, way):
        self.point, self.uv, self.shape, self.primitive = cells.point, cells.uv, cells.shape, cells.primitive
        self.arrival_direction, self.sound_speed = way.arrival_direction, way.sound_speed
        self.normal = dr.select(dr.dot(cells.normal, way.arrival_direction) > 0, -cells.normal, cells.normal)


def _rays(rays, first, second, azimuth, key):
    """Stratified draws through the quantile tables of azimuth, and of elevation within each cell of azimuth."""
    steps = max(4, 4 * round(np.sqrt(rays / 4) / 2))
    rows = max(4, 4 * round(rays / (4 * steps)))
    strata = Strata(arrays_of(mi.Float), 1, steps, rows)
    index = dr.arange(mi.UInt32, strata.rays)
    _, _, i, j = strata.split(index)
    x, y = mi.sample_tea_32(index, dr.opaque(mi.UInt32, key & 0xFFFFFFFF))
    below = float(np.nextafter(np.float32(1), np.float32(0)))
    x = dr.minimum((mi.Float(i) + mi.Float(x >> 8) * 2.0 ** -24) / dr.opaque(mi.Float, steps), below)
    y = dr.minimum((mi.Float(j) + mi.Float(y >> 8) * 2.0 ** -24) / dr.opaque(mi.Float, rows), below)
    a, width_a, _ = draw(upload(mi.Float, first.astype(np.float32)), mi.UInt32(0), x, AZIMUTHS)
    cell = dr.clip((a - float(azimuth[0])) * (AZIMUTHS / (2 * np.pi)), 0, AZIMUTHS - 1)
    e, width_e, _ = draw(upload(mi.Float, second.astype(np.float32)), mi.UInt32(cell), y, ELEVATIONS)
    sine, cosine = dr.sincos(e)
    sine_a, cosine_a = dr.sincos(a)
    direction = mi.Vector3f(sine_a * cosine, cosine_a * cosine, -sine)
    return direction, cosine * width_a * width_e / dr.opaque(mi.Float, steps * rows)

