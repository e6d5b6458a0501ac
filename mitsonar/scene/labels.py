"""Names, numbers and classes of a scene's instances, which label the echoes.

A shape's id is the name of its instance; the part before the first dot is its class: "cylinder.3" is a cylinder,
"wreck" a wreck. A mesh may hold several instances, listed in ``part_names`` and ``part_of_face``. A shape with the
attribute ``seabed``, or of a class such as "seabed", is seabed; one with ``sea_surface`` is the sea surface; all other
shapes are objects.
"""
from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .protocols import PartedShape, is_sea_surface, is_seabed, parted_shape

if TYPE_CHECKING:
    import mitsuba as mi

SEABED, OBJECT = 1, 2              # kinds returned by `ShapeLabels.label_kinds`
LONGEST = 200                      # bytes of a name; channel names of EXR files, which hold it, have at most 255
SEABED_CLASSES = ("seabed", "bed", "bottom", "seafloor")


class ShapeLabels:
    """Numbers of a scene's instances: `names` and `classes` {number: name}, `class_of` {label: class}."""

    def __init__(self, shapes: Sequence[mi.Shape]):
        names = sorted({name for shape in shapes for name in _names(shape)})
        for name in names:
            check_name(name)
        self.names = dict(enumerate(names, 1))
        self._number = {name: number for number, name in self.names.items()}
        self.classes, self.class_of = classes_of(self.names)
        self.surface = next((self.of(shape) for shape in shapes if is_sea_surface(shape)), 0)
        self.seabed = frozenset(
            self._number[name] for shape in shapes for name in _names(shape)
            if is_seabed(shape)
            or class_name(name) in SEABED_CLASSES and parted_shape(shape) is None)        # parts are objects
        self.objects = frozenset(self.names) - self.seabed - {self.surface}

    def __len__(self):
        return len(self.names)

    @property
    def hides(self) -> bool:
        """Return True if there are objects that may hide a seabed."""
        return bool(self.objects) and bool(self.seabed)

    def of(self, shape: mi.Shape) -> int:
        """Return the number of a shape, or of its first part if it has parts."""
        return self._number[_names(shape)[0]]

    def of_faces(self, shape: mi.Shape, faces: int) -> np.ndarray:
        """Return the numbers of a mesh's `faces` faces, uint32 (faces,)."""
        numbers = np.array([self._number[name] for name in _names(shape)], np.uint32)
        parted = parted_shape(shape)
        return np.full(faces, numbers[0]) if parted is None else numbers[part_of_face(parted)]

    def label_kinds(self) -> np.ndarray:
        """Return the kind of every number from 0, uint32: 1 seabed, 2 object, 0 neither."""
        kinds = np.zeros(len(self.names) + 1, np.uint32)
        kinds[list(self.seabed)], kinds[list(self.objects)] = 1, 2
        return kinds


def check_name(name: str) -> None:
    """Refuse the name of an instance that is too long for the channels of an image."""
    if (length := len(name.encode(errors="surrogatepass"))) > LONGEST:
        raise ValueError(f'the id "{name[:40]}..." has {length} bytes; give at most {LONGEST}, because images have '
                         "channels of that name")


def class_name(name: str) -> str:
    """Return the class of an instance: its name up to the first dot."""
    return name.partition(".")[0] or name


def classes_of(names: Mapping[int, str]) -> tuple[dict[int, str], dict[int, int]]:
    """Number the classes of instances; return {number: class} and {label: number of its class}."""
    classes = dict(enumerate(sorted({class_name(name) for name in names.values()}), 1))
    number_of = {name: number for number, name in classes.items()}
    return classes, {number: number_of[class_name(name)] for number, name in names.items()}


def part_of_face(shape: PartedShape) -> np.ndarray:
    """Return the index of the part that each face of a mesh with several parts belongs to, (F,)."""
    return np.asarray(shape.part_of_face).astype(np.int64).ravel()


def fingerprint(meshes: Iterable[tuple[np.ndarray, np.ndarray]]) -> str:
    """Return a hash of the geometry of meshes (vertices, faces) in any order, as 16 hexadecimal digits."""
    digests = []
    for vertices, faces in meshes:
        digest = hashlib.sha256(np.ascontiguousarray(vertices, np.float32).data)
        digest.update(np.ascontiguousarray(faces, np.uint32).data)
        digests.append(digest.hexdigest())
    digests.sort()
    return hashlib.sha256("".join(digests).encode()).hexdigest()[:16]


def _names(shape: mi.Shape) -> tuple[str, ...]:
    """Return the names of a shape's parts, or its own."""
    parted = parted_shape(shape)
    return (shape.id() or shape.class_name(),) if parted is None else parted.part_names
