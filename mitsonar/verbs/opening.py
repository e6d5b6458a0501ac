"""A scene to work with, its sonar and its integrator, without what images and signals are made of."""
from __future__ import annotations

import operator
import os
from collections.abc import Mapping

import mitsuba as mi

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.scene.loading import load_for_sonar, prepare
from mitsonar.survey.integrator import SoundIntegrator, integrator_of
from mitsonar.survey.sensor import Sensor, sonar_of


def opened(scene: mi.Scene | FilePath, sensor: int | str = 0,
           parameters: Mapping[str, object] | None = None) -> tuple[mi.Scene, Sensor, SoundIntegrator]:
    """Return the scene, loaded if it is a path, the sensor of a number or id, and the integrator of sound."""
    sensor = sensor if isinstance(sensor, str) else operator.index(sensor)
    prepare()
    if not isinstance(scene, mi.Scene):
        if not isinstance(scene, (str, os.PathLike)):
            raise TypeError(f"expected a scene of the variant {mi.variant()} or the path of a file, got a "
                            f"{type(scene).__name__}; load the scene after mi.set_variant")
        scene = load_for_sonar(scene, **(parameters or {}))
    elif parameters:
        raise TypeError(f"{', '.join(parameters)}: no argument has this name, and this scene is already loaded, so it "
                        "takes no parameters; give them to mitsonar.load_file")
    sensors = scene.sensors()
    if not sensors:
        raise ValueError("the scene has no sensor; write <sensor type=\"sidescan\"> ... </sensor>")
    if isinstance(sensor, str):
        ids = [candidate.id() for candidate in sensors]
        if sensor not in ids:
            raise ValueError(f'sensor "{sensor}" was asked for{meant(sensor, ids)}; the scene has {", ".join(ids)}')
        sensor = ids.index(sensor)
    if not 0 <= sensor < len(sensors):
        raise ValueError(f"sensor {sensor} was asked for, but the scene has {len(sensors)}, counted from 0")
    integrator = integrator_of(scene)
    return scene, sonar_of(sensors[sensor]), integrator
