"""Masks as polygons along the edges of their picture elements; filling the polygons returns the same mask.

Formats for training allow only polygons without holes. A piece with holes is therefore cut across them. For a format
with one ring for all pieces, `joined` connects the rings by double lines without area.
"""
from collections.abc import Sequence
from typing import cast

import numpy as np


def polygons(mask: np.ndarray) -> list[np.ndarray]:
    """Return a mask (H, W) as polygons that have no holes and do not overlap."""
    from rasterio.features import rasterize, shapes
    from scipy import ndimage

    mask = np.asarray(mask, bool)
    pieces, _ = cast("tuple[np.ndarray, int]", ndimage.label(mask))
    rings = []
    waiting = [(mask[where] & (pieces[where] == number + 1), where[1].start, where[0].start)
               for number, where in enumerate(ndimage.find_objects(pieces))]
    while waiting:
        piece, x, y = waiting.pop()
        for outline, _ in shapes(piece.astype(np.uint8), mask=piece):
            exterior, *holes = (np.array(ring[:-1], int) for ring in outline["coordinates"])
            if not holes:
                rings.append(exterior + [x, y])
                continue
            left, top = exterior.min(0)
            closed = [[tuple(corner) for corner in (np.r_[ring, ring[:1]] - [left, top]).tolist()]
                      for ring in (exterior, *holes)]
            filled = np.asarray(rasterize([{"type": "Polygon", "coordinates": closed}],
                                          out_shape=(exterior.max(0) - [left, top])[::-1]), bool)
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
