"""Rotations against SciPy's, in both precisions, and against their own inverses and derivatives."""
import drjit as dr
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsonar.device.rotations import (
    attitude_of,
    mounted,
    mounting_angles,
    mounting_matrix,
    rotated,
    rotation_matrix,
    rotation_slopes,
    rotation_vector,
    vector_rotation,
)

ANGLES = np.random.default_rng(3).uniform([-3, -1.5, -3], [3, 1.5, 3], (50, 3))         # roll, pitch, heading [rad]
VECTOR = np.array([0.3, -0.5, 0.7])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.02, 0.7, 3.0])
@pytest.mark.parametrize("back", [False, True])
def test_vectors_turn_about_rotation_vectors(angle, back):
    """float64: a few roundings of 1e-16. An angle below 1e-6 is turned by its sine's slope, off by 1e-19."""
    axis = np.random.default_rng(1).normal(size=(20, 3))
    turn = angle * axis / np.linalg.norm(axis, axis=1)[:, None]
    found = np.transpose(rotated(VECTOR, tuple(turn.T), back=back))
    np.testing.assert_allclose(found, Rotation.from_rotvec(-turn if back else turn).apply(VECTOR), atol=2e-15)
    np.testing.assert_allclose(rotation_vector(Rotation.from_rotvec(turn).as_matrix()), turn, atol=2e-15)


def test_small_turns_on_the_device_are_as_exact_as_one_sum(variant):
    """float32 unit vectors turned by 0.1 rad: rms of 1.9e-8; a sum of three terms of their size has 2.3e-8."""
    import mitsuba as mi

    rng = np.random.default_rng(2)
    vector, turn = (part / np.linalg.norm(part, axis=0) for part in rng.normal(size=(2, 3, 100_000)))
    vector, turn = vector.astype(np.float32), (0.1 * turn).astype(np.float32)
    found = rotated([mi.Float(part) for part in vector], [mi.Float(part) for part in turn])
    wanted = Rotation.from_rotvec(turn.T.astype(float)).apply(vector.T.astype(float)).T
    assert dr.width(found[0]) == 100_000
    assert np.sqrt(np.mean((np.array([part.numpy() for part in found]) - wanted) ** 2)) < 2.1e-8


def test_angles_turn_first_about_x_then_y_then_z():
    matrix = mounting_matrix(*ANGLES.T)
    np.testing.assert_allclose(matrix, Rotation.from_euler("ZYX", ANGLES[:, ::-1]).as_matrix(), atol=2e-15)
    np.testing.assert_allclose(mounted(VECTOR, *ANGLES.T), matrix @ VECTOR, atol=2e-15)
    north, east, down = np.moveaxis(matrix, -2, 0)
    np.testing.assert_array_equal(rotation_matrix(*ANGLES.T), np.stack([east, north, -down], -2))
    np.testing.assert_allclose(mounting_angles(matrix), ANGLES, atol=1e-12)                   # 1 / cos(pitch) of 14
    np.testing.assert_allclose(attitude_of(rotation_matrix(*ANGLES.T)), ANGLES, atol=1e-12)


def test_slopes_are_those_of_the_rotations():
    """Against central differences over 1e-5 rad, which err by 1e-11."""
    for slope, step in zip(rotation_slopes(*ANGLES.T), 1e-5 * np.eye(3)[::-1], strict=True):
        wanted = (rotation_matrix(*(ANGLES + step).T) - rotation_matrix(*(ANGLES - step).T)) / 2e-5
        np.testing.assert_allclose(slope, wanted, atol=1e-10)
    np.testing.assert_allclose(rotation_slopes(*ANGLES[0]), rotation_slopes(*ANGLES.T)[:, 0], atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-5, 0.5, 2.0])
def test_a_small_further_turn_follows_the_jacobian(angle):
    """d(R p) = (J dθ) × (R p), against central differences over 1e-6 rad, which err by 1e-10."""
    vector, step = angle * np.array([0.6, 0.0, -0.8]), 1e-6 * np.array([0.2, -0.9, 0.4])
    matrix, jacobian = vector_rotation(vector)
    np.testing.assert_allclose(matrix, Rotation.from_rotvec(vector).as_matrix(), atol=1e-15)
    wanted = (vector_rotation(vector + step)[0] - vector_rotation(vector - step)[0]) @ VECTOR / 2
    np.testing.assert_allclose(np.cross(jacobian @ step, matrix @ VECTOR), wanted, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-16, 1e-14, 1e-3, 3.0, np.pi])
def test_rotation_vectors_are_those_of_scipy_but_for_rounding_errors(angle):
    """Turns below 1e-15 are none; symmetric matrices are no turn, or half a turn."""
    vectors = angle * np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    matrices = Rotation.from_rotvec(vectors).as_matrix()
    found = rotation_vector(matrices)
    assert np.any(found) == (angle > 1e-15)
    np.testing.assert_allclose(found, Rotation.from_matrix(matrices).as_rotvec(), rtol=0, atol=1e-15)
