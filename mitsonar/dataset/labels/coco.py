"""Annotations as COCO's JSON for object detection, a file for each subset.

Format: https://cocodataset.org/#format-data. A box is [left, upper, width, height] in picture elements from the upper
left corner of the first one. Segmentations are polygons, filled again exactly the mask; ``area`` counts its elements.
Beyond the format an image has ``source``, ``row``, ``column``, ``ping``, ``seabed``, ``window_db`` and ``parameters``,
one in metres ``cell_x``, ``cell_y``, ``left`` and ``top``, a focused one also its place in the scene (`FocusedFrame`);
an annotation ``instance``, ``side``, ``truncated``, ``visible`` and ``exposed``, a category its ``supercategory``.
"""
from collections.abc import Mapping, Sequence
from typing import Any

from .annotations import ENDINGS, HIGHLIGHT, SHADOW, WHOLE, Annotation, category
from .polygons import polygons


def categories(classes: Sequence[str], *, whole: bool = False) -> dict[str, int]:
    """Number the classes of objects, of their shadows, and on demand of both together."""
    odd = [name for name in classes if name.endswith(f" {SHADOW}")]
    if odd:
        raise ValueError(f"the class {odd[0]!r} would be taken for a shadow; give its shapes another id.")
    kinds = (HIGHLIGHT, SHADOW, WHOLE) if whole else (HIGHLIGHT, SHADOW)
    names = [category(name, kind) for kind in kinds for name in classes]
    return {name: number for number, name in enumerate(names, 1)}


def kind_of(name: str) -> str:
    """Return what a category is of: ``highlight``, ``shadow`` or ``whole``."""
    return next((kind for kind in (WHOLE, SHADOW) if name.endswith(ENDINGS[kind])), HIGHLIGHT)


def entry(annotation: Annotation, number: int, image: int, numbers: Mapping[str, int]) -> dict[str, Any]:
    """Return the entry of one annotation."""
    rings = [ring + [annotation.column, annotation.row] for ring in polygons(annotation.mask)]
    return {"id": number, "image_id": image, "category_id": numbers[annotation.category], "bbox": list(annotation.box),
            "segmentation": [ring.ravel().tolist() for ring in rings], "area": annotation.bins, "iscrowd": 0,
            "instance": annotation.name, "side": annotation.side, "truncated": annotation.truncated,
            "visible": round(annotation.visible, 4),
            **({} if annotation.exposed is None else {"exposed": annotation.exposed})}


def document(images: list[dict[str, Any]], entries: list[dict[str, Any]], numbers: Mapping[str, int],
             info: Mapping[str, Any]) -> dict[str, Any]:
    """Put a file together from its images, their annotations, the categories' numbers and what is said of it all."""
    known = [{"id": number, "name": name, "supercategory": kind_of(name)} for name, number in numbers.items()]
    return {"info": info, "licenses": [], "images": images, "annotations": entries, "categories": known}
