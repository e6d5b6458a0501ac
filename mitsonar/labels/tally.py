"""Counts of labelled pictures: those with each class, those without objects, and the boxes of each class.

A negative is an object that a detector must not find. Negatives are counted by their own classes, whether they are
annotated or not.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from .annotations import HIGHLIGHT
from .coco import kind_of

NUMBERS, TABLES = ("pictures", "empty", "negative"), ("images", "boxes")
MOST = 1 << 53


class Tally:
    """Numbers of ``pictures``, of ``empty`` and ``negative`` ones, and by class of ``images`` and ``boxes``.

    A picture is empty without any object, and negative if all its objects are negatives.
    """

    def __init__(self):
        self.pictures = self.empty = self.negative = 0
        self.images: Counter[str] = Counter()
        self.boxes: Counter[str] = Counter()

    def picture(self, counts: Mapping[str, int],            # annotations by category
                negatives: Mapping[str, int], negative_class: str | None = None) -> None:
        """Add a picture."""
        boxes = {name: count for name, count in counts.items() if count and kind_of(name) == HIGHLIGHT}
        found = {name: count for name, count in negatives.items() if count}
        self.pictures += 1
        self.negative += bool(found) and not set(boxes) - {negative_class}
        self.empty += not found and not boxes
        for name, count in {**boxes, **found}.items():
            self.images[name] += 1
            self.boxes[name] += count

    def add(self, given: Mapping[str, Any]) -> None:
        """Add the numbers of `record`."""
        for name in NUMBERS:
            setattr(self, name, getattr(self, name) + given[name])
        for name in TABLES:
            getattr(self, name).update(given[name])

    def record(self) -> dict[str, Any]:
        """Return the numbers as JSON."""
        return {**{name: getattr(self, name) for name in NUMBERS},
                **{name: dict(sorted(getattr(self, name).items())) for name in TABLES}}


def checked(given: Any) -> dict[str, Any] | None:
    """Return what a file states to be such numbers; raises `ValueError` for anything else."""
    if given is None:
        return None
    if not (isinstance(given, dict) and all(_is_count(given.get(name)) for name in NUMBERS)
            and all(isinstance(given.get(name), dict) and all(map(_is_count, given[name].values()))
                    for name in TABLES)):
        raise ValueError("the numbers of labelled pictures are not whole")
    return {name: given[name] for name in (*NUMBERS, *TABLES)}


def _is_count(given):
    return isinstance(given, int) and not isinstance(given, bool) and 0 <= given < MOST
