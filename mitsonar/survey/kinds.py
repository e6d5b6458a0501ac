"""The kinds of sonar: each is one file with a plan and a picture.

    plan(scene, sensor, settings)                            a `Survey`: what the run needs to know
    picture(survey, sensor, seed, progress, say)             its record as a labelled image
    plan_elements(scene, sensor, settings, lead)             an `ArraySurvey`: the same run, element by element
    rows(level)                                              the image's levels as rows of one picture

To add one, write its file and a line here; its sensor plugin says which kind it is.
"""
from types import ModuleType

from . import array, sidescan

__all__ = ["KINDS", "kind_of"]

KINDS: dict[str, ModuleType] = {"sidescan": sidescan, "array": array}


def kind_of(sensor: object) -> ModuleType:
    """Give the kind of sonar that a sensor is.

    Raises
    ------
    ValueError
        If it is no sonar.
    """
    kind = getattr(sensor, "kind", None)
    if kind not in KINDS:
        name = sensor.class_name() if hasattr(sensor, "class_name") else type(sensor).__name__
        raise ValueError(f"the integrator sonar_path needs a sonar, such as <sensor type=\"sidescan\">, got a {name}")
    return KINDS[kind]
