"""Directions in which parameters are moved to check their gradients, and weights under which records are looked at.

    v(r) = Σ_k a_k Π_axis cos[π k (i + 1/2) / n]         over the indices i of an array         (cosines)
    v(r) = Σ_k a_k exp[-|r - r_k|² / 2 s_k²]             over rows that are places r            (bumps)
    w(i) = slow(i) / envelope(i)                         of a record                            (weights)

Both vary slowly: a record of many rays is smooth in a slow motion of what it sees, while a single node that moves alone
shows the edges of facets and bins. A direction's largest component is 1, in the unit of its parameter.

The components of vectors are moved one after the other, and few numbers one by one. In one sum, what is large would
hide that what is small has no gradient.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.device.chance import shape_key

FEW = 4                            # numbers that are moved one by one, components that are moved one after the other
ORDERS = 4                         # cosines along an axis, the constant included
BUMPS = 5
NARROWEST, WIDEST = 0.12, 0.35     # of a bump, as a share of the extent of the places
ENVELOPE = 6                       # parts of an axis that a record's envelope is averaged over
FAINTEST = 1e-2                    # of the highest envelope, that what is fainter is weighted as
AXES = "xyzw"


@dataclass(frozen=True, kw_only=True)
class Part:
    """What is moved of one parameter."""

    name: str  # component or index, empty where the whole parameter moves
    directions: np.ndarray  # (D, ...): each of the parameter's shape


def generator(seed: int, key: str) -> np.random.Generator:
    """Return what a parameter's directions are drawn with, whichever others are checked beside it."""
    return np.random.default_rng([seed, shape_key(key)])


def parts(start: np.ndarray, count: int, random: np.random.Generator) -> list[Part]:
    """Return the parts of a parameter, each with smooth random directions."""
    shape = start.shape
    if shape == (4, 4):
        return _rigid(start)
    if start.size <= FEW:
        return [Part(name=_index(index, shape), directions=_one(shape, index)) for index in np.ndindex(shape)]
    if len(shape) > 1 and 1 < shape[-1] <= FEW:
        return [Part(name=AXES[axis], directions=np.stack([_component(start, axis, random) for _ in range(count)]))
                for axis in range(shape[-1])]
    return [Part(name="", directions=np.stack([_cosines(shape, random) for _ in range(count)]))]


def slow_weights(record: np.ndarray, shape: Sequence[int], random: np.random.Generator) -> np.ndarray:
    """Return a positive and a signed weight of a record, slowly varying over its axes."""
    # record (N,) -> (2, N)
    finite = np.isfinite(record)
    size = np.where(finite, np.abs(record), 0.0).reshape(shape)
    envelope = _envelope(size)
    field = _cosines(tuple(shape), random)
    signed = _cosines(tuple(shape), random)
    found = np.stack([np.exp(0.7 * field) / envelope, (signed - signed.mean()) / envelope]).reshape(2, -1) * finite
    scale = np.abs(found) @ size.ravel()
    return found / np.where(scale > 0, scale, 1.0)[:, None]


def _index(index, shape):
    return f"[{', '.join(map(str, index))}]" if np.prod(shape) > 1 else ""


def _one(shape, index):
    direction = np.zeros((1, *shape))
    direction[(0, *index)] = 1.0
    return direction


def _component(start, axis, random):
    """One component of all vectors, by their places where they are places."""
    direction = np.zeros(start.shape)
    rows = start.reshape(-1, start.shape[-1])
    placed = start.ndim == 2 and np.ptp(rows, axis=0).max() > 1e-9 * (1 + np.abs(rows).max())
    direction[..., axis] = _bumps(rows, random) if placed else _cosines(start.shape[:-1], random)
    return direction


def _cosines(shape, random):
    """Low-order cosines with random amplitudes, (shape), of largest size 1."""
    orders = [min(ORDERS, n) for n in shape]
    field = random.standard_normal(orders)
    for axis, order in enumerate(orders):
        field = field / np.expand_dims(1.0 + np.arange(order), [k for k in range(len(orders)) if k != axis])
    for axis, (n, order) in enumerate(zip(shape, orders, strict=True)):
        table = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(order)) / n)
        field = np.moveaxis(np.tensordot(table, field, (1, axis)), 0, axis)
    return field / np.abs(field).max()


def _bumps(places, random):
    """Gaussian bumps about some of the places (N, 3), (N,), of largest size 1."""
    extent = np.linalg.norm(np.ptp(places, axis=0))
    centres = places[random.integers(len(places), size=BUMPS)]
    widths = extent * random.uniform(NARROWEST, WIDEST, BUMPS)
    amplitudes = random.choice([-1.0, 1.0], BUMPS) * random.uniform(0.5, 1.0, BUMPS)
    field = np.zeros(len(places))
    for centre, width, amplitude in zip(centres, widths, amplitudes, strict=True):
        field += amplitude * np.exp(-0.5 * np.sum((places - centre) ** 2, axis=1) / width ** 2)
    return field / np.abs(field).max()


def _rigid(matrix):
    """A body moved along the scene's axes, turned about its own, and grown from its origin."""
    moved, turned = np.zeros((3, 4, 4)), np.zeros((3, 4, 4))
    for axis in range(3):
        moved[axis, axis, 3] = 1.0
        after, last = (axis + 1) % 3, (axis + 2) % 3
        turn = np.zeros((4, 4))
        turn[last, after], turn[after, last] = 1.0, -1.0
        turned[axis] = matrix @ turn
    grown = matrix @ np.diag([1.0, 1.0, 1.0, 0.0])
    names = [f"moved {axis}" for axis in AXES[:3]] + [f"turned {axis}" for axis in AXES[:3]] + ["grown"]
    return [Part(name=name, directions=direction[None])
            for name, direction in zip(names, [*moved, *turned, grown], strict=True)]


def _envelope(size):
    """The level that the record has round about, its faintest parts raised."""
    from scipy.ndimage import uniform_filter1d

    for axis, n in enumerate(size.shape):
        for _ in range(3):
            size = uniform_filter1d(size, max(1, n // ENVELOPE), axis=axis, mode="nearest")
    highest = size.max()
    return np.maximum(size, FAINTEST * highest) if highest > 0 else np.ones_like(size)
