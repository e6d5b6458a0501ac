"""Shares of objects' surfaces that the sonar could see, written to labels as ``exposed``.

Points are drawn evenly over an object's surface. The share is that of points seen along a straight line, among those on
the side that faces the sonar at the ping nearest to the object. The other points are buried or hidden, perhaps by
the object itself. Refraction and the beam are left out: the share belongs to the scene, the same for every sonar.
"""
from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload

from ..geometry import Geometry

POINTS = 256                       # for each object: the share is good to about 3 %
CLEAR = 2e-3                       # [m] in front of the surface, where a line of sight begins
STREAM = 0x5ee                     # random key of the points, the same for every render of a scene


def exposed_shares(geometry: Geometry, objects: Sequence[int],
                   places: np.ndarray) -> dict[int, float]:    # places (P, 3) [m]
    """Compute the share of every object's facing surface that is seen from the sonar's nearest place."""
    samples = {label: surface for label, surface in _surfaces(geometry, set(objects)) if len(surface[0])}
    if not samples:
        return {}
    points, normals = (np.concatenate([surface[k] for surface in samples.values()]) for k in range(2))
    sonar = np.concatenate([np.broadcast_to(_nearest(surface[0], places), surface[0].shape)
                            for surface in samples.values()])
    away = sonar - points
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    faces = np.sum(away * normals, axis=1) > 0
    seen = faces & ~_blocked(geometry.scene, points + CLEAR * away, sonar)
    ends = np.cumsum([len(surface[0]) for surface in samples.values()])[:-1]
    return {label: round(float(lit.sum() / max(1, front.sum())), 3)
            for label, lit, front in zip(samples, np.split(seen, ends), np.split(faces, ends))}


def bodies_exposed(geometry: Geometry, place: np.ndarray) -> dict[int, float]:    # place (3,) [m]
    """Compute the same share of every moving object's surface where it stands, seen from a place."""
    if geometry.body_samples is None:
        samples = {number: surface for number, surface in _at_rest(geometry) if len(surface[0])}
        geometry.body_samples = (np.repeat(list(samples), POINTS), *(np.concatenate(
            [surface[k] for surface in samples.values()] or [np.zeros((0, 3))]) for k in range(2)))
    number, points, normals = geometry.body_samples
    if not len(number):
        return {}
    points, normals = geometry.carried(number, points), geometry.carried(number, points, normals)
    away = place - points
    away /= np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
    faces = np.sum(away * normals, axis=1) > 0
    seen = faces & ~_blocked(geometry.scene, points + CLEAR * away, np.broadcast_to(place, points.shape))
    lit, front = (part.reshape(-1, POINTS).sum(1) for part in (seen, faces))
    label = np.array([geometry.bodies[body].label for body in number[::POINTS]])
    return {int(own): round(float(lit[label == own].sum() / max(1, front[label == own].sum())), 3)
            for own in dict.fromkeys(label)}


def _at_rest(geometry: Geometry):
    """Yield the numbers of moving objects with points (N, 3) on their surfaces and normals there, in their own frames.
    """
    faces = geometry.faces.numpy().reshape(-1, 4)
    first_faces = {shape.id(): slice(first, first + count) for _, shape, first, count in geometry.meshes}
    for number, body in enumerate(geometry.bodies):
        if body.copy is not None:
            own = faces[first_faces[body.part.id()], :3].astype(int) - body.first_vertex
            inside = (own[:, 0] >= 0) & (own[:, 0] < len(body.part.rest))
            yield number, _on_facets(body.part.rest[own[inside]], body.label)


def _surfaces(geometry: Geometry, wanted: set[int]):
    """Yield labels with points (N, 3) on their surface and the normals there, outward on closed meshes."""
    for _, shape, first, count in geometry.meshes:
        labels = geometry.named.of_faces(shape, count)
        present = wanted.intersection(np.unique(labels).tolist())
        if not present:
            continue
        vertices, faces = geometry.mesh(first, count)
        for label in sorted(present):
            yield label, _on_facets(vertices[faces[labels == label]].astype(float), label)
    for _, shape in geometry.others:
        label = geometry.named.of(shape)
        if label in wanted and shape.class_name() != "Instance":           # which Mitsuba cannot draw points on
            share = np.random.default_rng([STREAM, label]).random((2, POINTS)).astype(np.float32)
            sample = shape.sample_position(0.0, mi.Point2f(*(upload(mi.Float, row) for row in share)))
            point, normal = (column.numpy().T.astype(float) for column in (sample.p, sample.n))
            yield label, (np.broadcast_to(point, (POINTS, 3)), np.broadcast_to(normal, (POINTS, 3)))


def _on_facets(corners: np.ndarray, label: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points spread evenly over triangles (F, 3, 3), and their normals."""
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=1)
    if not area.sum() > 0:
        return np.zeros((0, 3)), np.zeros((0, 3))
    share = np.random.default_rng([STREAM, label]).random((3, POINTS))
    face = np.searchsorted(np.cumsum(area) / area.sum(), share[0], side="right").clip(0, len(area) - 1)
    root, second = np.sqrt(share[1])[:, None], share[2][:, None]
    first, other, third = corners[face].transpose(1, 0, 2)
    return (1 - root) * first + root * (1 - second) * other + root * second * third, across[face] / area[face, None]


def _nearest(points: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the place (3,) nearest to the middle of points (N, 3)."""
    return places[np.linalg.norm(places - points.mean(0), axis=1).argmin()]


def _blocked(scene: mi.Scene, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return True where something lies between points (N, 3) and (N, 3)."""
    length = np.linalg.norm(end - start, axis=1)
    origin, direction = (mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in vectors.T))
                         for vectors in (start, (end - start) / np.maximum(length, 1e-9)[:, None]))
    ray = mi.Ray3f(mi.Point3f(origin), direction, upload(mi.Float, length.astype(np.float32)), mi.Float(0),
                   mi.Color0f())
    return dr.detach(scene.ray_test(ray)).numpy().astype(bool)
