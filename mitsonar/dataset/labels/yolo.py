"""Annotations as YOLO's text files: a line for each, numbers as shares of the picture's width and height.

    boxes       class  x of the middle  y of the middle  width  height
    polygons    class  x y  x y  ...        one ring; the pieces of an annotation are joined by lines without area

Classes count from 0. ``data.yaml`` names them and the lists of images; programs that read the format find the text of
``images/NAME.png`` in ``labels/NAME.txt``.
"""
import json
from collections.abc import Mapping

import numpy as np

from .annotations import Annotation
from .polygons import joined, polygons

FORMS = ("boxes", "polygons")


def line(annotation: Annotation, form: str, numbers: Mapping[str, int], height: int, width: int) -> str:
    """Return the line of one annotation."""
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
