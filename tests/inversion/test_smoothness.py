"""Roots of smooth covariances: the deviations asked for, transposes, and one covariance on grids and meshes."""
import numpy as np
import pytest

from mitsonar.inversion.fitting.smoothness import covariance_root, grid_root, independent_root, mesh_root


def _mesh(count, step):
    x, y = np.meshgrid(np.arange(count) * step, np.arange(count) * step, indexing="ij")
    i = (np.arange(count - 1)[:, None] * count + np.arange(count - 1)).ravel()
    faces = np.concatenate([np.stack([i, i + count, i + count + 1], 1), np.stack([i, i + count + 1, i + 1], 1)])
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), faces


def _covariance(root, count):
    rows = np.stack([root.transpose(one) for one in np.eye(count)])
    return rows @ rows.T


ROOTS = {"independent": lambda d: independent_root(d), "grid": lambda d: grid_root((12, 12), (0.5, 0.5), 1.0, d),
         "mesh": lambda d: mesh_root(*_mesh(12, 0.5), 1.0, d),
         "tilted": lambda d: grid_root((12, 12), (0.5, 0.5), 1.0, d, (0.7, 0.1)),
         "written out": lambda d: covariance_root(np.diag(d ** 2))}


@pytest.mark.parametrize("kind", ROOTS)
def test_every_node_has_the_deviation_asked_for(kind):
    deviation = np.linspace(0.5, 2, 144)
    root = ROOTS[kind](deviation)
    if kind == "tilted":                               # of the mean 0.7, of slopes 0.1 a metre, beside what bends
        at = 0.5 * (np.arange(12) - 5.5)
        plane = 0.7 ** 2 + 0.01 * (at[:, None] ** 2 + at ** 2).ravel()
        deviation = np.sqrt(deviation ** 2 + plane)
    np.testing.assert_allclose(np.sqrt(np.diag(_covariance(root, 144))), deviation, rtol=1e-10)
    np.testing.assert_allclose(root.deviation, deviation, rtol=1e-10)


def test_numbers_of_no_deviation_stand_still():
    root = independent_root(np.array([0.0, 2.0, 0.0]))
    assert root.size == 1 and root.forward(np.ones(1)).tolist() == [0, 2, 0]


def test_deviations_on_a_large_mesh_are_those_asked_for_within_a_few_hundredths():
    # 1,296 vertices, scaled at a quarter of them: the variance rises to a border within a length of six samples
    root = mesh_root(*_mesh(36, 0.5), 3.0, np.ones(1296))
    random = np.random.default_rng(0)
    rows = [root.transpose(np.eye(1296)[one]) for one in (0, 20, 35, 820, 1295, *random.integers(0, 1296, 40))]
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=0.05)


@pytest.mark.parametrize("kind", ROOTS)
def test_transposes_are_transposes(kind):
    rng = np.random.default_rng(0)
    root, x = ROOTS[kind](np.linspace(0.5, 2, 144)), rng.standard_normal(144)
    z = rng.standard_normal(root.size)
    assert root.forward(z) @ x == pytest.approx(z @ root.transpose(x), rel=1e-12)


def test_far_from_borders_the_covariance_is_materns():
    # (d/l) K1(d/l); cells of l/4 and a border 4 l away: 2 % of the variance
    from scipy.special import k1

    count, step, length = 33, 0.5, 2.0
    middle = count // 2 * (count + 1)
    distance = step * np.arange(1, 13)
    wanted = distance / length * k1(distance / length)
    for root in (grid_root((count, count), (step, step), length, np.ones(count ** 2)),
                 mesh_root(*_mesh(count, step), length, np.ones(count ** 2))):
        row = root.forward(root.transpose(np.eye(count ** 2)[middle])).reshape(count, count)
        np.testing.assert_allclose(row[count // 2, count // 2 + 1:][:12], wanted, atol=0.02)


@pytest.mark.parametrize("make, words", [
    (lambda: grid_root((3, 3), (1.0,), 1.0, np.ones(9)), "2 axes has 1 spacings"),
    (lambda: grid_root((3, 3), (1.0, 1.0), -1.0, np.ones(9)), "above zero"),
    (lambda: grid_root((3, 3), (1.0, 1.0), 1e6, np.ones(9)), "fit one number"),
    (lambda: mesh_root(np.zeros((3, 2)), np.array([[0, 1, 2]]), 1.0, np.ones(3)), "vertices \\(n, 3\\)"),
    (lambda: mesh_root(np.eye(3), np.array([[0, 1, 3]]), 1.0, np.ones(3)), "beyond the 3"),
    (lambda: mesh_root(np.eye(4)[:, :3], np.array([[0, 1, 2]]), 1.0, np.ones(4)), "1 vertices are on no face"),
])
def test_what_cannot_be_is_told(make, words):
    with pytest.raises(ValueError, match=words):
        make()
