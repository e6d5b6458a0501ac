"""Scour of beds by the objects that stand on them, the common half of `seabed`, `bathymetry` and `targets`.

A bed keeps the heights that it had before `targets` scoured it, and how far they have lowered and raised it. Where
moats overlap, the bed is as deep as the deepest, and as high as the highest heap: the order in which objects are read
does not matter. All `targets` lie on the bed as it was before; moats about the objects that the bed itself refers to
are there from the beginning.
"""
import threading
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.scene.protocols import BedShape
from mitsonar.scene.queries.height_field import mesh_arrays
from mitsonar.seabed.scour import Footprint, Scour

from ..attributes import Angle, Attributes, Nested, Number

NODES_PER_MOAT = 4

SCOUR = (
    Number("scour_depth", default=0.0, minimum=0, maximum=1.5,
           text="depth of the moat about each object, in the smaller of its height over the bed and its width across "
                "the current; 0: no scour; mostly 0.1 to 0.5, about slender piles up to 1.3 (Soulsby 1997; Whitehouse "
                "1998)"),
    Number("scour_extent", default=2.0, above=0, maximum=20, text="width of the moat, in the same unit"),
    Number("scour_tail", default=None, above=0, maximum=60, otherwise="twice the extent",
           text="reach of the moat downstream, in the same unit, at least the extent"),
    Number("scour_heap", default=None, minimum=0, maximum=1.5, otherwise="half the depth",
           text="height of the heap in the lee, in the same unit"),
    Angle("scour_heading_deg", default=0.0, text="compass heading towards which the current flows"),
)

STANDING = Nested("shape", many=True, default=None, otherwise="none",
                  text="by `<ref>`: objects that stand on the bed, about which it is scoured; `targets` have "
                       "`scour_depth` of their own")

_lock = threading.Lock()


@dataclass(frozen=True, kw_only=True, eq=False)
class Ground:
    """Heights of a bed's vertices (V,) float32 [m] before targets scoured it, and how far it is lowered and raised."""

    before: np.ndarray
    lowered: np.ndarray
    raised: np.ndarray


@runtime_checkable
class ScouredBed(BedShape, Protocol):
    """Bed that keeps its ground; None before targets scour it."""

    ground: Ground | None


def scour_of(attributes: Attributes) -> Scour | None:
    """Return the scour that is written; None without depth."""
    if attributes.scour_depth == 0:
        given = attributes.given(*(declared.name for declared in SCOUR[1:]))
        if given and not attributes.given("scour_depth"):
            raise attributes.error(f"{given[0]} is written without scour_depth; give the depth of the moats.")
        return None
    extent, tail = attributes.scour_extent, attributes.scour_tail
    try:
        return Scour(depth=attributes.scour_depth, extent=extent, tail=2 * extent if tail is None else tail,
                     heap=attributes.scour_heap, heading=attributes.scour_heading_deg)
    except ValueError as error:
        raise attributes.error(error) from None


def vertices_before(shape: mi.Mesh) -> np.ndarray:
    """Return the vertices (V, 3) [m] of a mesh as they were before targets scoured it."""
    vertices = mesh_arrays(shape)[0].copy()            # the mesh gives its own memory back when it is scoured
    if isinstance(shape, ScouredBed) and shape.ground is not None:
        vertices[:, 2] = shape.ground.before
    return vertices


def scour_about_standing(attributes: Attributes, bed: mi.Mesh) -> None:
    """Scour a new bed about the objects that it refers to."""
    scour, shapes = scour_of(attributes), attributes.shape or []
    if scour is None:
        if shapes and not attributes.given("scour_depth"):
            raise attributes.error(f'it refers to "{shapes[0].id()}" without scour_depth; give the depth of the moats.')
        return
    if not shapes:
        raise attributes.error('scour_depth is written, but no object; refer to those that stand on the bed, such as '
                               '<ref id="wreck"/>.')
    vertices = vertices_before(bed)
    marks = [_standing(attributes, vertices, shape) for shape in shapes]
    cut(attributes, bed, scour, [mark for mark in marks if mark is not None])
    if isinstance(bed, ScouredBed):
        bed.ground = None                                              # targets will lie on the bed as it is now


def _standing(attributes, bed, shape):
    """Return the footprint of an object; of its box if it is no mesh, None if it is buried."""
    box = shape.bbox()
    if "vertex_positions" in mi.traverse(shape):
        vertices, faces = mesh_arrays(shape)
    else:
        vertices, faces = np.array([box.corner(number) for number in range(8)]), np.zeros((0, 3), int)
    low, high = np.array(box.min)[:2], np.array(box.max)[:2]
    below = (bed[:, :2] >= low).all(axis=1) & (bed[:, :2] <= high).all(axis=1)
    if not below.any():
        raise attributes.error(f'"{shape.id()}" covers no node of the bed; move it there, or leave out its <ref>.')
    return Footprint.of(vertices.astype(float), faces, float(bed[below, 2].mean()))


def cut(attributes: Attributes, bed: mi.Mesh, scour: Scour, footprints: list[Footprint]) -> None:
    """Scour a bed about footprints that its grid can carry; refuse a bed too coarse for the largest of them."""
    if not footprints:
        return
    if not isinstance(bed, ScouredBed):
        raise attributes.error(f'scour_depth is written, but the bed "{bed.id()}" is a {bed.class_name()}; scour needs '
                               "a seabed or a bathymetry.")
    with _lock:
        vertices = vertices_before(bed)
        spacing = _spacing(vertices, mesh_arrays(bed)[1])
        carried = [mark for mark in footprints if scour.width(mark) >= NODES_PER_MOAT * spacing]
        if not carried:
            widest = max(scour.width(mark) for mark in footprints)
            raise attributes.error(f"the widest moat is {widest:.3g} m wide on a bed with nodes every {spacing:.3g} m; "
                                   f"a moat needs {NODES_PER_MOAT}: use spacing <= {widest / NODES_PER_MOAT:.3g}, a "
                                   "larger scour_extent, or scour_depth 0.")
        bed.ground = _lowered(bed.ground, vertices, scour, carried)
        vertices = vertices.copy()
        vertices[:, 2] = bed.ground.before + (bed.ground.lowered + bed.ground.raised)
        parameters = mi.traverse(bed)
        parameters["vertex_positions"] = mi.Float(np.ascontiguousarray(vertices).ravel())
        parameters.update()
        dr.eval()


def _lowered(ground, vertices, scour, footprints):
    if ground is None:
        ground = Ground(before=vertices[:, 2].copy(), lowered=np.zeros(len(vertices), np.float32),
                        raised=np.zeros(len(vertices), np.float32))
    lowered, raised = ground.lowered.copy(), ground.raised.copy()
    order = np.argsort(vertices[:, 1], kind="stable")
    north = vertices[order, 1]
    for footprint in footprints:
        (x, y), radius = scour.reach(footprint)
        rows = order[slice(*np.searchsorted(north, (y - radius, y + radius)))]
        inside = rows[np.abs(vertices[rows, 0] - x) <= radius]
        moat, heap = scour.cut(footprint, *vertices[inside, :2].astype(float).T)
        lowered[inside] = np.minimum(lowered[inside], moat)
        raised[inside] = np.maximum(raised[inside], heap)
    return Ground(before=ground.before, lowered=lowered, raised=raised)


def _spacing(vertices, faces):
    """Return the node distance [m] of a mesh of triangles: the median of their shortest sides from above."""
    some = vertices[faces[::max(1, len(faces) // 1000)], :2].astype(float)
    return float(np.median(np.linalg.norm(some - np.roll(some, 1, axis=1), axis=2).min(axis=1)))
