"""Water and geometry are asked for a ping: nothing takes the first ping's answer for all, unless it says so here.

Read from the sources by AST. What a record states once, or what all pings share, is named with its reason.
"""
import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for room in ("mitsonar", "plugins") for path in (ROOT / room).rglob("*.py"))
#: files that read the water of the first ping, and what for
FIRST = {
    "mitsonar/survey/fan/forward_looking.py": "absorption that a picture's gain uses, an attribute",
    "mitsonar/survey/echo_sounder/kind.py": "absorption that the gain of an echogram uses",
    "mitsonar/survey/interferometric/kind.py": "absorption that a picture's gain uses, an attribute",
    "mitsonar/survey/sector_scan/kind.py": "absorption that a picture's gain uses, an attribute",
    "mitsonar/survey/sidescan/kind.py": "absorption that a picture's gain uses, an attribute",
    "plugins/integrators/sonar_path.py": "absorption that a recorder's gain uses",
    "mitsonar/survey/soundings/line.py": "cast of a line, which its format holds once",
    "mitsonar/survey/synthetic_aperture/image.py": "cast of a raw record, which focusing uses, and its targets",
    "mitsonar/survey/synthetic_aperture/truth.py": "truth of an image that is focused with the record's cast"}
#: files that read the water of a sensor, which may be changed after planning
OF_SENSOR = {
    "mitsonar/survey/bending.py": "bound of a warning",
    "mitsonar/survey/soundings/survey.py": "the datum of depths, which is the same for all pings",
    "mitsonar/survey/sensor.py": "where surveys get their water, and the times of their windows",
    "mitsonar/gradients/attached/scene.py": "the altered water, which is set for all pings",
    "mitsonar/inversion/problems.py": "the water that an array is calibrated in"}
FIELDS = {"profile", "absorption", "volume", "geometry", "water"}      # what a survey had once for all pings


def of(node):
    """The last name of an expression: that of a variable or of an attribute."""
    return node.attr if isinstance(node, ast.Attribute) else node.id.lstrip("_") if isinstance(node, ast.Name) else ""


def attributes(tree, owner, names):
    """Attributes of these names that belong to variables or attributes called `owner`."""
    return [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute) and node.attr in names
            and of(node.value).lstrip("_") == owner]


def at_first(tree):
    """Calls that ask for the first ping by its number."""
    return [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute) and node.args
            and isinstance(node.args[0], ast.Constant) and node.args[0].value == 0
            and (node.func.attr in ("sound_speed", "within")
                 or node.func.attr == "at" and of(node.func.value) in ("waters", "world"))]


def once_for_all(tree):
    """Answers of a tree that stand for all pings."""
    return attributes(tree, "survey", FIELDS) + at_first(tree)


def named(files, tree_of):
    """Files in which a search finds anything."""
    return {str(path.relative_to(ROOT)) for path in files if tree_of(ast.parse(path.read_text(encoding="utf-8")))}


def test_nothing_takes_the_first_pings_answer_for_all():
    """But `Survey.planned_speed`, for what all pings share; `Waters.first` is named below."""
    assert named(SOURCES, once_for_all) == {"mitsonar/survey/survey.py"}


def test_what_is_the_first_pings_has_a_reason():
    assert named(SOURCES, lambda tree: attributes(tree, "waters", {"first"})) == set(FIRST)


def test_the_water_of_a_sensor_is_read_where_surveys_are_planned():
    reads = {"profile", "loaded_profile", "volume", "absorption_column"}
    files = [path for path in SOURCES if path.parts[-2] != "sensors"]        # a sensor may read its own
    found = named(files, lambda tree: attributes(tree, "sensor", {"water"}) or [
        text for text in attributes(tree, "water", reads) if "sensor" in text])
    assert found == set(OF_SENSOR)


@pytest.mark.parametrize("text", ["c = survey.profile.at(z)", "c = self._survey.water.profile", "survey.sound_speed(0)",
                                  "w = survey.waters.at(0)", "Tracer(run.survey.geometry, water)"])
def test_an_answer_for_all_pings_would_be_found(text):
    assert once_for_all(ast.parse(text))
