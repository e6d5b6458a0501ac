"""Annotations as YOLO text files: a line for each, in shares of the picture's width and height.

    boxes       class  x of the middle  y of the middle  width  height
    polygons    class  x y  x y  ...        one ring; double lines without area join the pieces of an annotation

Classes count from 0. ``data.yaml`` has their names and the lists of images; readers expect the text of
``images/NAME.png`` in ``labels/NAME.txt``.
"""
import json
from collections.abc import Mapping

import numpy as np

from .annotations import Annotation
from .polygons import joined, polygons

FORMS = ("boxes", "polygons")


def line(annotation: Annotation, form: str, numbers: Mapping[str, int], height: int, width: int) -> str:
    """Return the line of an annotation."""
    if form == "boxes":
        left, upper, wide, high = annotation.box
        values = np.array([left + wide / 2, upper + high / 2, wide, high]).reshape(2, 2) / [width, height]
    else:
        values = (joined(polygons(annotation.mask)) + [annotation.column, annotation.row]) / [width, height]
    return " ".join([str(numbers[annotation.category] - 1), *(f"{value:.6g}" for value in values.ravel())])


def data_yaml(lists: Mapping[str, str], numbers: Mapping[str, int], note: str = "") -> str:
    """Return the text of ``data.yaml``."""
    lines = [f"# {note}"] * bool(note) + [f"{subset}: {place}" for subset, place in lists.items()]
    lines += ["names:", *(f"  {number - 1}: {json.dumps(name, ensure_ascii=False)}"
                          for name, number in numbers.items())]
    return "\n".join(lines) + "\n"
