"""Rotations: by a rotation vector, and by roll, pitch and heading.

    v + 2 cos(|ρ|/2) a × v + 2 a × (a × v),    a = sin(|ρ|/2) ρ / |ρ|                                             (1)
    v_outer = Rz(heading) Ry(pitch) Rx(roll) v_body,    v_scene = E v_outer                                       (2)

(1) turns v by |ρ| about ρ (Euler-Rodrigues). It adds small vectors to v, so that a small turn in float32 has the
rounding of one sum: 2e-8 rms at 0.1 rad, where the sum of v cos|ρ| and two other terms has 2.3e-8.
(2) turns first by roll about x, then pitch about y, then heading about z (the aerospace z-y-x order; Fossen, Handbook
of Marine Craft Hydrodynamics and Motion Control, 2011, eq. 2.18). The body has x forward, y starboard, z down; the
outer frame is that of the platform a head is mounted in, or north, east, down, which E swaps for east, north, up.
"""
from __future__ import annotations

import drjit as dr
import numpy as np

from .types import Numbers, Real, Triple

LEAST_ANGLE = 1e-6                 # [rad] against division by zero: a smaller angle has its sine's slope
NORTH_EAST_DOWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # E of (2), which undoes itself
SMALL = 1e-4                       # [rad], below which series are better than quotients


# ---- by a rotation vector

def rotated(vector: Triple, rotation: Triple, back: bool = False) -> tuple[Numbers, Numbers, Numbers]:
    """Turn vectors by rotation vectors [rad] or, with `back`, by their opposites: triples, by (1).

    On the device, a rotation in single precision may turn vectors in double: only what a small turn adds is rounded.
    """
    (x, y, z), jit = rotation, dr.is_jit_v(rotation[0])
    square = _fused(z, z, _fused(y, y, x * x))
    angle = dr.maximum(dr.sqrt(square), LEAST_ANGLE) if jit else np.maximum(np.sqrt(square), LEAST_ANGLE)
    sine, cosine = dr.sincos(0.5 * angle) if jit else (np.sin(0.5 * angle), np.cos(0.5 * angle))
    scale = (-sine if back else sine) / angle
    axis = x * scale, y * scale, z * scale
    twice = tuple(2 * part for part in cross(axis, [type(x)(part) for part in vector] if jit else vector))
    return tuple(part + cosine * first + second for part, first, second in zip(vector, twice, cross(axis, twice)))


def cross(a: Triple, b: Triple) -> tuple[Numbers, Numbers, Numbers]:
    """Return the cross product of triples."""
    return tuple(_fused(a[i], b[j], -(a[j] * b[i])) for i, j in ((1, 2), (2, 0), (0, 1)))


def _fused(a: Numbers, b: Numbers, c: Numbers) -> Numbers:
    """Return a b + c, on the device in one instruction."""
    return dr.fma(a, b, c) if dr.is_jit_v(c) else a * b + c


def rotation_vector(matrix: np.ndarray) -> np.ndarray:
    """Return the rotation vectors (..., 3) [rad] of matrices (..., 3, 3)."""
    if (np.trace(matrix, axis1=-2, axis2=-1) > 2).all() and np.allclose(matrix, np.swapaxes(matrix, -1, -2), 0, 1e-15):
        return np.zeros(matrix.shape[:-1])         # none turns: no SciPy for a straight track
    from scipy.spatial.transform import Rotation

    vector = Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_rotvec().reshape(matrix.shape[:-1])
    # equal attitudes must not turn by a rounding error
    return np.where(np.abs(vector) < 1e-15, 0.0, vector)


def vector_rotation(vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return R and J (3, 3) of a rotation vector θ (3,) [rad]: R = exp [θ], d(R p) = (J dθ) × (R p).

    J = I + (1 - cos φ)/φ² [θ] + (φ - sin φ)/φ³ [θ]², φ = |θ|, R = I + [θ] J (Chirikjian, 2012, Stochastic Models,
    Information Theory, and Lie Groups 2, eq. 10.86).
    """
    x, y, z = vector
    cross, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), float(np.linalg.norm(vector))
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    second = 1 / 6 - angle ** 2 / 120 if angle < SMALL else (angle - np.sin(angle)) / angle ** 3
    jacobian = np.eye(3) + first * cross + second * cross @ cross
    return np.eye(3) + cross @ jacobian, jacobian


# ---- by roll, pitch and heading

def mounted(vector: np.ndarray, roll: Real, pitch: Real, heading: Real = 0.0) -> np.ndarray:
    """Return vectors (..., 3) of bodies at angles (...) [rad] in the outer frame."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    return np.stack(np.broadcast_arrays(*(a * x + b * y + c * z for a, b, c in _rows(roll, pitch, heading))), -1)


def mounting_matrix(roll: Real, pitch: Real, heading: Real = 0.0) -> np.ndarray:
    """Return the rotations (..., 3, 3) from a body to its outer frame at angles (...) [rad]."""
    return np.moveaxis(np.array(_rows(*np.broadcast_arrays(roll, pitch, heading))), (0, 1), (-2, -1))


def rotation_matrix(roll: Real, pitch: Real, heading: Real) -> np.ndarray:
    """Return the rotations (..., 3, 3) from body to scene at attitudes (...) [rad]."""
    north, east, down = _rows(*np.broadcast_arrays(roll, pitch, heading))
    return np.moveaxis(np.array([east, north, [-part for part in down]]), (0, 1), (-2, -1))


def rotation_slopes(roll: Real, pitch: Real, heading: Real) -> np.ndarray:
    """Return the derivatives (3, ..., 3, 3) of `rotation_matrix` by heading, pitch and roll.

    Its entries are a + b sin + c cos of each angle: half their difference over half a circle is the derivative.
    """
    angles, quarter = np.stack(np.broadcast_arrays(roll, pitch, heading), -1), 0.5 * np.pi * np.eye(3)[::-1]
    ahead, behind = (np.stack([rotation_matrix(*np.moveaxis(angles + step, -1, 0)) for step in steps])
                     for steps in (quarter, -quarter))
    return 0.5 * (ahead - behind)


def mounting_angles(matrix: np.ndarray) -> np.ndarray:
    """Return roll, pitch and heading (..., 3) [rad] of rotations (..., 3, 3) from a body to its outer frame.

    They are exact at any pitch: the roll is taken about the heading that was found.
    """
    heading = np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])
    pitch = np.arctan2(-matrix[..., 2, 0], np.hypot(matrix[..., 0, 0], matrix[..., 1, 0]))
    sine, cosine = np.sin(heading), np.cos(heading)
    roll = np.arctan2(sine * matrix[..., 0, 2] - cosine * matrix[..., 1, 2],
                      cosine * matrix[..., 1, 1] - sine * matrix[..., 0, 1])
    return np.stack([roll, pitch, heading], -1)


def attitude_of(rotation: np.ndarray) -> np.ndarray:
    """Return roll, pitch and heading (..., 3) [rad] of rotations (..., 3, 3) from body to scene."""
    return mounting_angles(NORTH_EAST_DOWN @ rotation)


def _rows(roll: Real, pitch: Real, heading: Real) -> list[list[Real]]:
    """Return the rows of the matrix of (2): of north, east and down."""
    (sr, cr), (sp, cp), (sh, ch) = ((np.sin(angle), np.cos(angle)) for angle in (roll, pitch, heading))
    return [[ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
            [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
            [-sp, cp * sr, cp * cr]]
