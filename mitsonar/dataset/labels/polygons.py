"""Masks as polygons along the edges of their picture elements: filled again they give the same mask.

Formats for training know polygons without holes only. A piece with holes is therefore cut across them into pieces that
have none; a format that wants one ring for all pieces gets them joined by a line to and fro, which has no area.
"""
from collections.abc import Sequence
from typing import cast

import numpy as np


def polygons(mask: np.ndarray) -> list[np.ndarray]:
    """Cut a mask into polygons without holes that do not overlap."""
    # mask (H, W)
    from scipy import ndimage

    mask = np.asarray(mask, bool)
    pieces, _ = cast("tuple[np.ndarray, int]", ndimage.label(mask))
    found = []
    waiting = [(mask[where] & (pieces[where] == number + 1), where[1].start, where[0].start)
               for number, where in enumerate(ndimage.find_objects(pieces))]
    while waiting:
        piece, x, y = waiting.pop()
        for exterior, *holes in _rings(piece):
            if not holes:
                found.append(exterior + [x, y])
                continue
            left, top = exterior.min(0)
            own = _filled([ring - [left, top] for ring in (exterior, *holes)])
            middle = sorted((ring[:, 1].min(), ring[:, 1].max()) for ring in holes)[len(holes) // 2]
            cut = sum(middle) // 2 - top
            waiting += [(own[:cut], x + left, y + top), (own[cut:], x + left, y + top + cut)]
    return sorted(found, key=lambda ring: (ring[:, 1].min(), ring[:, 0].min()))


def joined(rings: Sequence[np.ndarray]) -> np.ndarray:
    """Join polygons to one ring, by lines to and fro between corners that are close to each other."""
    whole, *others = rings
    for ring in others:
        apart = np.abs(whole[:, None] - ring).sum(-1)
        here, there = np.unravel_index(apart.argmin(), apart.shape)
        whole = np.concatenate([whole[:here + 1], ring[there:], ring[:there + 1], whole[here:]])
    return whole


def _rings(mask):
    """Exterior and holes of every piece."""
    from rasterio.features import shapes

    for outline, _ in shapes(mask.astype(np.uint8), mask=mask):
        yield [np.array(ring[:-1], int) for ring in outline["coordinates"]]


def _filled(rings):
    """The mask of one piece, whose exterior begins at 0, 0."""
    from rasterio.features import rasterize

    return np.asarray(rasterize([{"type": "Polygon", "coordinates": [_closed(ring) for ring in rings]}],
                     out_shape=rings[0].max(0)[::-1]), bool)


def _closed(ring):
    return [tuple(corner) for corner in (*ring.tolist(), ring[0].tolist())]
