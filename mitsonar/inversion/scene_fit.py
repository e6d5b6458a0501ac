"""Fit parameters of a scene to the image of one of its sonars.

    y ~ Gamma(L, F(x) + f),      1/L = 1/looks + model_error²

y -> the image's intensities, F -> mean intensities (`gradients.scene_model`), f -> `FLOOR` of the loudest bin, which
keeps shadows from counting without end; x -> parameters of `mi.traverse(scene)`, or ``bed.heights`` and ``crate.pose``
of an object's ``vertex_positions``, or ``ball.pose`` of the ``to_world`` of a shape without facets.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import xarray as xr

from ..gradient_verbs import scene_model
from ..gradients.model import ForwardModel
from ..gradients.parametrisation import Heights, Pose, parametrised
from ..gradients.scene_values import differentiable
from ..io.files import FilePath
from ..spelling import meant
from ..verbs import opened
from .answer import Fit
from .fitting import fit
from .image_levels import image_intensities
from .iteration import Method, Stopping
from .likelihood import Gamma
from .priors import Prior

__all__ = ["KeyPrior", "fit_scene", "scene_values", "vertex_places"]

OTHER = {"heights": Heights, "pose": Pose}           # of the vertices of the object whose name stands before them
VERTICES, TRANSFORM = "vertex_positions", "to_world"
FLOOR = 1e-4
ROBUST = 3.0


@dataclass(frozen=True, kw_only=True)
class KeyPrior:
    """What is believed of a parameter of a scene.

    Parameters
    ----------
    key : str
    deviation : float
        In its unit; of a pose, of metres and of radians alike.
    lower, upper : float
    """

    key: str
    deviation: float
    lower: float = -np.inf
    upper: float = np.inf


def fit_scene(scene: mi.Scene | FilePath, image: xr.Dataset, priors: Sequence[KeyPrior], *, looks: float = 1.0,
              length: float | None = None, model_error: float = 0.05, sensor: int | str = 0, seed: int = 0,
              method: Method | None = None, stopping: Stopping | None = None, directions: int = 40,
              state_file: FilePath | None = None, progress: Callable[[float, float], object] | None = None) -> Fit:
    """Fit parameters of a scene to an image.

    Parameters
    ----------
    scene : mitsuba.Scene or path
        What is believed, and where the fit begins.
    image : xarray.Dataset
        Of one of its sonars.
    priors : sequence of KeyPrior
        One for each parameter that is fitted.
    looks : float
        Of the image's bins: 1 is full speckle.
    length : float [m], optional
        Over which the numbers of a mesh's vertices belong together; default: each is on its own.
    model_error : float
        Relative deviation of intensities that the model is off by.
    sensor, seed
        As of `mitsonar.render`.
    method, stopping, directions, state_file, progress
        As of `fit`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render` and `fit`, or if a parameter is unknown, the record is of another sonar, or a length has
        no mesh.
    """
    if not (np.isfinite(looks) and looks > 0 and np.isfinite(model_error) and model_error >= 0):
        raise ValueError(f"looks are {looks:g} and the model's error is {model_error:g}; give looks above zero, and an "
                         "error that is not below it")
    scene, chosen, _ = opened(scene, sensor)
    names = [prior.key for prior in priors]
    model = _model(scene, names, sensor, seed)
    shape = getattr(model, "shape")
    seen = image_intensities(image, str(chosen.kind), shape, _farthest(chosen))
    meshes = {name: (places, _faces(scene, name)) for name, places in vertex_places(scene, model.start).items()}
    if length is not None and not meshes:
        raise ValueError(f"a length of {length:g} m is asked for, and no parameter has a number a vertex of a mesh; "
                         "leave it out")
    floor = FLOOR * float(np.nanmax(seen))
    likelihood = Gamma((seen + floor).ravel(), 1 / (1 / looks + model_error ** 2), background=floor, robust=ROBUST)
    bound = {prior.key: _prior(prior, length, meshes.get(prior.key)) for prior in priors}
    return fit(model, likelihood, bound, method=method, stopping=stopping, directions=directions, seed=seed,
               state_file=state_file, about=f"scene {shape} {looks:g} {sorted(names)}", progress=progress)


def scene_values(scene: mi.Scene | FilePath, names: Sequence[str], *, sensor: int | str = 0) \
        -> dict[str, np.ndarray]:
    """Give the parameters of a scene by the names of a fit, such as a truth.

    Raises
    ------
    FileNotFoundError, ValueError
        As `fit_scene`.
    """
    scene, _, _ = opened(scene, sensor)
    wanted = _model(scene, [name for name in names if _other(name) != "pose"], sensor, 0).start
    return {name: wanted[name] for name in names if name in wanted}


def _model(scene: mi.Scene, names: Sequence[str], sensor: int | str, seed: int) -> ForwardModel:
    """The model of parameters, some of them by other numbers."""
    known = differentiable(scene)
    others = {f"{key.removesuffix(VERTICES)}{other}": key for key in known if key.endswith(f".{VERTICES}")
              for other in OTHER}
    others.update({f"{key.removesuffix(TRANSFORM)}pose": key for key in known if key.endswith(f".{TRANSFORM}")})
    for name in names:
        if name not in known and name not in others:
            all_names = [*known, *others]
            raise ValueError(f"the scene has no parameter {name!r} that could be fitted{meant(name, all_names)}; it "
                             f"has {', '.join(all_names)}")
    if len(set(names)) < len(names):
        raise ValueError(f"a parameter is given twice: {', '.join(names)}; leave one out")
    changes = {name: others[name] for name in names if name in others}
    if len(set(changes.values())) < len(changes) or set(changes.values()) & set(names):
        raise ValueError(f"{', '.join(names)} move the same object; leave one out")
    model = scene_model(scene, [changes.get(name, name) for name in names], sensor=sensor, seed=seed)
    return parametrised(model, *(OTHER[_other(name)](key) for name, key in changes.items()))


def _farthest(sensor: mi.Sensor) -> float | None:
    """The slant range [m] that a sonar's record ends at, where its film says so."""
    reach = getattr(sensor.film(), "range", None)
    return float(reach) if isinstance(reach, (int, float)) and reach > 0 else None


def _other(name: str) -> str:
    return name.rpartition(".")[2]


def vertex_places(scene: mi.Scene, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Give the vertices (V, 3) [m] of the meshes that have a number a vertex among values, by the values' names."""
    parameters: Any = mi.traverse(scene)
    found = {}
    for name, value in values.items():
        owner = name.rpartition(".")[0]
        if f"{owner}.{VERTICES}" in parameters and value.ndim == 1:
            vertices = np.array(parameters[f"{owner}.{VERTICES}"], float).reshape(-1, 3)
            if value.size == len(vertices):
                found[name] = vertices
    return found


def _faces(scene: mi.Scene, name: str) -> np.ndarray:
    parameters: Any = mi.traverse(scene)
    return np.array(parameters[f"{name.rpartition('.')[0]}.faces"], np.int64).reshape(-1, 3)


def _prior(prior: KeyPrior, length: float | None, mesh: tuple[np.ndarray, np.ndarray] | None) -> Prior:
    if length is None or mesh is None:
        return Prior(deviation=prior.deviation, lower=prior.lower, upper=prior.upper)
    return Prior(deviation=prior.deviation, lower=prior.lower, upper=prior.upper, length=length, vertices=mesh[0],
                 faces=mesh[1])
