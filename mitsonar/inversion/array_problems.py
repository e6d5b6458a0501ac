"""Problems of arrays, by name: where elements stand, and how a synthetic aperture swayed."""
from __future__ import annotations

from collections.abc import Sequence

from .problem import Options, Progress, Solved, beliefs

__all__ = ["array", "sway"]


def array(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Calibrate an array: the scene with its water and targets, the signals, and NAME=DEVIATION of what is believed."""
    if len(inputs) < 2:
        raise ValueError("fit array takes a scene with point targets and the signals of its sonar's elements, and then "
                         f"what is believed, such as rx_position=0.002; got {' '.join(inputs)}")
    import numpy as np
    import xarray as xr

    from ..io import reading, scenes
    from ..scene.errors import as_exception
    from ..scene.loading import load_file
    from ..verbs import opened
    from .calibration import BELIEVED, calibrated

    path, record, *believed = inputs
    deviations = beliefs(believed, list(BELIEVED))
    path, signals = scenes.find(path), reading.read(record)
    if not isinstance(signals, xr.DataArray):
        raise ValueError(f"{record} holds no signals of elements; give a netCDF file that mitsonar signals writes")
    scene, sensor, integrator = opened(load_file(path, **options.get("parameters", {})), options.get("sensor", 0))
    try:
        survey = integrator.array_survey(scene, sensor, 0)
    except RuntimeError as error:
        raise as_exception(error) from error
    targets = [target.position for target in survey.geometry.targets()]
    if not targets:
        raise ValueError(f"{path} has no point targets; put a point_target where each is believed to be")
    found = calibrated(signals, np.array(targets, float), sensor.water.profile,
                       transmit=np.mean(survey.transmit.position, axis=0), believed=deviations)
    progress(1, 1)
    return Solved(dataset=found.to_dataset(), sentences=found.sentences())


def sway(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Find how a synthetic aperture swayed, of raw echoes; the answer is a trajectory to focus with."""
    if len(inputs) != 1:
        raise ValueError("fit sway takes a file of raw echoes, of a part of a strip about as long as its aperture; got "
                         f"{' '.join(inputs) or 'none'}")
    from ..io import raw_echoes
    from .sharpness import sharpened

    rounds, done = 3, []

    def say(text: str) -> None:
        done.append(text)
        progress(len(done), rounds)

    found = sharpened(raw_echoes.read(inputs[0]), rounds=rounds, say=say)
    return Solved(dataset=found.to_dataset(), sentences=found.sentences())
