"""Find the first hits of rays on large beds that are grids, by walking from cell to cell.

A tree over a million triangles takes half a second to build and a hundred megabytes, and rays read it all over, two or
three times as long as they walk. A ray over a grid knows which cell comes next (Amanatides and Woo 1987, Eurographics),
and passes 8 x 8 cells at once where it is above their greatest or below their least height (Musgrave 1988, Yale
research report 639). Within a cell, both triangles are planes over the unit square. With x, y in cells from the corner
`here`, z the heights:

    lower:  z_here  + x (z_east - z_here)    + y (z_north - z_here)           x + y <= 1
    upper:  z_across - (1 - x)(z_across - z_north) - (1 - y)(z_across - z_east)     x + y > 1

and the ray o + t d meets a plane z = a + b x + c y at t = (a + b o_x + c o_y - o_z) / (d_z - b d_x - c d_y).
"""
from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, reinterpreted, upload
from mitsonar.device.types import ArrayTypes, Record

FEWEST = 1 << 17                   # triangles from which on walking beats a tree
BITS = 3                           # by which the number of a cell is shifted to that of its block
BLOCK = 1 << BITS                  # cells along a side of a block
OFF_NODE = 5e-4                    # cells that a vertex may lie off its node
EDGE = 2e-3                        # cells by which triangles are widened, so that no ray passes between two
LEVEL = 1e-9                       # cells a metre: the slowest way across cells that is divided by
SPARE = 1e-3                       # [m] above the highest and below the lowest node where rays begin and end


class HeightGrid(Record):
    """Hold the heights of a mesh that is a grid: rows run north from `corner`, columns east; two triangles a cell."""

    corner: np.ndarray             # (2,) [m]
    spacing: np.ndarray            # (2,) [m]: along x and y
    heights: np.ndarray            # (rows, columns) float32 [m]


def in_rows(vertices: np.ndarray) -> HeightGrid | None:
    """Return the grid that vertices (V, 3) [m] are in the order of `triangulate`, whatever their faces, or None."""
    columns = int(np.argmax(vertices[:, 1] != vertices[0, 1]))
    rows = len(vertices) // max(columns, 1)
    if min(columns, rows) < 2 or rows * columns != len(vertices):
        return None
    nodes = vertices.reshape(rows, columns, 3)
    corner, far = nodes[0, 0, :2].astype(float), nodes[-1, -1, :2].astype(float)
    spacing = (far - corner) / (columns - 1, rows - 1)
    if not (spacing > 0).all() or not np.isfinite(vertices[:, 2]).all():
        return None
    x, y = (corner[axis] + spacing[axis] * np.arange(count) for axis, count in ((0, columns), (1, rows)))
    if (np.abs(nodes[..., 0] - x).max() > OFF_NODE * spacing[0]
            or np.abs(nodes[..., 1] - y[:, None]).max() > OFF_NODE * spacing[1]):
        return None
    return HeightGrid(corner=corner, spacing=spacing, heights=np.ascontiguousarray(nodes[..., 2]))


def as_grid(vertices: np.ndarray, faces: np.ndarray) -> HeightGrid | None:
    """Return the grid that a mesh of vertices (V, 3) [m] and faces (F, 3) is in the order of `triangulate`, or None."""
    grid = in_rows(vertices)
    if grid is None:
        return None
    rows, columns = grid.heights.shape
    if len(faces) != 2 * (rows - 1) * (columns - 1):
        return None
    here = np.arange(columns - 1, dtype=np.uint32)[:, None]
    cell = (here + np.array([0, 1, columns, 1, columns + 1, columns], np.uint32)).ravel()
    first = (np.arange(rows - 1, dtype=np.uint32) * np.uint32(columns))[:, None]
    return grid if np.array_equal(faces.reshape(rows - 1, -1), first + cell) else None


def large_grid(shape: mi.Shape) -> HeightGrid | None:
    """Return the grid that a large mesh is, which is walked without a tree; None for any other shape."""
    if dr.backend_v(mi.Float) != dr.JitBackend.LLVM:
        return None                    # a graphics card has hardware for trees
    if not isinstance(shape, mi.Mesh) or shape.face_count() < FEWEST or "faces" not in mi.traverse(shape):
        return None                    # Mitsuba's rectangle calls itself a mesh
    return as_grid(*mesh_arrays(shape))


