"""Attributes of an image that describe its scene: the objects' boxes and classes, and a hash of the seabed."""
from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import cast

import mitsuba as mi
import numpy as np
import xarray as xr

from .geometry import Geometry
from .labels import class_name, fingerprint
from .protocols import strewn_shape
from .shadows.exposure import exposed_shares


def scene_of(shapes: Sequence[mi.Shape]) -> mi.Scene:
    """Return a scene of these shapes alone, which keep their ids, to trace rays against them."""
    names = [shape.id() for shape in shapes]
    scene = mi.load_dict({"type": "scene", **{f"part{number}": shape for number, shape in enumerate(shapes)}},
                         optimize=False)
    # Mitsuba has renamed the shapes after their keys
    for shape, name in zip(shapes, names):
        shape.set_id(name)
    return cast(mi.Scene, scene)


MOST_NAMES = 5                     # in the warning about objects that no ping sees


def annotated(image: xr.Dataset, classes: dict[int, str], class_of: dict[int, int], geometry: Geometry,
              places: np.ndarray) -> xr.Dataset:    # places (P, 3) [m]: the sonar's
    """Return an image with attributes that describe its scene, and with the names of objects that it does not show."""
    image = image.assign_attrs(known(classes, class_of, geometry, places))
    return image.assign_attrs(unseen=unseen(image))


def known(classes: dict[int, str], class_of: dict[int, int], geometry: Geometry,
          places: np.ndarray) -> dict[str, object]:
    """Return the attributes that all images of a scene share; arguments as in `annotated`."""
    return {"classes": {str(number): name for number, name in classes.items()},
            "label_class": {str(label): number for label, number in class_of.items()}, **described(geometry, places)}


def described(geometry: Geometry, places: np.ndarray) -> dict[str, object]:
    """Return the attributes ``objects`` and ``seabed`` of a scene."""
    named = geometry.named
    boxes, placed, beds = {}, {}, []
    for _, shape, first, count in geometry.meshes:
        labels = named.of_faces(shape, count)
        if (strewn := strewn_shape(shape)) is not None:
            placed.update(strewn.placed)
        elif int(labels[0]) in named.seabed:
            beds.append(geometry.mesh(first, count))
            continue
        if (labels == labels[0]).all():
            _widen(boxes, int(labels[0]), shape.bbox())
            continue
        vertices, faces = geometry.mesh(first, count)
        for label in np.unique(labels):
            corners = vertices[faces[labels == label]].reshape(-1, 3)
            _widen(boxes, int(label), corners.min(0), corners.max(0))
    for _, shape in geometry.others:
        label = named.of(shape)
        if label in named.seabed:
            beds.append(_fingerprint_of(shape))
        _widen(boxes, label, shape.bbox())
    shown = exposed_shares(geometry, [label for label in boxes if label in named.objects], places)
    objects = {str(label): {"class": class_name(named.names[label]),
                            "lower": [round(float(v), 4) for v in low], "upper": [round(float(v), 4) for v in high],
                            **({"exposed": shown[label]} if label in shown else {}),
                            **placed.get(named.names[label], {})}
               for label, (low, high) in sorted(boxes.items()) if label in named.objects}
    return {"objects": objects, "seabed": fingerprint(beds) if beds else ""}


def unseen(image: xr.Dataset, *, warn: bool = True) -> list[str]:
    """Return the names of objects with neither an echo nor a shadow in an image, and warn of them."""
    seen = {*(np.flatnonzero(np.any(image["share"].values, axis=tuple(range(1, image["share"].ndim)))) + 1).tolist(),
             *np.unique(image["object_shadow"].values).tolist()}
    names = [image.attrs["labels"][label] for label in image.attrs["objects"] if int(label) not in seen]
    if names and warn:
        more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
        warnings.warn(f"no ping sees {', '.join(names[:MOST_NAMES])}{more}: out of range, beyond the track, hidden or "
                      "buried", stacklevel=2)
    return names


def _fingerprint_of(shape):
    """Return numbers that distinguish a shape without facets, and the bytes of its type's name."""
    known = mi.traverse(shape)
    matrix = known["to_world"].matrix if "to_world" in known else ()
    # entry by entry: the whole would compile a kernel, another one for every matrix
    numbers = [float(entry[0]) for row in matrix for entry in row]
    kind = np.frombuffer(shape.class_name().encode(), np.uint8)
    return np.array([*shape.bbox().min, *shape.bbox().max, *numbers]), kind


def _widen(boxes, label, low, high=None):
    """Widen the box of an instance so that it holds another box."""
    if high is None:
        low, high = low.min, low.max
    low, high = np.array(low, float), np.array(high, float)
    if label in boxes:
        low, high = np.minimum(low, boxes[label][0]), np.maximum(high, boxes[label][1])
    boxes[label] = low, high
