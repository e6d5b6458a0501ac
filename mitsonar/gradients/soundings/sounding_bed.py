"""Interpolate a seabed linearly between depths at the nodes of a grid."""
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np


class BedShares(NamedTuple):
    """Hold the nodes around N places and their shares in the depth there."""

    node: np.ndarray  # (N, 4): flat numbers
    share: np.ndarray  # (N, 4): their sum is 1
    by_x: np.ndarray  # (N, 4) [1/m]: slopes of the shares
    by_y: np.ndarray  # (N, 4) [1/m]


@dataclass(frozen=True, kw_only=True, eq=False)
class BedGrid:
    """Depths at the nodes of a grid; beyond its edges the depth is that at the edge.

    Parameters
    ----------
    x, y : array (nx,), (ny,) [m]
        Increasing positions. With a single node the bed is constant along that axis.
    depth : array (ny, nx) [m]
        Depths, positive down.

    Raises
    ------
    ValueError
        If a number is not finite, positions do not increase, or the shape of `depth` does not fit.
    """

    x: np.ndarray
    y: np.ndarray
    depth: np.ndarray

    def __post_init__(self):
        for name in ("x", "y", "depth"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), float))
        for name, axis in (("x", self.x), ("y", self.y)):
            if axis.ndim != 1 or not axis.size or not np.isfinite(axis).all() or (np.diff(axis) <= 0).any():
                raise ValueError(f"bed: {name} must be a list of increasing numbers, at least one.")
        if self.depth.shape != (self.y.size, self.x.size) or not np.isfinite(self.depth).all():
            raise ValueError(f"bed: depth must hold {self.y.size} rows of {self.x.size} finite numbers, one for each y "
                             f"and x; got the shape {self.depth.shape}.")

    def shares(self, x: np.ndarray, y: np.ndarray) -> BedShares:
        """Return nodes and shares at places (N,)."""
        (i, u, du), (j, v, dv) = _place(self.x, x), _place(self.y, y)
        i2, j2 = np.minimum(i + 1, self.x.size - 1), np.minimum(j + 1, self.y.size - 1)
        width = self.x.size
        node = np.stack([j * width + i, j * width + i2, j2 * width + i, j2 * width + i2], -1)
        share = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], -1)
        by_x = np.stack([-du * (1 - v), du * (1 - v), -du * v, du * v], -1)
        by_y = np.stack([-dv * (1 - u), -dv * u, dv * (1 - u), dv * u], -1)
        return BedShares(node, share, by_x, by_y)


def _place(nodes: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the node before, the share of the node after, and its slope."""
    if nodes.size == 1:
        return np.zeros(len(at), int), np.zeros(len(at)), np.zeros(len(at))
    k = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, nodes.size - 2)
    gap = nodes[k + 1] - nodes[k]
    share = (at - nodes[k]) / gap
    inside = (share >= 0) & (share <= 1)
    return k, np.clip(share, 0, 1), np.where(inside, 1 / gap, 0)
