"""Facets of smooth surfaces: cells that tile them, the bent surface over them, meshes that are too coarse.

Spheres of radius R: a facet l long lies l²/8R below them; cells laid on the quadratic surface over it lie within
(l/R)² of that, 2 % here.
"""
import warnings

import numpy as np
import pytest

from mitsonar.echoes.smooth.facets import SmoothFacets, too_coarse, warn_where_too_coarse
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.loading import prepare

CENTRE = np.array([1.0, 2.0, -8.0])


def ball(steps, radius=0.5):
    """Triangles of a sphere about the origin, and its corners."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, steps + 1), np.linspace(0, 2 * np.pi, 2 * steps + 1), indexing="ij")
    point = radius * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    a, b, c, d = point[:-1, :-1], point[1:, :-1], point[1:, 1:], point[:-1, 1:]
    return np.concatenate([np.stack(abc, -2).reshape(-1, 3, 3) for abc in ((a, b, c), (a, c, d))])


def box():
    """A cube of twelve triangles."""
    corner = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corner[[q for a, b, c, d in quads for q in ((a, b, c), (a, c, d))]]


def scene(tmp_path, shape, corners=None):
    import mitsuba as mi

    prepare()
    if corners is not None:
        path = tmp_path / "mesh.obj"
        lines = ["v {:.9g} {:.9g} {:.9g}".format(*v) for v in corners.reshape(-1, 3) + CENTRE]
        path.write_text("\n".join([*lines, *(f"f {3 * i + 1} {3 * i + 2} {3 * i + 3}" for i in range(len(corners)))]))
        shape = {"type": "obj", "filename": str(path), "face_normals": True}
    return Geometry(mi.load_dict({"type": "scene", "hull": {**shape, "bsdf": {"type": "rigid"}}}, optimize=False))


def every_cell(facets, n):
    import mitsuba as mi

    count = len(facets) * n * n
    cell = np.arange(count)
    return facets.cells(*(mi.UInt32(v.astype(np.uint32)) for v in (cell // (n * n), cell % (n * n), np.full(count, n))))


@pytest.mark.parametrize("n", [1, 3])
def test_cells_lie_on_the_sphere_and_tile_it(variant, tmp_path, n):
    geometry = scene(tmp_path, {"type": "sphere", "center": list(CENTRE), "radius": 0.5})
    facets = SmoothFacets(geometry, 0.015)
    cells = every_cell(facets, n)
    corners = np.stack([corner.numpy().T + cells.point.numpy().T for corner in cells.corners], 1)
    good = cells.area.numpy() > 1e-9
    off = np.abs(np.linalg.norm(corners[good] - CENTRE, axis=-1) - 0.5)
    assert off.max() < 0.02 * 2e-4
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(np.pi, rel=1e-3)
    assert facets.convex and set(facets.outward) == {1} or set(facets.outward) == {-1}


def test_what_is_convex(variant, tmp_path):
    assert SmoothFacets(scene(tmp_path, {"type": "rectangle"}), 0.015).convex
    assert SmoothFacets(scene(tmp_path, {}, box()), 0.015).convex
    corner = box()[:4]                                                  # two sides: a dihedral
    assert not SmoothFacets(scene(tmp_path, {}, corner), 0.015).convex
    assert not SmoothFacets(scene(tmp_path, {"type": "cylinder"}), 0.015).convex


def test_flat_facets_are_not_cut(variant, tmp_path):
    assert set(SmoothFacets(scene(tmp_path, {}, box()), 0.015).fewest) == {1}


@pytest.mark.parametrize("steps", [16, 24])
def test_coarse_meshes_are_told_of(variant, tmp_path, steps):
    edge = np.pi * 0.5 / steps
    sagitta, wanted = too_coarse(ball(steps), 0.015)
    assert sagitta == pytest.approx(edge ** 2 / 8 / 0.5, rel=0.1)
    assert wanted == pytest.approx(np.sqrt(0.5 * 0.015 / 2), rel=0.1)
    with pytest.warns(UserWarning, match='mesh "hull" is too coarse for a wavelength of 15 mm.*edges of at most'):
        warn_where_too_coarse(scene(tmp_path, {}, ball(steps)), 0.015)


def test_fine_meshes_and_boxes_are_not(variant, tmp_path):
    assert too_coarse(ball(80), 0.015) is None
    assert too_coarse(box(), 0.015) is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_where_too_coarse(scene(tmp_path, {}, box()), 0.015)
        warn_where_too_coarse(scene(tmp_path, {"type": "sphere"}), 0.015)
