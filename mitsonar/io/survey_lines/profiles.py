"""Casts of survey lines, as the record takes them."""
from __future__ import annotations

import numpy as np

__all__ = ["cast_of"]

SLOWEST, FASTEST = 300.0, 3000.0   # [m/s]


def cast_of(nodes: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Give depths, increasing, and sound speeds, of nodes (K, 2) [m], [m/s] in any order.

    Raises
    ------
    ValueError
        If there is none that is water's.
    """
    if nodes is None:
        raise ValueError("it has no cast of sound speed.")
    nodes = nodes[np.isfinite(nodes).all(1)]
    nodes = nodes[(nodes[:, 1] > SLOWEST) & (nodes[:, 1] < FASTEST)]
    nodes = nodes[np.unique(nodes[:, 0], return_index=True)[1]]
    if not len(nodes):
        raise ValueError("its cast of sound speed is empty.")
    return nodes[:, 0], nodes[:, 1]
