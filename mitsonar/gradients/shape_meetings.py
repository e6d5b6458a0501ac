"""Which shapes without facets may pass through others: where they meet, light and shadow move by lines nobody samples.

Boxes along the axes tell, those of every facet of a mesh: a pair may be told that only comes near.
"""
from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import numpy as np

from ..scene.geometry import Geometry

__all__ = ["may_meet"]


def may_meet(geometry: Geometry, numbers: Sequence[int], meshes: Sequence[int]) -> list[tuple[str, str]]:
    """Give names of pairs that may pass through each other, at least one of them moving and one without facets.

    Parameters
    ----------
    geometry : Geometry
    numbers : sequence of int
        Registry indices of moving shapes without facets.
    meshes : sequence of int
        Numbers in `Geometry.meshes` of moving meshes.
    """
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
    """Whether the box of any facet of a mesh overlaps a box."""
    vertices, faces = geometry.mesh(first, count)
    corners = vertices[faces]
    return bool(np.any(np.all((corners.min(1) < high) & (corners.max(1) > low), axis=1)))


def _box(shape: mi.Shape) -> tuple[np.ndarray, np.ndarray]:
    box = shape.bbox()
    return np.array(box.min, float), np.array(box.max, float)


def _name(shape: mi.Shape) -> str:
    return shape.id() or shape.class_name().lower()
