"""Attributes of an image that describe its scene: the objects' boxes and classes, and a hash of the seabed."""
from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np
import xarray as xr

from .geometry import Geometry
from .labels import class_name, fingerprint
from .moving import moving_shape
from .protocols import strewn_shape
from .shadows.exposure import bodies_exposed, exposed_shares

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
        if (moving := moving_shape(shape)) is not None:
            if geometry.moment is not None and geometry.moment[0].shapes:
                _widen(boxes, int(labels[0]), *geometry.moment[0].box(moving))
            continue
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
    moving = {body.label for body in geometry.bodies}
    shown = exposed_shares(geometry, [label for label in boxes if label in named.objects and label not in moving],
                           places)
    objects = {str(label): {"class": class_name(named.names[label]),
                            "lower": [round(float(v), 4) for v in low], "upper": [round(float(v), 4) for v in high],
                            **({"exposed": shown[label]} if label in shown else {}),
                            **placed.get(named.names[label], {})}
               for label, (low, high) in sorted(boxes.items()) if label in named.objects}
    return {"objects": objects, "seabed": fingerprint(beds) if beds else ""}


def standing(known: Mapping[str, Any], geometry: Geometry, place: np.ndarray) -> dict[str, Any]:
    """Return the attributes of a scene at one ping, with the boxes, places and velocities of its moving objects."""
    # place (3,) [m]: the sonar's
    if not geometry.bodies:
        return dict(known)
    shown = bodies_exposed(geometry, place)
    objects = dict(known["objects"])
    for body, stand, low, high in geometry.body_boxes():
        numbers = {"lower": low, "upper": high, "position": stand.position, "velocity": stand.velocity}
        rounded = {name: [round(float(v), 4) for v in value] for name, value in numbers.items()}
        exposed = {"exposed": shown[body.label]} if body.label in shown else {}
        objects[str(body.label)] = {**objects[str(body.label)], **rounded, **exposed}
    return {**known, "objects": objects}


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
