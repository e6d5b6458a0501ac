"""Masks as polygons along the edges of their picture elements; filling the polygons returns the same mask.

Formats for training allow only polygons without holes. A piece with holes is therefore cut across them. For a format
with one ring for all pieces, `joined` connects the rings by double lines without area.
"""
from collections.abc import Sequence
from typing import cast

import numpy as np


def polygons(mask: np.ndarray) -> list[np.ndarray]:
    """Return a mask (H, W) as polygons that have no holes and do not overlap."""
    from scipy import ndimage

    mask = np.asarray(mask, bool)
    pieces, _ = cast("tuple[np.ndarray, int]", ndimage.label(mask))
    rings = []
    waiting = [(mask[where] & (pieces[where] == number + 1), where[1].start, where[0].start)
               for number, where in enumerate(ndimage.find_objects(pieces))]
    while waiting:
        piece, x, y = waiting.pop()
        for exterior, *holes in _rings(piece):
            if not holes:
                rings.append(exterior + [x, y])
                continue
            left, top = exterior.min(0)
            filled = _filled([ring - [left, top] for ring in (exterior, *holes)])
            middle = sorted((ring[:, 1].min(), ring[:, 1].max()) for ring in holes)[len(holes) // 2]
            cut = sum(middle) // 2 - top
            waiting += [(filled[:cut], x + left, y + top), (filled[cut:], x + left, y + top + cut)]
    return sorted(rings, key=lambda ring: (ring[:, 1].min(), ring[:, 0].min()))


def joined(rings: Sequence[np.ndarray]) -> np.ndarray:
    """Return polygons as one ring, connected by double lines between close corners."""
    outline, *rest = rings
    for ring in rest:
        apart = np.abs(outline[:, None] - ring).sum(-1)
        here, there = np.unravel_index(apart.argmin(), apart.shape)
        outline = np.concatenate([outline[:here + 1], ring[there:], ring[:there + 1], outline[here:]])
    return outline


def _rings(mask):
    """Yield the exterior and the holes of every piece."""
    from rasterio.features import shapes

    for outline, _ in shapes(mask.astype(np.uint8), mask=mask):
        yield [np.array(ring[:-1], int) for ring in outline["coordinates"]]


def _filled(rings):
    """Return the mask of a piece whose exterior begins at 0, 0."""
    from rasterio.features import rasterize

    closed = [[tuple(corner) for corner in (*ring.tolist(), ring[0].tolist())] for ring in rings]
    return np.asarray(rasterize([{"type": "Polygon", "coordinates": closed}], out_shape=rings[0].max(0)[::-1]), bool)
