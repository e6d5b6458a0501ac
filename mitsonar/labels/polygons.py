"""Masks as polygons along the edges of their picture elements; filling the polygons returns the same mask.

Formats for training allow only polygons without holes. A piece with holes is therefore cut across them. For a format
with one ring for all pieces, `joined` connects the rings by double lines without area.
"""
from collections.abc import Sequence

import numpy as np


def polygons(mask: np.ndarray) -> list[np.ndarray]:
    """Return a mask (H, W) as polygons that have no holes and do not overlap."""
    from rasterio.features import shapes
    from scipy import ndimage

    mask = np.asarray(mask, bool)
    numbers, count = np.zeros(mask.shape, np.int32), 0                 # of pieces without holes
    waiting = [(mask, numbers)]
    while waiting:
        part, into = waiting.pop()
        pieces = np.empty(part.shape, np.int32)
        ndimage.label(part, output=pieces)
        for number, where in enumerate(ndimage.find_objects(pieces), 1):
            piece = pieces[where] == number
            if holes := _holes(piece):
                cut = sum(holes[len(holes) // 2]) // 2
                waiting += [(piece[:cut], into[where][:cut]), (piece[cut:], into[where][cut:])]
            else:
                count += 1
                into[where][piece] = count
    # one call for all pieces, as it takes longer to set up than to find an outline
    rings = [np.array(outline["coordinates"][0][:-1], int) for outline, _ in shapes(numbers, mask=mask)]
    return sorted(rings, key=lambda ring: (ring[:, 1].min(), ring[:, 0].min()))


def _holes(piece: np.ndarray) -> list[tuple[int, int]]:
    """Return the first row of every hole of a piece, and the row after its last, sorted."""
    from scipy import ndimage

    beside = np.ones((piece.shape[0] + 2, piece.shape[1] + 2), bool)   # with a frame around, which is no hole
    beside[1:-1, 1:-1] = ~piece
    numbers = np.empty(beside.shape, np.int32)
    ndimage.label(beside, output=numbers)
    return sorted((rows.start - 1, rows.stop - 1) for rows, _ in ndimage.find_objects(numbers)[1:])


def joined(rings: Sequence[np.ndarray]) -> np.ndarray:
    """Return polygons as one ring, connected by double lines between close corners."""
    outline, *rest = rings
    for ring in rest:
        apart = np.abs(outline[:, None] - ring).sum(-1)
        here, there = np.unravel_index(apart.argmin(), apart.shape)
        outline = np.concatenate([outline[:here + 1], ring[there:], ring[:there + 1], outline[here:]])
    return outline
