"""Compute the change of records where outlines move, which derivatives of energies at fixed directions leave out.

    d/dx ∫ E dω = ∫ dE/dx dω + ∫ (E_- - E_+) v_n dl

The second integral is along the lines of launch directions at which the returned energy E jumps: outlines of bodies and
crests of beds with a shadow behind them, folds between facets, and lines where meshes meet. E_- and E_+ are the
energies on either side of a line, v_n its speed in the space of directions, towards the side of E_+ (Li et al. 2018,
Differentiable Monte Carlo ray tracing through edge sampling, ACM Trans. Graph. 37; Zhang et al. 2020, Path-space
differentiable rendering, ACM Trans. Graph. 39).

A point of a line that moves by dx moves in directions by m(dx), two numbers along and across the ray's vertical plane:

    m(dx) = (e·dx / V, κ h·dx),    V = A κ,    κ = cos θ_0 / X
    v_n dl = m(τ) x m(dx - dr) ds = g·(dx - dr) ds

e -> unit, across the ray at its end in that plane, downwards; h -> unit, level, across the plane; A -> spreading area;
τ -> the line per s; dr -> displacement of the ray of one launch there (`ray_shift`). E_- and E_+ are those of two rays
close to either side. Outlines of spheres and cylinders slide over them as they move; across the view they move as the
material does, n·dx. Energies there fall to those of the limb as the root of the ray's distance inside:
E(0) = 2 E(h) - E(4 h). Where something hides the line, both rays meet the same, and nothing jumps. A jump between them
must belong to the line (`_own`), because several edges lie close together near the limb of a round body. Places and
energies are detached; gradients come by dx and dr alone.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scene.tracing.connection import Connection, Connector
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Tracer, registry_index
from mitsonar.survey.energy.first_hits import FirstHits, HitEchoes
from mitsonar.survey.energy.rows import Rays, Rows
from mitsonar.survey.motion.places import Place

from ..attached.geometry import AttachedGeometry
from ..attached.ray_shift import tangent
from ..records.tent_bins import TentBins
from .jump_lines import JumpLines
from .line_samples import LineSamples
from .mesh_edges import NO_FACE
from .shape_outlines import OutlinePoints

NEAR = 0.05                            # [m] of an outline, that a ray which passes in front of what is behind hits
ASIDE, ASIDE_PER_RANGE = 1e-4, 2e-6    # [m], [-] of the rays on either side, over what chords and float32 are off


@dataclass(frozen=True, kw_only=True)
class LinePoints:
    """Hold points of lines in directions, detached."""

    hits: Hits  # the points as if rays ended there
    rays: Rays  # (N,): rays to the points
    drawn: Rays  # (N,): the same before the sonar was turned
    covector: mi.Vector3f  # (N,): g, times the worth of each point
    motion: list[tuple[mi.UInt32, mi.Vector3f]]  # vertices, and their shares of g
    shape: mi.UInt32 | None = None  # (N,): registry index of the shape without facets that the points lie on


@dataclass(frozen=True, kw_only=True)
class EdgeTerms:
    """Hold the terms of a block's pings."""

    points: LinePoints
    sides: list[HitEchoes]  # echoes on either side of the lines
    worths: list[float]  # weight of each side, with its sign

    def add(self, sums: mi.Float64, tents: TentBins, geometry: AttachedGeometry, across: mi.Vector3f | None) -> None:
        """Add the terms to sums (rows x bins,) [1/m²]: 0, with gradients."""
        speed = mi.Float(0)
        for vertex, part in self.points.motion:
            speed = speed + dr.dot(part, tangent(geometry.vertex(vertex)))
        if self.points.shape is not None and geometry.shapes is not None:
            on = geometry.shapes.on(self.points.shape, self.points.hits.valid)
            speed = speed + dr.dot(self.points.covector, on.motion(mi.Vector3f(self.points.hits.point)))
        if across is not None:
            speed = speed - dr.dot(self.points.covector, tangent(across))
        speed = mi.Float64(dr.select(self.points.hits.valid, speed, 0))
        for worth, side in zip(self.worths, self.sides):
            tents.add(sums, replace(side, units=worth * side.units * speed))


