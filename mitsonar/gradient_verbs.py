"""The verbs of gradients: how a record moves with what is in its scene."""
from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi

from .gradients.pictures import picture_of
from .gradients.scene_model import SceneModel
from .io.files import FilePath
from .scene.errors import as_exception
from .verbs import checked_seed, opened

__all__ = ["scene_model"]


def scene_model(scene: mi.Scene | FilePath, keys: Sequence[str], *, sensor: int | str = 0, seed: int = 0) -> SceneModel:
    """Give the mean intensities of a sonar's record as a function of parameters of its scene.

    Parameters
    ----------
    scene, sensor, seed
        As of `mitsonar.render`.
    keys : sequence of str
        Names of `mi.traverse(scene)`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if a name is unknown.
    """
    seed = checked_seed(seed)
    scene, chosen, integrator = opened(scene, sensor)
    try:
        picture = picture_of(scene, chosen, integrator)
    except RuntimeError as error:
        raise as_exception(error) from error
    return SceneModel(scene, keys, picture, seed=chosen.own_seed(seed))
