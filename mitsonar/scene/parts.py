"""Scenes of some of a scene's shapes: what rays are traced against that look for one kind of thing alone."""
from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import mitsuba as mi

__all__ = ["scene_of"]


def scene_of(shapes: Sequence[mi.Shape]) -> mi.Scene:
    """Make a scene of shapes that belong to another one, which keep their names."""
    names = [shape.id() for shape in shapes]
    scene = mi.load_dict({"type": "scene", **{f"part{number}": shape for number, shape in enumerate(shapes)}},
                         optimize=False)
    # Mitsuba names what it is given after its key
    for shape, name in zip(shapes, names):
        shape.set_id(name)
    return cast(mi.Scene, scene)
