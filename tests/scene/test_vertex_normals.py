"""Normals at the nodes of a mesh: closed forms, Mitsuba's own, and the same bytes every time."""
import mitsuba as mi
import numpy as np

from mitsonar.scene.geometry import vertex_normals


def test_a_cubes_corners_look_outwards_however_its_sides_are_cut():
    """Each side has a right angle at the corner, in one triangle or in two: (1, 1, 1) / √3 by angles, not by areas."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    np.testing.assert_allclose(vertex_normals(vertices, faces), vertices / np.sqrt(3), atol=1e-6)


def test_a_sines_slopes_come_back_to_second_order():
    x = np.linspace(0, 16, 81)
    heights = 0.5 * np.sin(2 * np.pi * x / 16) * np.ones((5, 1))
    vertices = np.stack([np.tile(x, 5), np.repeat(np.arange(5.0), 81), heights.ravel()], -1)
    index = np.arange(5 * 81).reshape(5, 81)
    here, east, north, across = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    faces = np.stack((here, east, north, east, across, north), -1).reshape(-1, 3)
    normals = vertex_normals(vertices, faces).reshape(5, 81, 3)[2, 1:-1]
    slope = 0.5 * 2 * np.pi / 16 * np.cos(2 * np.pi * x[1:-1] / 16)
    assert np.abs(-normals[:, 0] / normals[:, 2] - slope).max() < 1e-3


def test_mitsubas_own_are_the_same_but_for_the_last_bits(variant):
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(60, 3)).astype(np.float32)
    faces = np.array([rng.choice(60, 3, replace=False) for _ in range(150)], np.uint32)
    mesh = mi.Mesh("any", len(vertices), len(faces), has_vertex_normals=True)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"], parameters["faces"] = mi.Float(vertices.ravel()), mi.UInt32(faces.ravel())
    parameters.update()
    theirs = parameters["vertex_normals"].numpy().reshape(-1, 3)
    used = np.isin(np.arange(60), faces)
    np.testing.assert_allclose(vertex_normals(vertices, faces)[used], theirs[used], atol=2e-4)


def test_what_has_no_face_has_no_normal():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5], [2, 0, 0]], np.float32)
    normals = vertex_normals(vertices, np.array([[0, 1, 2], [0, 1, 4]]))
    np.testing.assert_array_equal(normals, [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0]])
