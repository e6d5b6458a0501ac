"""Several scenes of one plan: each has keys of its own under ``[[scenes]]``, and those at the head of the plan.

A parameter at the head is one of every scene. A scene that gives it itself has its own instead.
"""
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from mitsonar.device.spelling import meant

from .. import recipe as recipes
from ..recipe import Recipe, recipe_of, section
from ..values import number, shortened

NAME = re.compile(r"[A-Za-z0-9][\w-]{0,49}", re.ASCII)           # of a scene
MOST_SCENES = 100
OF_SCENE = ("name", "share", *recipes.KEYS)
PARAMETERS = ("set", "list", "grid", "draw")


def parts_of(given: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the keys of each scene of a plan; with those at the head of the plan if it has several."""
    if "scenes" not in given:
        return [given]
    entries = given["scenes"]
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries) or not entries:
        raise ValueError(f"scenes is {shortened(entries)}; write [[scenes]] for each of several scenes")
    if len(entries) > MOST_SCENES:
        raise ValueError(f"the plan has {len(entries)} scenes; give at most {MOST_SCENES}")
    if "scene" in given or "samples" in given:
        key = "scene" if "scene" in given else "samples"
        raise ValueError(f"{key} is given beside [[scenes]]; "
                         + ("leave one out" if key == "scene" else "give renders, the number of all together"))
    return [_with_head(given, entry, f"scenes[{number}]") for number, entry in enumerate(entries)]


def _with_head(head, entry, where):
    """Return the keys of a scene; a parameter of its own replaces the one at the head of the plan."""
    unknown = next((key for key in entry if key not in OF_SCENE), None)
    if unknown is not None:
        raise ValueError(f"{where} has the unknown key {shortened(unknown)}{meant(unknown, OF_SCENE)}; known: "
                         f"{', '.join(OF_SCENE)}")
    own = {name for key in PARAMETERS for name, _ in section(entry, key)}
    common = {key: {name: item for name, item in section(head, key) if name not in own}
              for key in PARAMETERS if key in head}
    merged = {key: {**common.get(key, {}), **dict(section(entry, key))} for key in PARAMETERS}
    merged |= {key: {**dict(section(head, key)), **dict(section(entry, key))} for key in ("together", "labels")}
    return {**{key: head[key] for key in ("seeds", "redraw", "table", "rows") if key in head}, **entry, **merged}


def recipes_of(parts: Sequence[Mapping[str, Any]], place: str, seed: int, several: bool) -> Iterator[Recipe]:
    """Yield the recipes of all scenes of a plan, from the keys of each."""
    seen = set()
    for number_of, part in enumerate(parts):
        if "scene" not in part:
            raise ValueError('the plan names no scene; write scene = "FILE.xml" at its beginning' if not several else
                             f"scenes[{number_of}] names no scene; write scene = \"FILE.xml\" under [[scenes]]")
        if not several:
            yield recipe_of(part, place, seed)
            return
        name = part.get("name", os.path.splitext(os.path.basename(str(part["scene"])))[0])
        if not isinstance(name, str) or not NAME.fullmatch(name):
            raise ValueError(f"the name of scenes[{number_of}] is {shortened(name)}; give a name of letters, digits, _ "
                             "and -")
        if name.lower() in seen:
            raise ValueError(f"two scenes are named {name}; give one of them another name = \"...\"")
        seen.add(name.lower())
        share = number(part.get("share", 1), f"scenes.{name}.share")
        if not 1e-6 <= share <= 1e6:
            raise ValueError(f"scenes.{name}.share is {share}; give a share from 1e-6 to 1e6")
        try:
            yield replace(recipe_of(part, place, f"{seed}:{name}", name), share=float(share))
        except ValueError as error:
            raise ValueError(f"scene {name}: {error}") from None
