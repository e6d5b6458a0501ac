"""Compute weights of a regular grid's nodes at places: linear, or cubic B-splines.

    y(s) = Σ_j B(s/h - j) x_j,     h -> ``spacing``

B -> a hat, or the cubic B-spline (Unser, 1999, eq. 3). The weights add to one at every place.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy import sparse

MOST = 10_000_000                  # nodes


def node_weights(places: np.ndarray, spacing: float, cubic: bool) -> tuple[sparse.csr_array, tuple[int, ...]]:
    """Return the weights of nodes at places, (n, nodes), and the number of nodes along each axis."""
    from scipy import sparse

    if not (np.isfinite(spacing) and spacing > 0):
        raise ValueError(f"nodes are {spacing:g} m apart; give a distance above zero")
    if not np.isfinite(places).all() or not places.size:
        raise ValueError("places of numbers are not finite, or there are none; give where each lies")
    extra = 3 if cubic else 1
    extent = np.ptp(places, axis=0)
    counts = np.maximum(np.ceil(extent / spacing - 1e-9), 1)
    if np.prod(counts + extra) > MOST:
        raise ValueError(f"nodes {spacing:g} m apart over {' by '.join(f'{one:g}' for one in extent)} m are more than "
                         f"{MOST}; space them wider")
    shape = tuple(int(count) + extra for count in counts)
    index, share = np.zeros((len(places), 1), np.int64), np.ones((len(places), 1))
    for axis, count in enumerate(shape):
        # nodes are centred over the places
        middle = (places[:, axis].max() + places[:, axis].min()) / 2
        at = (places[:, axis] - middle) / spacing + (count - 1) / 2
        nodes, parts = _along(at, count, cubic)
        index = (index[:, :, None] * count + nodes[:, None]).reshape(len(places), -1)
        share = (share[:, :, None] * parts[:, None]).reshape(len(places), -1)
    rows = np.repeat(np.arange(len(places)), index.shape[1])
    weights = sparse.csr_array((share.ravel(), (rows, index.ravel())), shape=(len(places), int(np.prod(shape))))
    return weights, shape


def _along(at: np.ndarray, count: int, cubic: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (n, k) and weights (n, k) along one axis, at places in units of the spacing."""
    ahead = 1 if cubic else 0
    first = np.clip(np.floor(at).astype(np.int64), ahead, count - 2 - ahead)
    t = at - first
    if not cubic:
        return first[:, None] + np.arange(2), np.stack([1 - t, t], 1)
    parts = np.stack([(1 - t) ** 3, 3 * t ** 3 - 6 * t ** 2 + 4, -3 * t ** 3 + 3 * t ** 2 + 3 * t + 1, t ** 3], 1) / 6
    return first[:, None] - 1 + np.arange(4), parts
