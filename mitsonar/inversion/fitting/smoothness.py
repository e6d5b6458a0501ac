"""Square roots of smooth covariances, as operators: for a grid by cosines, for a mesh by its Laplacian.

    grid    x = σ/s · Cᵀ (1 + l² k²)⁻¹ C z + P p,   k² of each cosine, s its deviation at each node: x has exactly σ
    mesh    x = σ/s · (M + l² K)⁻¹ M^½ z          M, K -> lumped masses and stiffness of linear triangles

z -> independent numbers of deviation 1; l -> ``length``. In two dimensions the covariance is Matérn's of order 1,
(d/l) K₁(d/l), 0.12 at d = 3 l (Lindgren, Rue and Lindström, 2011, J. R. Stat. Soc. B 73, eq. 2 and section 2.3).
P p -> an optional tilted plane, with which the constant cosine is left out. Without a length, nodes are independent.
Power falls by k⁻⁴, that of seabeds by k⁻³ to k⁻⁴ (Jackson and Richardson, 2007, ch. 6): a steeper prior would keep
real short waves out of the answer. A step by z's gradient is a step by a smoothed gradient (Nicolet, Jacobson and
Jakob, 2021).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

EXACT = 1200                       # vertices up to which deviations are scaled one by one
SAMPLES, NEAREST = 600, 4          # vertices of larger meshes at which they are, and those that one between is like
TOGETHER = 256                     # right-hand sides solved at once
WIDEST = 1e4                       # cells that a length may span: beyond, all nodes are one number in float64

Linear = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Root:
    """A square root of a covariance: x = forward(z), and its transpose."""

    size: int  # of z
    deviation: np.ndarray  # of x
    forward: Linear  # of flat float64 arrays: z (size,) to x (n,)
    transpose: Linear  # of flat float64 arrays: (n,) to (size,)


def independent_root(deviation: np.ndarray) -> Root:
    """Return the root of independent numbers of deviations (n,); numbers of deviation 0 are fixed, without a z."""
    free = np.flatnonzero(deviation)

    def forward(numbers: np.ndarray) -> np.ndarray:
        found = np.zeros(deviation.size)
        found[free] = deviation[free] * numbers
        return found

    return Root(size=free.size, deviation=deviation, forward=forward, transpose=lambda x: (deviation * x)[free])


def covariance_root(covariance: np.ndarray) -> Root:
    """Return the root of a covariance (n, n) that is written out."""
    lower = np.linalg.cholesky(0.5 * (covariance + covariance.T))
    return Root(size=len(lower), deviation=np.sqrt(np.diag(covariance)), forward=lambda z: lower @ z,
                transpose=lambda x: lower.T @ x)


def grid_root(shape: Sequence[int], spacing: Sequence[float], length: float, deviation: np.ndarray,
              plane: tuple[float, float] | None = None) -> Root:
    """Return the root of a grid of nodes."""
    # spacing [m]; length [m]
    from scipy.fft import dctn, idctn

    shape, spacing = tuple(int(count) for count in shape), tuple(float(step) for step in spacing)
    if len(shape) != len(spacing):
        raise ValueError(f"a grid of {len(shape)} axes has {len(spacing)} spacings; give one for each")
    _check_length(length, min(spacing))
    square, modes, slopes = np.zeros(shape), [], []
    for axis, (count, step) in enumerate(zip(shape, spacing)):
        along = [-1 if other == axis else 1 for other in range(len(shape))]
        square = square + ((np.pi * np.arange(count) / (count * step)) ** 2).reshape(along)
        phase = np.pi * np.outer(np.arange(count) + 0.5, np.arange(count)) / count
        modes.append((2 / count * np.cos(phase) ** 2) * np.where(np.arange(count) == 0, 0.5, 1))
        if plane is not None and count > 1:
            slopes.append(np.broadcast_to((step * (np.arange(count) - (count - 1) / 2)).reshape(along), shape).ravel())
    filtered, tilted = 1 / (1 + length ** 2 * square), np.zeros((0, square.size))
    if plane is not None:
        filtered.flat[0] = 0                       # the plane's mean stands for it
        tilted = np.stack([np.full(square.size, plane[0]), *(plane[1] * slope for slope in slopes)])
    variance = filtered ** 2
    for axis, mode in enumerate(modes):
        variance = np.moveaxis(np.tensordot(mode, variance, (1, axis)), 0, axis)
    scale, first = deviation.reshape(shape) / np.sqrt(variance), len(tilted)

    def forward(z: np.ndarray) -> np.ndarray:
        waves = scale * idctn(filtered * dctn(z[first:].reshape(shape), norm="ortho"), norm="ortho")
        return waves.ravel() + z[:first] @ tilted

    def transpose(x: np.ndarray) -> np.ndarray:
        waves = idctn(filtered * dctn(scale * x.reshape(shape), norm="ortho"), norm="ortho")
        return np.concatenate([tilted @ x, waves.ravel()])

    return Root(size=first + square.size, deviation=np.hypot(deviation, np.linalg.norm(tilted, axis=0)),
                forward=forward, transpose=transpose)


def mesh_root(vertices: np.ndarray, faces: np.ndarray, length: float, deviation: np.ndarray) -> Root:
    """Return that of a mesh's vertices, distances measured over its surface."""
    # vertices [m]; faces (F, 3); length [m]
    from scipy import sparse
    from scipy.sparse.linalg import splu

    mass, stiffness = _elements(np.asarray(vertices, float), np.asarray(faces))
    count = mass.size
    _check_length(length, np.sqrt(mass.max()))
    solver = splu(sparse.csc_matrix(sparse.diags_array(mass) + length ** 2 * stiffness))
    root = np.sqrt(mass)
    some = _samples(np.asarray(vertices, float), length)
    spread = np.concatenate([np.sum((root[:, None] * solver.solve(one)) ** 2, 0)
                             for one in _unit_columns(count, some)])
    scale = deviation / np.sqrt(_between(np.asarray(vertices, float), some, spread))

    def forward(numbers: np.ndarray) -> np.ndarray:
        return scale * solver.solve(root * numbers)

    def transpose(numbers: np.ndarray) -> np.ndarray:
        return root * solver.solve(scale * numbers)

    return Root(size=count, deviation=np.asarray(deviation, float), forward=forward, transpose=transpose)