def edge_terms(tracer: Tracer, rows: Rows, first_hits: FirstHits, place: Place, lines: JumpLines,
               samples: LineSamples, *, surface: int | None, drawn: Callable[[Place, Rays], Rays]) -> EdgeTerms:
    """Return the terms of points on lines, from rays on both sides."""
    ends = lines.ends[samples.line].astype(float)
    along = ends[:, 1] - ends[:, 0]
    middle = ends[:, 0] + samples.place[:, None] * along
    points, aside = _points(tracer, place, samples.ping, middle, along, samples.worth, drawn)
    motion = _motion(tracer, lines, samples, middle, points.covector.numpy().T.astype(float))
    kind = _kind(tracer, lines, samples, points.hits.arrival_direction.numpy().T.astype(float))
    points = replace(points, motion=motion)
    met, sides = _sides(tracer, rows, first_hits, place, points, aside, surface)
    found = [(hits, _facet(tracer, pi, hits.valid)) for hits, pi in met]
    return _evaluated(points, sides, [1.0, -1.0], _own(points.hits, kind, lines, samples, found))


def outline_terms(tracer: Tracer, rows: Rows, first_hits: FirstHits, place: Place, outlines: OutlinePoints, *,
                  surface: int | None, drawn: Callable[[Place, Rays], Rays]) -> EdgeTerms:
    """Return the terms of points on outlines of shapes without facets; parameters are those of `edge_terms`."""
    points, aside = _points(tracer, place, outlines.ping, outlines.point, outlines.along, outlines.worth, drawn)
    points = replace(points, shape=upload(mi.UInt32, outlines.shape))
    found, own = [], mi.Bool(True)
    for step in (1.0, 4.0):
        met, sides = _sides(tracer, rows, first_hits, place, points, step * aside, surface)
        mine = [hits.valid & (registry_index(pi) == points.shape) for hits, pi in met]
        own = own & _nearer_is(points.hits, [hits for hits, _ in met], mine)
        found += sides
    return _evaluated(points, found, [2.0, -2.0, -1.0, 1.0], own)


def _sides(tracer: Tracer, rows: Rows, first_hits: FirstHits, place: Place, points: LinePoints, aside: mi.Vector3f,
           surface: int | None) -> tuple[list[tuple[Hits, mi.PreliminaryIntersection3f]], list[HitEchoes]]:
    """Trace rays close to either side; return hits and echoes."""
    sources = tracer.sources(np.unique(-place.position[:, 2]))
    ping, met, sides = points.rays.ping, [], []
    origin, source = place.origin(ping), place.source(ping)
    for sign in (-1.0, 1.0):
        direction = dr.normalize(points.rays.direction + sign * aside)
        hits, found = tracer.trace_met(sources, origin, source, direction, points.hits.valid)
        met.append((hits, found))
        if surface is not None:
            hits = replace(hits, valid=hits.valid & (hits.label != surface))
        rays = rows.aimed(place, ping, direction, dr.full(mi.Float, 1, dr.width(direction)))
        sides.append(first_hits.echoes(place, rays, hits))
    return met, sides


def _evaluated(points: LinePoints, sides: list[HitEchoes], worths: list[float], own: mi.Bool) -> EdgeTerms:
    terms = EdgeTerms(points=points, sides=[replace(side, active=side.active & own) for side in sides], worths=worths)
    dr.eval(terms)
    return terms


def _facet(tracer: Tracer, met: mi.PreliminaryIntersection3f, valid: mi.Bool) -> mi.UInt32:
    """Return rows in `Geometry.faces` of the facets that were hit, or `NO_FACE`."""
    rows, row = tracer.geometry.rows, registry_index(met)
    mesh = valid & (dr.gather(mi.UInt32, rows, 4 * row + 2, valid) != 0)
    return dr.select(mesh, dr.gather(mi.UInt32, rows, 4 * row + 1, valid) + met.prim_index, NO_FACE)


