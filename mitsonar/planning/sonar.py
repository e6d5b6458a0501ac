"""Sonar of a plan, from a preset of `multibeam` or from a scene."""
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
    """Return the fields of `SwathSonar` that a preset or a scene states (angles in degrees), and its ``cast``."""
    if name in (known := presets(KIND)):
        return _fields(known[name]) | {"name": name}
    if not name.lower().endswith(".xml") and name not in scenes.shipped():
        raise ValueError(f"there is no preset {name!r} of {KIND}{meant(name, list(known))}, nor a scene of that name; "
                         f"presets are {', '.join(known)}.")
    return _of_scene(scenes.find(name))


def _fields(preset: dict[str, Any]) -> dict[str, Any]:
    return {"swath_deg": float(preset["swath_deg"]), "beams": int(preset["beams"]) * int(preset["swaths"]),
            "even": str(preset["beam_spacing"]), "beam_width_deg": float(preset["transmit_beam_width_deg"])}


def _of_scene(path: str) -> dict[str, Any]:
    """Return the fields that a scene's sensor states, with defaults filled in."""
    scenes.check(path, {})
    root = scenes.root(path)
    values: dict[str, str] = {}
    for element in root.iter("default"):
        values.setdefault(element.get("name", ""), scenes.filled(element.get("value", ""), values))
    sensor = next((element for element in root.iter("sensor") if element.get("type") == KIND), None)
    if sensor is None:
        raise ValueError(f"the scene {path} has no sensor of type {KIND}; give another scene, or a preset.")
    stated = _said(sensor, values)
    preset = str(stated.get("preset", DEFAULT_PRESET))
    if preset not in presets(KIND):
        raise ValueError(f"{path}: there is no preset {preset!r} of {KIND}; presets are {', '.join(presets(KIND))}.")
    try:
        fields = _fields(presets(KIND)[preset] | stated) | {"name": preset}
        if any(float(angle) for angle in str(stated.get("mounting_deg", "0")).replace(",", " ").split()[:2]):
            raise ValueError("its head is not mounted level, and a plan needs a level head")
        start = sensor.find("point[@name='start']")
        if "depth" in stated or start is not None:
            z = 0.0 if start is None else float(scenes.filled(start.get("z", "0"), values))
            fields["head_depth"] = float(stated["depth"]) if "depth" in stated else -z
        film = sensor.find("film")
        if film is not None and "range" in (window := _said(film, values)):
            fields["max_range"] = float(window["range"])
    except ValueError as error:
        raise ValueError(f"{path}: the sensor {KIND}: {error}; give --swath and further options instead.") from None
    medium = sensor.find("medium")
    cast = None if medium is None else _said(medium, values).get("cast")
    if cast:
        beside = os.path.join(os.path.dirname(path), cast)
        fields["cast"] = beside if os.path.exists(beside) else cast
    return fields


def _said(element: ElementTree.Element, values: dict[str, str]) -> dict[str, str]:
    """Return the non-empty attributes of an element by name."""
    return {child.get("name", ""): value for child in element if child.tag in _TAGS
            and (value := scenes.filled(child.get("value", ""), values)).strip()}
