"""Draw directions in which parameters are moved to check their gradients, and weights of records.

Both vary slowly: a record of many rays is smooth in a slow motion of the scene, while a single node that moves alone
shows the edges of facets and bins.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mitsonar.device.chance import shape_key

FEW = 4                            # numbers that are moved one by one, components that are moved one after the other
ORDERS = 4                         # cosines along an axis, the constant included
BUMPS = 5
NARROWEST, WIDEST = 0.12, 0.35     # of a bump, as a share of the extent of the places
ENVELOPE = 6                       # parts of an axis that a record's envelope is averaged over
FAINTEST = 1e-2                    # of the highest envelope, that what is fainter is weighted as
AXES = "xyzw"


def generator(seed: int, key: str) -> np.random.Generator:
    """Return the random generator of a parameter's directions, independent of other parameters."""
    return np.random.default_rng([seed, shape_key(key)])


def parts(start: np.ndarray, count: int, random: np.random.Generator) -> list[tuple[str, np.ndarray]]:
    """Return names and directions of a parameter's parts; the largest component of a direction is 1.

    Up to four numbers are moved one by one, components of rows of vectors one after the other, a matrix (4, 4) as a
    rigid body that also grows, all else at once. In one sum, large changes would hide small ones.
    """
    shape = start.shape
    if shape == (4, 4):
        return _rigid(start)
    if start.size <= FEW:
        one = np.eye(start.size).reshape(start.size, 1, *shape)
        return [(f"[{', '.join(map(str, index))}]" if start.size > 1 else "", one[number])
                for number, index in enumerate(np.ndindex(shape))]
    if len(shape) == 1 or not 1 < shape[-1] <= FEW:
        return [("", np.stack([_cosines(shape, random) for _ in range(count)]))]
    rows, found = start.reshape(-1, shape[-1]), []
    placed = start.ndim == 2 and np.ptp(rows, axis=0).max() > 1e-9 * (1 + np.abs(rows).max())
    for axis in range(shape[-1]):
        directions = np.zeros((count, *shape))
        for number in range(count):
            directions[number, ..., axis] = _bumps(rows, random) if placed else _cosines(shape[:-1], random)
        found.append((AXES[axis], directions))
    return found


def _rigid(matrix: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return directions of a body moved along the scene's axes, turned about its own, and grown from its origin."""
    moved, turned = np.zeros((3, 4, 4)), np.zeros((3, 4, 4))
    for axis in range(3):
        moved[axis, axis, 3] = 1.0
        after, last = (axis + 1) % 3, (axis + 2) % 3
        turned[axis, last, after], turned[axis, after, last] = 1.0, -1.0
    names = [f"{how} {axis}" for how in ("moved", "turned") for axis in AXES[:3]] + ["grown"]
    return [(name, direction[None]) for name, direction in zip(
        names, [*moved, *(matrix @ turned), matrix @ np.diag([1.0, 1.0, 1.0, 0.0])], strict=True)]


def _cosines(shape: tuple[int, ...], random: np.random.Generator) -> np.ndarray:
    """Draw low-order cosines with random amplitudes, of largest size 1: Σ_k a_k Π_axis cos[π k (i + 1/2) / n]."""
    orders = [min(ORDERS, n) for n in shape]
    field = random.standard_normal(orders)
    for axis, order in enumerate(orders):
        field = field / np.expand_dims(1.0 + np.arange(order), [k for k in range(len(orders)) if k != axis])
    for axis, (n, order) in enumerate(zip(shape, orders, strict=True)):
        table = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(order)) / n)
        field = np.moveaxis(np.tensordot(table, field, (1, axis)), 0, axis)
    return field / np.abs(field).max()


def _bumps(places: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Draw Gaussian bumps about some of the places (N, 3), of largest size 1: Σ_k a_k exp[-|r - r_k|² / 2 s_k²]."""
    extent = np.linalg.norm(np.ptp(places, axis=0))
    centres = places[random.integers(len(places), size=BUMPS)]
    widths = extent * random.uniform(NARROWEST, WIDEST, BUMPS)
    amplitudes = random.choice([-1.0, 1.0], BUMPS) * random.uniform(0.5, 1.0, BUMPS)
    field = np.zeros(len(places))
    for centre, width, amplitude in zip(centres, widths, amplitudes, strict=True):
        field += amplitude * np.exp(-0.5 * np.sum((places - centre) ** 2, axis=1) / width ** 2)
    return field / np.abs(field).max()


def slow_weights(record: np.ndarray, shape: Sequence[int], random: np.random.Generator) -> np.ndarray:
    """Return a positive and a signed weight (2, N) of a record, slowly varying over its axes; 0 where it is not finite.

    Weights are larger where the record is faint; weights times record sum to about 1.
    """
    from scipy.ndimage import uniform_filter1d

    finite = np.isfinite(record)
    envelope = size = np.where(finite, np.abs(record), 0.0).reshape(shape)
    for axis, n in enumerate(shape):
        for _ in range(3):
            envelope = uniform_filter1d(envelope, max(1, n // ENVELOPE), axis=axis, mode="nearest")
    envelope = np.maximum(envelope, FAINTEST * envelope.max()) if envelope.max() > 0 else np.ones_like(size)
    slow, signed = (_cosines(tuple(shape), random) for _ in range(2))
    found = np.stack([np.exp(0.7 * slow) / envelope, (signed - signed.mean()) / envelope]).reshape(2, -1) * finite
    scale = np.abs(found) @ size.ravel()
    return found / np.where(scale > 0, scale, 1.0)[:, None]