def _own(points: Hits, kind: _EdgeKind, lines: JumpLines, samples: LineSamples,
         met: list[tuple[Hits, mi.UInt32]]) -> mi.Bool:
    """Return True if the jump between two rays is at the line between them.

    At a fold both rays meet its facets. At an outline, or where meshes meet, the shorter ray meets one of the line's
    facets, or a point close to it: facets of a limb are small and nearly level.
    """
    faces = [upload(mi.UInt32, lines.faces[samples.line, k].astype(np.uint32)) for k in range(2)]
    beside = [hits.valid & (face != NO_FACE) & ((face == faces[0]) | (face == faces[1])) for hits, face in met]
    outline = _nearer_is(points, [hits for hits, _ in met], beside)
    return dr.select(kind.fold, beside[0] & beside[1], kind.outline & outline)


def _nearer_is(points: Hits, met: list[Hits], mine: list[mi.Bool]) -> mi.Bool:
    """Return True if the shorter of two rays meets the line's own facets, or a point close to the line."""
    first, second = (dr.select(hits.valid, mi.Float(hits.arc_length), dr.inf) for hits in met)
    by = abs(dr.minimum(first, second) - mi.Float(points.arc_length)) < NEAR
    return dr.select(first < second, mine[0], mine[1]) | by


@dataclass(frozen=True, kw_only=True)
class _EdgeKind:
    """Mark points of lines: outlines or meetings of meshes; visible folds."""

    outline: mi.Bool
    fold: mi.Bool


def _kind(tracer: Tracer, lines: JumpLines, samples: LineSamples, view: np.ndarray) -> _EdgeKind:
    """Separate outlines, whose facets lie on the same side of the line along `view` (N, 3), from folds."""
    ends, sides = lines.ends[samples.line].astype(float), lines.faces[samples.line]
    vertices = tracer.geometry.vertices.numpy().reshape(-1, 4)[:, :3].astype(float)
    corners = tracer.geometry.faces.numpy().reshape(-1, 4)[:, :3]
    there = sides != NO_FACE
    middle = vertices[corners[np.where(there, sides, 0)]].mean(2)                            # (sample, side, 3)
    across = np.cross(ends[:, 1] - ends[:, 0], view)
    side = np.einsum("nik,nk->ni", middle - ends[:, :1], across)
    meets = samples.line >= lines.edges
    outline = meets | ~there.all(1) | (side[:, 0] * side[:, 1] > 0)
    return _EdgeKind(outline=mi.Bool(outline), fold=mi.Bool(~outline & ~lines.smooth[samples.line]))


def _points(tracer: Tracer, place: Place, pings: np.ndarray, middle: np.ndarray, along: np.ndarray, worths: np.ndarray,
            drawn: Callable[[Place, Rays], Rays]) -> tuple[LinePoints, mi.Vector3f]:
    """Return points (N, 3) of lines in directions, and small steps across the lines, towards E_+."""
    lib = arrays_of(mi.Float)
    point = lib.Array3f64(*(upload(mi.Float64, middle[:, k]) for k in range(3)))
    tau = mi.Vector3f(*(upload(mi.Float, along[:, k].astype(np.float32)) for k in range(3)))
    ping, worth = upload(mi.UInt32, pings), upload(mi.Float, worths.astype(np.float32))
    way = Connector(tracer.geometry, tracer.water).connect(place.sources, place.origin(ping), place.source(ping), point,
                                                           mi.Vector3f(0), occlusion=False)
    e0, e, h, steepness, level = _axes(way, mi.Vector3f(point - place.origin(ping)))
    down, side = dr.dot(e, tau) * steepness, dr.dot(h, tau) * level
    size = dr.sqrt(down * down + side * side)
    valid = way.exists & dr.isfinite(size) & (size > 1e-12)
    scale = dr.rcp(dr.select(valid, size, 1))
    # the normal of the line in directions, and how far a step of one along it leads at the line
    n_down, n_side = -side * scale, down * scale
    lever = dr.sqrt(dr.square(n_down / steepness) + dr.square(n_side / level))
    step = (ASIDE + ASIDE_PER_RANGE * way.arc_length) / lever
    covector = dr.select(valid, worth * (down * level * h - side * steepness * e), 0)
    hits = replace(Hits.on_surface(valid=valid, point=point, normal=mi.Vector3f(0, 0, 1),
                                   arrival_direction=way.arrival_direction, sound_speed=way.sound_speed,
                                   shape=dr.zeros(mi.ShapePtr, 1), primitive=mi.UInt32(0), uv=mi.Point2f(0)),
                   travel_time=way.travel_time, arc_length=way.arc_length,
                   ray_parameter=way.ray_parameter)
    rays = Rays(ping=ping, direction=way.launch_direction, solid_angle=mi.Float(0))
    points = LinePoints(hits=hits, rays=rays, drawn=drawn(place, rays), covector=covector, motion=[])
    return points, step * (n_down * e0 + n_side * h)


