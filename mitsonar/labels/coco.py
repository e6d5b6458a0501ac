"""Annotations as COCO's JSON for object detection, a file for each subset.

Format: https://cocodataset.org/#format-data. A box is [left, upper, width, height] in picture elements from the upper
left corner of the picture. Segmentations are polygons that fill exactly the mask; ``area`` is its number of elements.
Beyond the format, an image has ``source``, ``row``, ``column``, ``ping``, ``seabed``, ``window_db`` and ``parameters``.
An image in metres has ``cell_x``, ``cell_y``, ``left`` and ``top``, and a focused image its position in the scene
(`FocusedFrame`). An annotation has ``instance``, ``side``, ``truncated``, ``visible`` and ``exposed``, and a category
its ``supercategory``.
"""
from collections.abc import Mapping, Sequence
from typing import Any

from .annotations import ENDINGS, HIGHLIGHT, SHADOW, WHOLE, Annotation, category
from .polygons import polygons
from .rules import Labels


def categories(classes: Sequence[str], rules: Labels) -> dict[str, int]:
    """Return the numbers of the categories: objects, their shadows unless left out, and on demand both as one."""
    odd = [name for name in classes if name.endswith(f" {SHADOW}")]
    if odd:
        raise ValueError(f"the class {odd[0]!r} would be taken for a shadow; give its shapes another id.")
    kinds = (HIGHLIGHT, *[SHADOW] * rules.shadows, *[WHOLE] * rules.whole)
    names = [category(name, kind) for kind in kinds for name in classes]
    return {name: number for number, name in enumerate(names, 1)}


def kind_of(name: str) -> str:
    """Return the kind of a category: ``highlight``, ``shadow`` or ``whole``."""
    return next((kind for kind in (WHOLE, SHADOW) if name.endswith(ENDINGS[kind])), HIGHLIGHT)


def entry(annotation: Annotation, number: int, image: int, numbers: Mapping[str, int],
          track: int | None = None) -> dict[str, object]:
    """Return the JSON entry of an annotation; `track` is the number of its object in a video."""
    rings = [ring + [annotation.column, annotation.row] for ring in polygons(annotation.mask)]
    return {"id": number, "image_id": image, "category_id": numbers[annotation.category], "bbox": list(annotation.box),
            "segmentation": [ring.ravel().tolist() for ring in rings], "area": annotation.bins, "iscrowd": 0,
            "instance": annotation.name, "side": annotation.side, "truncated": annotation.truncated,
            "visible": round(annotation.visible, 4),
            **({} if annotation.exposed is None else {"exposed": annotation.exposed}),
            **({} if track is None else {"track_id": track})}


def document(images: list[dict[str, Any]], entries: list[dict[str, Any]], numbers: Mapping[str, int],
             info: Mapping[str, object], videos: list[dict[str, Any]] | None = None) -> dict[str, object]:
    """Return the JSON document of images, their annotations, the category numbers, general information, and videos."""
    known = [{"id": number, "name": name, "supercategory": kind_of(name)} for name, number in numbers.items()]
    return {"info": info, "licenses": [], "images": images, "annotations": entries, "categories": known,
            **({"videos": videos} if videos else {})}