def mesh_arrays(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (V, 3) [m] and faces (F, 3) of a mesh, those withheld from Mitsuba, too."""
    parameters: Any = mi.traverse(shape)
    vertices, faces = (dr.detach(parameters[name]).numpy().reshape(-1, 3) for name in ("vertex_positions", "faces"))
    return vertices, next((own for mesh, own in _withheld.get() or () if mesh is shape), faces)


# large grids that a scene being loaded holds, and their faces (F, 3); None: all faces are shown. Of one thread: what
# another one makes meanwhile keeps its tree.
_withheld: ContextVar[list[tuple[mi.Mesh, np.ndarray]] | None] = ContextVar("withheld", default=None)


def withhold(mesh: mi.Mesh) -> None:
    """Show Mitsuba a single face without extent in place of those of a large grid, until `without_trees` ends."""
    if (waiting := _withheld.get()) is not None and large_grid(mesh) is not None:
        waiting.append((mesh, mesh_arrays(mesh)[1].copy()))
        _show(mesh, np.zeros((1, 3), np.uint32))


@contextlib.contextmanager
def without_trees() -> Iterator[list[mi.Mesh]]:
    """Let Mitsuba build no trees of the large grids made meanwhile, for `HeightField` alone; yield a list of these.

    The list is filled at the end.
    """
    meshes: list[mi.Mesh] = []
    waiting: list[tuple[mi.Mesh, np.ndarray]] = []
    token = _withheld.set(waiting)
    try:
        yield meshes
    finally:
        _withheld.reset(token)
        for mesh, faces in waiting:
            _show(mesh, faces)
            meshes.append(mesh)


def _show(mesh: mi.Mesh, faces: np.ndarray) -> None:
    parameters = mi.traverse(mesh)
    parameters["faces"] = mi.UInt32(faces.ravel())
    parameters.update()
    dr.eval()


class HeightField:
    """Find hits on a grid of heights as on its mesh, the shape of a number `registry` in Mitsuba's registry."""

    def __init__(self, grid: HeightGrid, registry: int):
        self.lib = arrays_of(mi.Float)
        heights = grid.heights
        corners = np.stack([heights[:-1, :-1], heights[:-1, 1:], heights[1:, :-1], heights[1:, 1:]], -1)
        rows, columns = corners.shape[:2]
        least, most = (_of_blocks(extreme, heights) for extreme in (np.minimum, np.maximum))
        # four heights of a cell are one aligned packet, and the two of a block half of one
        self._cells, self._blocks = upload(mi.Float, corners), upload(mi.Float, np.stack([least, most], -1))
        self._counts = [dr.opaque(mi.UInt32, count) for count in (columns, rows, least.shape[1], registry)]
        self._plan = [dr.opaque(mi.Float64, float(number)) for number in (*grid.corner, *(1 / grid.spacing))]
        self._ends = [dr.opaque(mi.Float, float(number)) for number in (least.min() - SPARE, most.max() + SPARE)]
        dr.eval(self._cells, self._blocks, self._counts, self._plan, self._ends)

    def ray_intersect_preliminary(self, ray: mi.Ray3f, coherent: object = False,
                                  active: mi.Bool | bool = True) -> mi.PreliminaryIntersection3f:
        """Return the first hits, as `mi.Scene` does."""
        with dr.suspend_grad():
            distance, column, row, x, y = _walked(self.lib, self._cells, self._blocks, self._counts, self._plan,
                                                  self._ends, dr.detach(ray), mi.Bool(active))
            found, upper = distance < dr.inf, x + y > 1
            pi = dr.zeros(mi.PreliminaryIntersection3f)
            pi.valid, pi.t = found, distance
            pi.prim_index = 2 * (row * self._counts[0] + column) + dr.select(upper, mi.UInt32(1), 0)
            # corners of the lower triangle: here, east, north; of the upper one: east, across, north
            pi.prim_uv = mi.Point2f(dr.select(upper, dr.maximum(x + y - 1, 0), x), dr.select(upper, 1 - x, y))
            pi.shape = reinterpreted(mi.ShapePtr, dr.select(found, self._counts[3], 0))
        return pi

    def ray_test(self, ray: mi.Ray3f, coherent: object = False, active: mi.Bool | bool = True) -> mi.Bool:
        """Return True for rays that meet the grid, as `mi.Scene` does."""
        return self.ray_intersect_preliminary(ray, coherent, active).is_valid()


def _of_blocks(extreme: np.ufunc, heights: np.ndarray) -> np.ndarray:
    """Return the extreme heights of blocks of cells, whose nodes (rows, columns) on the edges belong to both sides."""
    for axis in (0, 1):
        nodes, cells = np.moveaxis(heights, axis, 0), heights.shape[axis] - 1
        starts = np.arange(0, cells, BLOCK)
        ends = nodes[np.minimum(starts + BLOCK, cells)]
        heights = np.moveaxis(extreme(extreme.reduceat(nodes[:-1], starts), ends), 0, axis)
    return heights


# Steps of the loop of `_walked`, with declared results: pyright takes minutes to infer them within the loop.
def _met(z: Any, x: mi.Float, y: mi.Float, dx: mi.Float, dy: mi.Float, o_z: mi.Float, d_z: mi.Float,
         maxt: mi.Float) -> mi.Float:
    """Return the distances [m] at which rays meet the triangles of cells of heights z [m]; infinite without a hit."""
    b, c = z[1] - z[0], z[2] - z[0]
    lower = (z[0] + dr.fma(b, x, c * y) - o_z) * dr.rcp(d_z - dr.fma(b, dx, c * dy))
    at_x, at_y = dr.fma(lower, dx, x), dr.fma(lower, dy, y)
    good = (lower >= 0) & (lower <= maxt) & (at_x >= -EDGE) & (at_y >= -EDGE) & (at_x + at_y <= 1 + EDGE)
    met = dr.select(good, lower, mi.Float(dr.inf))
    b, c = z[3] - z[2], z[3] - z[1]
    upper = (z[3] + dr.fma(b, x - 1, c * (y - 1)) - o_z) * dr.rcp(d_z - dr.fma(b, dx, c * dy))
    at_x, at_y = dr.fma(upper, dx, x), dr.fma(upper, dy, y)
    good = (upper >= 0) & (upper <= maxt) & (at_x <= 1 + EDGE) & (at_y <= 1 + EDGE) & (at_x + at_y >= 1 - EDGE)
    return dr.select(good, dr.minimum(met, upper), met)


def _left(place: mi.Int32, ahead: mi.Float, side: mi.Float, first: mi.Float, start: mi.Float,
          metres: mi.Float) -> mi.Float:
    """Return the distances [m] at which rays leave a column or row of cells or blocks of `side` cells."""
    return (dr.fma(mi.Float(place) + ahead, side, -first) - start) * metres


def _from_block(lib: ArrayTypes, place: mi.Float, corner: mi.Float64,
                per_metre: mi.Float64) -> tuple[mi.Float, mi.Float]:
    """Return places [m] in cells from the first cells of their blocks, and the whole numbers of these cells."""
    there = (lib.Float64(place) - corner) * per_metre
    # rounded first, so that the two add up to the place however far off it is
    first = mi.Float(dr.floor(there * (1 / BLOCK)) * BLOCK)
    return mi.Float(there - lib.Float64(first)), first


def _out(out_x: mi.Float, out_y: mi.Float, end: mi.Float, t: mi.Float) -> mi.Float:
    """Return the distances [m], from `t` to `end`, at which rays leave a cell or block."""
    return dr.maximum(dr.minimum(dr.minimum(out_x, out_y), end), t)


def _meets(span: Any, here: mi.Float, there: mi.Float) -> mi.Bool:
    """Return True for rays between heights [m] that are within the `span` of a block."""
    return (dr.minimum(here, there) <= span[1] + SPARE) & (dr.maximum(here, there) >= span[0] - SPARE)


Number = TypeVar("Number", "mi.Float", "mi.Int32")


def _either(wanted: mi.Bool, one: Number, other: Number) -> Number:
    """Return one number where it is wanted, else the other."""
    return dr.select(wanted, one, other)


def _inside(column: mi.Int32, row: mi.Int32, fine: mi.Bool, columns: mi.UInt32, rows: mi.UInt32,
            blocks_across: mi.UInt32) -> mi.Bool:
    """Return True where there are such a column and row of cells, or of blocks."""
    limit_x = dr.select(fine, mi.Int32(columns), mi.Int32(blocks_across))
    limit_y = dr.select(fine, mi.Int32(rows), (mi.Int32(rows) + (BLOCK - 1)) >> BITS)
    return (column >= 0) & (row >= 0) & (column < limit_x) & (row < limit_y)


def _entered(block: mi.Int32, place: mi.Float, first: mi.Float, cells: mi.UInt32) -> mi.Int32:
    """Return the column or row of the cell where a ray enters a block, at `place` [cells] from the cell `first`."""
    begin = block * BLOCK
    # whatever number a NaN becomes, the cell lies in the block and in the grid
    return dr.clip(mi.Int32(dr.floor(place) + first), begin, dr.minimum(begin + (BLOCK - 1), mi.Int32(cells) - 1))


def _next(column: mi.Int32, row: mi.Int32, step_x: mi.Int32, step_y: mi.Int32, across: mi.Bool,
          fine: mi.Bool) -> tuple[mi.Int32, mi.Int32, mi.Bool]:
    """Return column and row of the next cell or block, and True where a ray leaves the block of its cell."""
    next_column, next_row = dr.select(across, column + step_x, column), dr.select(across, row, row + step_y)
    left = fine & (((next_column >> BITS) != (column >> BITS)) | ((next_row >> BITS) != (row >> BITS)))
    return dr.select(left, next_column >> BITS, next_column), dr.select(left, next_row >> BITS, next_row), left


@dr.syntax
def _walked(lib: ArrayTypes, cells: mi.Float, blocks: mi.Float, counts: list[mi.UInt32], plan: list[mi.Float64],
            ends: list[mi.Float], ray: mi.Ray3f, active: mi.Bool):
    """Follow rays (R,) to their first hits: distance [m], infinite without one, column and row of the cell, x and y."""
    columns, rows, blocks_across, _ = counts
    (x0, y0, per_x, per_y), (lowest, highest) = plan, ends
    o, d = ray.o, ray.d
    # in cells from the origin's block: near the origin, hits are as exact as the ray itself
    (px, first_x), (py, first_y) = _from_block(lib, o.x, x0, per_x), _from_block(lib, o.y, y0, per_y)
    west, south = -first_x - px, -first_y - py
    dx, dy = d.x * mi.Float(per_x), d.y * mi.Float(per_y)
    dx = dr.select(abs(dx) < LEVEL, LEVEL, dx)
    dy = dr.select(abs(dy) < LEVEL, LEVEL, dy)
    dz = dr.select(abs(d.z) < LEVEL, LEVEL, d.z)
    metres_x, metres_y, metres_z = dr.rcp(dx), dr.rcp(dy), dr.rcp(dz)
    east, north = dx > 0, dy > 0
    ahead_x, ahead_y = dr.select(east, mi.Float(1), 0), dr.select(north, mi.Float(1), 0)
    step_x, step_y = dr.select(east, mi.Int32(1), -1), dr.select(north, mi.Int32(1), -1)
    # the ray within the box of the grid
    sides = [(west * metres_x, (west + mi.Float(columns)) * metres_x),
             (south * metres_y, (south + mi.Float(rows)) * metres_y),
             ((lowest - o.z) * metres_z, (highest - o.z) * metres_z)]
    t, end = mi.Float(0), mi.Float(ray.maxt)
    for a, b in sides:
        t, end = dr.maximum(t, dr.minimum(a, b)), dr.minimum(end, dr.maximum(a, b))
    # -------------------------------------------------- loop state
    fine = mi.Bool(False)                                        # within a block that may be hit
    column = mi.Int32(held(dr.fma(t, dx, -west), 0.0, mi.Float(columns) - 1)) // BLOCK     # of a block, or of a cell
    row = mi.Int32(held(dr.fma(t, dy, -south), 0.0, mi.Float(rows) - 1)) // BLOCK
    best = mi.Float(dr.inf)
    active = mi.Bool(active) & (t <= end)
    while active:
        side = dr.select(fine, mi.Float(1), BLOCK)
        out_x = _left(column, ahead_x, side, first_x, px, metres_x)
        out_y = _left(row, ahead_y, side, first_y, py, metres_y)
        out = _out(out_x, out_y, end, t)
        met, enter = mi.Float(dr.inf), mi.Bool(False)
        if fine:
            z = dr.gather(lib.Array4f, cells, mi.UInt32(row) * columns + mi.UInt32(column), active)
            x, y = px - (mi.Float(column) - first_x), py - (mi.Float(row) - first_y)
            met = _met(z, x, y, dx, dy, o.z, d.z, ray.maxt)
        else:
            span = dr.gather(lib.Array2f, blocks, mi.UInt32(row) * blocks_across + mi.UInt32(column), active)
            enter = _meets(span, dr.fma(t, d.z, o.z), dr.fma(out, d.z, o.z))
        best = dr.select(active, dr.minimum(best, met), best)
        active &= ~(best < dr.inf)
        # into the block, at the cell where the ray enters it
        inner_column = _entered(column, dr.fma(t, dx, px), first_x, columns)
        inner_row = _entered(row, dr.fma(t, dy, py), first_y, rows)
        # or on to the next block or cell
        next_column, next_row, left = _next(column, row, step_x, step_y, out_x <= out_y, fine)
        column = _either(active, _either(enter, inner_column, next_column), column)
        row = _either(active, _either(enter, inner_row, next_row), row)
        t = _either(enter, t, out)
        fine = (fine & ~left) | enter
        active &= enter | (t < end)
        active &= _inside(column, row, fine, columns, rows, blocks_across)
    x = held(dr.fma(best, dx, px) - (mi.Float(column) - first_x), 0.0, 1.0)
    y = held(dr.fma(best, dy, py) - (mi.Float(row) - first_y), 0.0, 1.0)
    return best, mi.UInt32(column), mi.UInt32(row), x, y
