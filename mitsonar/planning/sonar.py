"""The sonar of a plan, from a preset of `multibeam` or from a scene with one."""
from __future__ import annotations

import os
from typing import Any
from xml.etree import ElementTree

from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scenes
from mitsonar.sonar.preset_tables import presets

KIND, DEFAULT_PRESET = "multibeam", "shallow_400khz"
_TAGS = ("string", "float", "integer")


def planned_sonar(name: str) -> dict[str, Any]:
    """Return the fields of `SwathSonar` that a preset or a scene states, and its cast if it names one.

    ``swath_deg`` stands in place of swath. `ValueError` if there is no such preset, scene or sensor.
    """
    known = presets(KIND)
    if name in known:
        return _fields(known[name]) | {"name": name}
    if not name.lower().endswith(".xml") and name not in scenes.shipped():
        raise ValueError(f"there is no preset {name!r} of {KIND}{meant(name, list(known))}, nor a scene of that name; "
                         f"presets are {', '.join(known)}.")
    return _of_scene(scenes.find(name))


def _fields(about: dict[str, Any]) -> dict[str, Any]:
    return {"swath_deg": float(about["swath_deg"]), "beams": int(about["beams"]) * int(about["swaths"]),
            "even": str(about["beam_spacing"])}


def _of_scene(path: str) -> dict[str, Any]:
    """Return what a scene's sensor states, its defaults filled in."""
    scenes.check(path, {})
    root = scenes.root(path)
    values: dict[str, str] = {}
    for one in root.iter("default"):
        values.setdefault(one.get("name", ""), scenes.filled(one.get("value", ""), values))
    sensor = next((one for one in root.iter("sensor") if one.get("type") == KIND), None)
    if sensor is None:
        raise ValueError(f"the scene {path} has no sensor of type {KIND}; give one that has, or a preset.")
    said = _said(sensor, values)
    preset = str(said.get("preset", DEFAULT_PRESET))
    if preset not in presets(KIND):
        raise ValueError(f"{path}: there is no preset {preset!r} of {KIND}; presets are {', '.join(presets(KIND))}.")
    try:
        found = _fields(presets(KIND)[preset] | said) | {"name": preset}
        if any(float(angle) for angle in str(said.get("mounting_deg", "0")).replace(",", " ").split()[:2]):
            raise ValueError("its head is not mounted level, and a plan is made for level ones")
        start = sensor.find("point[@name='start']")
        if "depth" in said or start is not None:
            z = 0.0 if start is None else float(scenes.filled(start.get("z", "0"), values))
            found["head_depth"] = float(said["depth"]) if "depth" in said else -z
        film = sensor.find("film")
        if film is not None and "range" in (window := _said(film, values)):
            found["max_range"] = float(window["range"])
    except ValueError as error:
        raise ValueError(f"{path}: the sensor {KIND}: {error}; give --swath and what else is wanted.") from None
    medium = sensor.find("medium")
    cast = None if medium is None else _said(medium, values).get("cast")
    if cast:
        beside = os.path.join(os.path.dirname(path), cast)
        found["cast"] = beside if os.path.exists(beside) else cast
    return found


def _said(element: ElementTree.Element, values: dict[str, str]) -> dict[str, str]:
    """Return the attributes of an element by name, but empty ones."""
    found = {one.get("name", ""): scenes.filled(one.get("value", ""), values) for one in element if one.tag in _TAGS}
    return {name: value for name, value in found.items() if value.strip()}
