"""Compute shares of a scene that a record, or its derivatives, leave out.

    bins in shadow                       of the bins between a row's first and last ray in the main lobe
    echoes of shapes that stand still    of all energy of first hits: of instances and of kinds other than meshes,
                                         spheres, cylinders, disks and rectangles
    echoes that stand still              of all energy: of several bounces, of the water, of echoes with phases; added
                                         by `record_field`
    where A and B meet, left out         1 where a shape without facets may pass through another, and one moves
    outlines left out                    1 without `edges`: derivatives are then those of the lit parts

Lines where shapes without facets pass through others are not sampled. Pairs are found by boxes along the axes, those of
every facet of a mesh; a pair that only comes near may therefore be listed.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.scene.geometry import Geometry

from ..records.energy_field import Block, EnergyField, Kept, Scenery


def may_meet(geometry: Geometry, numbers: Sequence[int], meshes: Sequence[int]) -> list[tuple[str, str]]:
    """Return names of pairs that may pass through each other, at least one of them moving and one without facets."""
    others = [(number, _name(shape), *_box(shape)) for number, shape in geometry.others]
    found = []
    for index, (number, name, low, high) in enumerate(others):
        for one, (_, shape, first, count) in enumerate(geometry.meshes):
            if (number in numbers or one in meshes) and _touches(geometry, first, count, low, high):
                found.append((name, _name(shape)))
        for second, other, lower, higher in others[index + 1:]:
            if (number in numbers or second in numbers) and np.all((lower < high) & (higher > low)):
                found.append((name, other))
    return found


def _touches(geometry: Geometry, first: int, count: int, low: np.ndarray, high: np.ndarray) -> bool:
    """Return True if the box of any facet of a mesh overlaps a box."""
    vertices, faces = geometry.mesh(first, count)
    corners = vertices[faces]
    return bool(np.any(np.all((corners.min(1) < high) & (corners.max(1) > low), axis=1)))


def _box(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray]:
    box = shape.bbox()
    return np.array(box.min, float), np.array(box.max, float)


def _name(shape: mi.Shape) -> str:
    return shape.id() or shape.class_name().lower()


@dataclass(frozen=True, kw_only=True)
class SeenPieces:
    """Hold rays and energies of a block."""

    rays: np.ndarray  # number in each bin, within the main lobe
    energy: float  # of all first hits, in units of their bins
    standing: float  # of first hits on shapes that stand still


def seen_in(energy: EnergyField, scenery: Scenery, block: Block, kept: list[Kept]) -> SeenPieces:
    """Count the rays and sum the energies of a block."""
    bins = energy.rows.bins.count
    rays = dr.zeros(mi.UInt32, len(block.ping) * energy.rows.per_ping * bins)
    total = rest = 0.0
    with dr.suspend_grad():
        for one in kept:
            echoes = energy.echoes(scenery, block, one)
            inside = echoes.active & echoes.response.in_beam
            dr.scatter_add(rays, mi.UInt32(1), echoes.response.row * bins + echoes.bin, inside)
            units = dr.select(echoes.active, echoes.units, 0)
            total += float(dr.sum(units)[0])
            still = ~one.facets.on_mesh
            if scenery.facets.shapes is not None:
                still &= ~scenery.facets.shapes.on(one.facets.shape, still & one.hits.valid).known
            rest += float(dr.sum(dr.select(still, units, 0))[0])
    return SeenPieces(rays=rays.numpy().reshape(-1, bins), energy=total, standing=rest)


def shares(seen: list[SeenPieces], *, outlines: bool) -> dict[str, float]:
    """Return the shares of all blocks that are left out, by name; `outlines`: derivatives include outlines."""
    lit = np.concatenate([one.rays for one in seen]) > 0
    within = np.maximum.accumulate(lit, 1) & np.maximum.accumulate(lit[:, ::-1], 1)[:, ::-1]
    told = {"bins in shadow": float(np.sum(within & ~lit) / max(np.sum(within), 1))}
    total, rest = (sum(getattr(one, name) for one in seen) for name in ("energy", "standing"))
    if rest > 0:
        told["echoes of shapes that stand still"] = rest / total
    if not outlines:
        told["outlines left out"] = 1.0
    return told
