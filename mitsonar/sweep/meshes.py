"""Meshes that a scene shows, with what their folders state about them: class, licence, author, source.

Of `targets` these are the species that were placed; of shapes that are files themselves, those of the scene's XML.
"""
from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from mitsonar.io.scene_files import meshes, scenes
from mitsonar.io.scene_files.mesh_lists import MeshStatement, statement
from mitsonar.scene.labels import class_name
from mitsonar.scene.protocols import strewn_shape

from .manifest import sha256

if TYPE_CHECKING:
    import mitsuba as mi


def meshes_of(scene: mi.Scene, path: str, parameters: Mapping[str, str]) -> list[dict[str, str]]:
    """Return an entry for every mesh in a scene that was loaded from a file with parameters, sorted by name."""
    found = {(os.path.abspath(file), name): stated
             for file, name, stated in (*_strewn(scene), *_files(path, parameters))}
    return sorted(({"mesh": os.path.splitext(os.path.basename(file))[0], "class": name, "licence": stated.licence,
                    "author": stated.author, "source": stated.source, "sha256": _digest(file)}
                   for (file, name), stated in found.items()), key=lambda entry: (entry["mesh"], entry["sha256"]))


def _strewn(scene) -> Iterator[tuple[str, str, MeshStatement]]:
    """Yield path, class and statement of the meshes of placed targets."""
    for shape in scene.shapes():
        sources: Any = getattr(shape, "mesh_sources", None)
        if (strewn := strewn_shape(shape)) is None or not sources:
            continue
        for species in sorted({entry["species"] for entry in strewn.placed.values()} & set(sources)):
            file, stated = sources[species]
            yield file, stated.class_name or species, stated


def _files(path, parameters) -> Iterator[tuple[str, str, MeshStatement]]:
    """Yield path, class and statement of the shapes of a scene that are meshes by themselves."""
    queue = [path]
    for file in queue:
        root = scenes.root(file)
        values = {element.get("name", ""): element.get("value", "") for element in root.iter("default")}
        values.update(parameters)
        for element in root.iter("include"):
            included = _found(scenes.filled(element.get("filename", ""), values), path)
            if included is not None and included not in queue:
                queue.append(included)
        parents = {child: parent for parent in root.iter() for child in parent}
        for shape in root.iter("shape"):
            name = next((text.get("value", "") for text in shape if text.get("name") == "filename"), "")
            if f".{shape.get('type')}" in meshes.KINDS:
                mesh = _found(scenes.filled(name, values), path)
                if mesh is not None:
                    moving = parents.get(shape)
                    identity = shape.get("id") or (moving.get("id") if moving is not None else None)
                    yield mesh, class_name(scenes.filled(identity or shape.get("type", ""), values)), statement(mesh)


def _found(name, scene):
    """Return the path of a file that a scene names, or None."""
    return next((path for path in (os.path.join(os.path.dirname(scene), name), name) if os.path.isfile(path)), None)


def _digest(path):
    stat = os.stat(path)
    return _known_digest(path, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=1000)
def _known_digest(path, *_):
    return sha256(path)
