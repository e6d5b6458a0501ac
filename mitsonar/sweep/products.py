"""Product of a sweep's renders, by the suffix of their names.

    .exr            images
    .tar            samples: labelled pictures, with the rules of the table ``[labels]``
    .nc, .gsf, ...  lines of soundings, with the options of the table ``[soundings]``
"""
import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, get_args

from mitsonar.device.spelling import meant
from mitsonar.imaging.gain import Tvg
from mitsonar.io import casts, survey_lines
from mitsonar.io.grids.separation import Separation
from mitsonar.io.tracks import tides
from mitsonar.labels.frames import FORMS as PICTURES
from mitsonar.labels.rules import Labels
from mitsonar.labels.samples import SampleRules
from mitsonar.labels.yolo import FORMS as YOLO

from .manifest import sha256
from .values import number, shortened, whole

MOST_SNIPPETS = 10_000
IMAGE, SAMPLE = ".exr", ".tar"
SUFFIXES = (IMAGE, SAMPLE, *survey_lines.SUFFIXES)
FILES = {"profile": casts.read, "tide": tides.load, "separation": lambda path: Separation(path=path)}
HEIGHTS = ("tide", "gnss")
RULES = ("arrays", *(field.name for field in fields(Labels)
                    if field.name != "classes" and not field.name.startswith("split")))
PAIRS, NUMBERS = ("tile", "window"), ("threshold", "above_noise_db", "min_visible", "min_contrast", "overlap")
CHOICES = {"yolo": YOLO, "form": PICTURES, "tvg": get_args(get_args(Tvg)[0])}
LARGEST_TILE = 1 << 31             # pings or bins
OPTIONS = (*FILES, "heights", "column", "snippets", "place", "start")


def soundings_of(given: dict[str, Any], suffix: str, folder: str, previews: bool) -> dict[str, Any] | None:
    """Return the checked options of lines of soundings, with absolute paths of files; None for pictures."""
    if suffix in (IMAGE, SAMPLE):
        if given:
            raise ValueError("[soundings] is given, but output names pictures; let its names end in "
                             f"{', '.join(survey_lines.SUFFIXES)}, or leave [soundings] out")
        return None
    if previews:
        raise ValueError(f"previews are of pictures, and output names soundings ({suffix}); leave previews out")
    options = {}
    for name, value in given.items():
        if name not in OPTIONS:
            raise ValueError(f"soundings.{name} is unknown{meant(name, OPTIONS)}; known: {', '.join(OPTIONS)}")
        options[name] = _checked(name, value, folder)
    place = options.get("place")
    survey_lines.check_asked(None if place is None else (place[0], place[1]), options.get("start"))
    return options


def labels_of(given: dict[str, Any], suffix: str, previews: bool,
              classes: Sequence[str] | None) -> dict[str, Any] | None:
    """Return the checked rules of samples; None for other products."""
    if suffix != SAMPLE:
        if given:
            raise ValueError("[labels] is given, but output does not name samples; let its names end in .tar, or leave "
                             "[labels] out")
        return None
    if previews:
        raise ValueError("previews are of images, and samples hold pictures of their own; leave previews out")
    if not classes:
        raise ValueError("samples (.tar) number the classes of objects before the first image is made; give classes at "
                         "the head of the plan")
    unknown = next((name for name in given if name not in RULES), None)
    if unknown is not None:
        raise ValueError(f"labels.{unknown} is unknown{meant(unknown, RULES)}; known: {', '.join(RULES)}")
    sample_rules(given, classes)
    return given


def sample_rules(given: dict[str, Any], classes: Sequence[str]) -> SampleRules:
    """Return the rules of samples; raises `ValueError` if a value is wrong."""
    for name, value in given.items():
        _check_rule(name, value)
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
    arrays = values.pop("arrays", ())
    if not (isinstance(arrays, tuple) and all(isinstance(name, str) for name in arrays)):
        raise ValueError(f"labels.arrays is {shortened(given['arrays'])}; give a list of variables, such as "
                         "[\"level\"]")
    try:
        return SampleRules(labels=Labels(**{"coco": True, "masks": True, **values}, classes=list(classes)),
                           arrays=arrays)
    except ValueError as error:
        raise ValueError(f"[labels]: {error}") from None


def _check_rule(name: str, value: Any) -> None:
    """Raise `ValueError` for a rule of another kind."""
    where = f"labels.{name}"
    if name in PAIRS:
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{where} is {shortened(value)}; give a list of two numbers")
        for part in value:
            whole(part, where, 1, LARGEST_TILE) if name == "tile" else number(part, where)
    elif name in CHOICES:
        if value not in CHOICES[name]:
            raise ValueError(f"{where} is {shortened(value)}; give {' or '.join(CHOICES[name])}")
    elif name == "negatives":
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise ValueError(f"{where} is {shortened(value)}; give a list of classes, such as [\"rounded_stone\"]")
    elif name == "negative_class":
        if not isinstance(value, str):
            raise ValueError(f"{where} is {shortened(value)}; give the name of a class, such as \"clutter\"")
    elif name == "smallest":
        whole(value, where, 1, LARGEST_TILE)
    elif name == "cell":
        if number(value, where) <= 0:
            raise ValueError(f"{where} is {value}; give a length above 0, such as 0.05")
    elif name in NUMBERS:
        number(value, where)
    elif name != "arrays" and not isinstance(value, bool):
        raise ValueError(f"{where} is {shortened(value)}; give true or false")


def _checked(name: str, value: Any, folder: str) -> Any:
    where = f"soundings.{name}"
    if name == "column":
        if not isinstance(value, bool):
            raise ValueError(f"{where} is {shortened(value)}; give true or false")
        return value
    if name == "snippets":
        return whole(value, where, 0, MOST_SNIPPETS)
    if name == "place":
        if not isinstance(value, list) or len(value) != 2:
            raise ValueError(f"{where} is {shortened(value)}; give latitude and longitude, such as [54.3, 10.1]")
        return [number(part, where) for part in value]
    if name == "tide" and not isinstance(value, str):
        level = float(number(value, where))
        if abs(level) > tides.HIGHEST:
            raise ValueError(f"{where} is {level:g} m; give a water level within +-{tides.HIGHEST:g} m, or a file")
        return level
    if name == "separation" and not isinstance(value, str):
        return float(number(value, where))
    if name == "heights" and value not in HEIGHTS:
        raise ValueError(f"{where} is {shortened(value)}; give {' or '.join(HEIGHTS)}")
    if not isinstance(value, str) or not value or not value.isprintable():
        raise ValueError(f"{where} is {shortened(value)}; give a text")
    if name in ("start", "heights"):
        return value
    path = os.path.join(folder, value)
    FILES[name](path)
    return path


def options_digest(options: dict[str, Any]) -> str:
    """Return a SHA-256 of the options of a product, with the content of their files."""
    held = {name: sha256(value) if name in FILES and isinstance(value, str) else value
            for name, value in options.items()}
    return hashlib.sha256(json.dumps(held, sort_keys=True).encode()).hexdigest()