def _axes(way: Connection, chord: mi.Vector3f) -> tuple[mi.Vector3f, mi.Vector3f, mi.Vector3f, mi.Float, mi.Float]:
    """Return unit vectors across rays, downwards at launch and at the end, and level; 1 / V and κ [1/m]."""
    reach, length = mi.Float(way.horizontal_range), dr.maximum(dr.norm(chord), 1e-6)
    upright = reach < 1e-6 * length
    per_reach = dr.rcp(dr.select(upright, 1, reach))
    x, y = dr.select(upright, 1, chord.x * per_reach), dr.select(upright, 0, chord.y * per_reach)
    launch, arrival = way.launch_direction, way.arrival_direction
    cosine0, cosine = (dr.sqrt(dr.maximum(1 - dr.square(d.z), 0)) for d in (launch, arrival))
    level = dr.select(upright, dr.rcp(length), cosine0 * per_reach)
    e0, e = (mi.Vector3f(d.z * x, d.z * y, -c) for d, c in ((launch, cosine0), (arrival, cosine)))
    return e0, e, mi.Vector3f(-y, x, 0), dr.rcp(way.spreading_area * level), level


def _motion(tracer: Tracer, lines: JumpLines, samples: LineSamples, point: np.ndarray,
            covector: np.ndarray) -> list[tuple[mi.UInt32, mi.Vector3f]]:
    """Distribute covectors (N, 3) over the vertices that move points (N, 3) of lines."""
    corners = lines.corners[samples.line]
    place, meets = samples.place[:, None], samples.line >= lines.edges
    parts = [(corners[:, 0], (1 - place) * covector), (corners[:, 1], place * covector)]
    if meets.any():
        vertices = tracer.geometry.vertices.numpy().reshape(-1, 4)[:, :3].astype(float)
        parts = [(row, np.where(meets[:, None], 0, part)) for row, part in parts]
        faces = tracer.geometry.faces.numpy().reshape(-1, 4)[:, :3]
        met = faces[np.where(meets[:, None], lines.faces[samples.line], 0)]                  # (sample, facet, corner)
        parts += _of_facets(vertices, met, point, np.where(meets[:, None], covector, 0))
    return [(upload(mi.UInt32, row.astype(np.uint32)),
             mi.Vector3f(*(upload(mi.Float, part[:, k].astype(np.float32)) for k in range(3)))) for row, part in parts]


def _of_facets(vertices: np.ndarray, corners: np.ndarray, point: np.ndarray,
               covector: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Distribute covectors of points where two facets meet: g = λ_1 n_1 + λ_2 n_2, and n_i·dx = n_i·dx_i."""
    triangles = vertices[corners]                                                            # (N, 2, 3, 3)
    e1, e2 = triangles[:, :, 1] - triangles[:, :, 0], triangles[:, :, 2] - triangles[:, :, 0]
    across = np.cross(e1, e2)
    square = np.maximum(np.einsum("nik,nik->ni", across, across), 1e-30)
    normal = across / np.sqrt(square)[..., None]
    cosine = np.einsum("nk,nk->n", normal[:, 0], normal[:, 1])
    seen = np.einsum("nik,nk->ni", normal, covector)
    weight = (seen - cosine[:, None] * seen[:, ::-1]) / np.maximum(1 - cosine ** 2, 1e-12)[:, None]
    away = point[:, None] - triangles[:, :, 0]
    v = np.einsum("nik,nik->ni", np.cross(e1, away), across) / square
    u = np.einsum("nik,nik->ni", np.cross(away, e2), across) / square
    found = []
    for i in range(2):
        for k, share in enumerate((1 - u - v, u, v)):
            found.append((corners[:, i, k], (weight * share)[:, i, None] * normal[:, i]))
    return found
