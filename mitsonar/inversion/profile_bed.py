"""A grid for an unknown bed: where its soundings lie in the water that a fit begins with."""
from __future__ import annotations

import numpy as np

from ..gradients.sounding_bed import BedGrid
from ..hydrography.legs import Starts
from ..hydrography.sounding_beams import SoundingBeams
from ..water import SoundSpeedProfile
from .profile_priors import ProfilePrior, bed_precision

__all__ = ["laid_bed"]

PER_NODE = 6                       # soundings to a node
MOST_ALONG, MOST_NODES = 60, 2500


def laid_bed(beams: SoundingBeams, profile: SoundSpeedProfile, prior: ProfilePrior, cell: float | None) -> BedGrid:
    """Lay a grid where the soundings are in the start's water, and the bed through them."""
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    if cell is not None and not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"fit of a profile: cell is {cell:g} m; give a distance above zero.")
    starts = Starts(profile=profile, depth=beams.depth)
    depth = starts.depth_after(beams.slowness, beams.travel_time / 2)
    some = np.isfinite(depth) & (depth > beams.depth)
    if not some.all():
        raise ValueError(f"fit of a profile: {some.size - some.sum()} of {some.size} beams turn back in the start's "
                         "water before they reach the bed; start with other water, or leave those beams out.")
    leg = starts.to_depth(beams.slowness, depth)
    x, y = beams.x + beams.east * beams.slowness * leg.stretch, beams.y + beams.north * beams.slowness * leg.stretch
    width, height = np.ptp(x), np.ptp(y)
    if cell is not None:
        step = cell
    else:
        share = np.sqrt(max(width * height, width, height) * PER_NODE / len(x))
        step = float(max(share, max(width, height) / MOST_ALONG, np.sqrt(width * height / (0.8 * MOST_NODES)), 0.1))
    counts = [int(np.ceil(side / step)) + 1 for side in (width, height)]
    if np.prod(counts) > MOST_NODES:
        raise ValueError(f"fit of a profile: a bed of {counts[0]} by {counts[1]} nodes {step:g} m apart is more than "
                         f"{MOST_NODES}; take larger cells, or a part of the soundings.")
    nodes = [side.min() + step * (np.arange(count) - (count - 1) / 2) + np.ptp(side) / 2
             for side, count in ((x, counts[0]), (y, counts[1]))]
    bed = BedGrid(x=nodes[0], y=nodes[1], depth=np.full((counts[1], counts[0]), depth.mean()))
    shares = bed.shares(x, y)
    rows = sparse.csc_array((shares.share.ravel(), (np.repeat(np.arange(len(x)), 4), shares.node.ravel())),
                            shape=(len(x), bed.depth.size))
    fitted = spsolve((rows.T @ rows + bed_precision(bed, prior, False)).tocsc(), rows.T @ (depth - depth.mean()))
    return BedGrid(x=bed.x, y=bed.y, depth=depth.mean() + fitted.reshape(bed.depth.shape))