def _unit_columns(count: int, which: np.ndarray) -> Iterator[np.ndarray]:
    """Yield blocks of columns of the identity."""
    for begin in range(0, which.size, TOGETHER):
        part = which[begin:begin + TOGETHER]
        block = np.zeros((count, part.size))
        block[part, np.arange(part.size)] = 1
        yield block


def _samples(vertices: np.ndarray, length: float) -> np.ndarray:
    """Return the vertices at which deviations are scaled: all, or one in each cube of side length / 4 or more."""
    if len(vertices) <= EXACT:
        return np.arange(len(vertices))
    side = length / 4
    while True:
        some = np.unique(np.floor((vertices - vertices.min(0)) / side), axis=0, return_index=True)[1]
        if some.size <= SAMPLES:
            return np.sort(some)
        side *= 1.2


def _between(vertices: np.ndarray, some: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Return the variances at all vertices, interpolated from those at some vertices."""
    from scipy.spatial import cKDTree

    if some.size == len(vertices):
        return spread
    apart, which = cKDTree(vertices[some]).query(vertices, k=min(NEAREST, some.size))
    apart, which = apart.reshape(len(vertices), -1), which.reshape(len(vertices), -1)
    weight = 1 / np.maximum(apart, 1e-9 * max(apart.max(), 1e-300)) ** 2
    return np.sum(weight * spread[which], 1) / weight.sum(1)


def _elements(vertices: np.ndarray, faces: np.ndarray):
    """Return the lumped masses (n,) [m²] and the sparse stiffness (n, n) of linear triangles."""
    from scipy import sparse

    count = len(vertices)
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        raise ValueError(f"a mesh has vertices (n, 3) and faces (F, 3); these are {vertices.shape} and {faces.shape}")
    if faces.size == 0 or faces.min() < 0 or faces.max() >= count:
        raise ValueError(f"faces name vertices beyond the {count} that there are")
    corner = vertices[faces]                                               # (F, 3, 3)
    against = np.roll(corner, -2, 1) - np.roll(corner, -1, 1)              # the side that faces each corner
    area = 0.5 * np.linalg.norm(np.cross(against[:, 0], against[:, 1]), axis=1)
    real = area > 1e-12 * area.max()
    faces, against, area = faces[real], against[real], area[real]
    mass = np.bincount(faces.ravel(), np.repeat(area / 3, 3), count)
    if not (mass > 0).all():
        raise ValueError(f"{int((mass <= 0).sum())} vertices are on no face of any area; a smooth prior needs a mesh "
                         "without them")
    values = np.einsum("fik,fjk->fij", against, against) / (4 * area[:, None, None])
    rows, columns = np.repeat(faces, 3, 1), np.tile(faces, (1, 3))
    stiffness = sparse.coo_array((values.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
    return mass, stiffness.tocsc()


def _check_length(length: float, cell: float) -> None:
    if not (np.isfinite(length) and length > 0 and cell > 0):
        raise ValueError(f"the prior's length is {length:g} m on cells of {cell:g} m; give numbers above zero")
    if length > WIDEST * cell:
        raise ValueError(f"the prior's length is {length:g} m, {length / cell:.0f} cells; give less than {WIDEST:.0f} "
                         "cells, or fit one number")
