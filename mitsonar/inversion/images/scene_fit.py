"""Fit parameters of a scene to the image of one of its sonars.

    y ~ Gamma(L, F(x) + f),      1/L = 1/looks + model_error²

y -> the image's intensities; F -> mean intensities (`gradients.scene_model`); f -> `FLOOR` times the loudest bin, which
limits the weight of shadows; x -> parameters of `mi.traverse(scene)`, ``bed.heights`` or ``crate.pose`` of an object's
``vertex_positions``, or ``ball.pose`` of the ``to_world`` of a shape without facets.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.gradients.model import ForwardModel, ShapedModel
from mitsonar.gradients.parameters.changes import Heights, Pose
from mitsonar.gradients.parameters.parametrisation import parametrised
from mitsonar.gradients.parameters.scene_values import differentiable
from mitsonar.units import power_from_db
from mitsonar.verbs.gradients import scene_model
from mitsonar.verbs.images import opened

from ..fitting.answer import Fit
from ..fitting.fitting import fit
from ..fitting.iteration import Method, Stopping
from ..fitting.likelihood import Gamma
from ..fitting.priors import Prior

RANGES = 0.02                      # share of a range that two sonars' ranges may differ by


def image_intensities(image: xr.Dataset, kind: str, shape: Sequence[int], farthest: float | None = None) -> np.ndarray:
    """Return the intensities of an image, (ping, row, bin) [µPa²]; NaN where there is no level."""
    # farthest [m]
    if "level" not in image or image["level"].ndim != 3:
        raise ValueError("the record has no levels over pings, sides or beams, and ranges; give an image that mitsonar "
                         "rendered, or one with the variable level (ping, side, range)")
    recorded = image.attrs.get("sonar")
    if recorded is not None and recorded not in (kind, f"{kind}_sonar"):       # an array_sonar is of the kind array
        raise ValueError(f"the record is of a sonar of the kind {recorded}, and the scene's is {kind}; give a "
                         "record of the scene's own sonar")
    level = image["level"].values.astype(float)
    if level.shape != tuple(shape):
        said = [" x ".join(str(count) for count in one) for one in (level.shape, shape)]
        raise ValueError(f"the record has {said[0]} pings, rows and bins, and the scene's sonar makes {said[1]}; give "
                         "a record of the scene's own sonar")
    ranges = image["range"].values.astype(float) if "range" in image.coords else np.zeros(0)
    if ranges.size > 1 and farthest is not None and abs(ranges[-1] - farthest) > RANGES * farthest:
        raise ValueError(f"the record ends at {ranges[-1]:.1f} m, and that of the scene's sonar at {farthest:.1f} m; "
                         "give a record of the scene's own sonar")
    seen = np.full(level.shape, np.nan)
    finite = np.isfinite(level)
    seen[finite] = power_from_db(level[finite])
    return seen


OTHER = {"heights": Heights, "pose": Pose}           # of the vertices of the object whose name stands before them
VERTICES, TRANSFORM = "vertex_positions", "to_world"
FLOOR = 1e-4
ROBUST = 3.0


@dataclass(frozen=True, kw_only=True)
class KeyPrior:
    """Prior of a parameter of a scene.

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
        Scene at which the fit begins.
    image : xarray.Dataset
        Image of one of its sonars.
    priors : sequence of KeyPrior
        One prior for each fitted parameter.
    looks : float
        Number of looks of the image's bins: 1 is full speckle.
    length : float [m], optional
        Correlation length of the numbers of a mesh's vertices; default: independent numbers.
    model_error : float
        Relative deviation of the model's intensities from the truth.
    sensor, seed
        Arguments as in `mitsonar.render`.
    method, stopping, directions, state_file, progress
        Arguments as in `fit`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render` and `fit`, or if a parameter is unknown, the record belongs to another sonar, or a
        length has no mesh.
    """
    if not (np.isfinite(looks) and looks > 0 and np.isfinite(model_error) and model_error >= 0):
        raise ValueError(f"looks are {looks:g} and the model's error is {model_error:g}; give looks above zero, and an "
                         "error that is not below it")
    scene, chosen, _ = opened(scene, sensor)
    names = [prior.key for prior in priors]
    model = _model(scene, names, sensor, seed)
    shape = cast(ShapedModel, model).shape
    seen = image_intensities(image, chosen.kind, shape, float(chosen.film().range))
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
    """Return the parameters of a scene by the names of a fit, for example as a truth."""
    scene, _, _ = opened(scene, sensor)
    wanted = _model(scene, [name for name in names if _other(name) != "pose"], sensor, 0).start
    return {name: wanted[name] for name in names if name in wanted}


def _model(scene: mi.Scene, names: Sequence[str], sensor: int | str, seed: int) -> ForwardModel:
    """Return the model of parameters, some of them expressed by other numbers."""
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


def _other(name: str) -> str:
    return name.rpartition(".")[2]


def vertex_places(scene: mi.Scene, values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the vertices (V, 3) [m] of the meshes that have a number a vertex among values, by the values' names."""
    parameters = mi.traverse(scene)
    found = {}
    for name, value in values.items():
        owner = name.rpartition(".")[0]
        if f"{owner}.{VERTICES}" in parameters and value.ndim == 1:
            vertices = np.array(parameters[f"{owner}.{VERTICES}"], float).reshape(-1, 3)
            if value.size == len(vertices):
                found[name] = vertices
    return found


def _faces(scene: mi.Scene, name: str) -> np.ndarray:
    parameters = mi.traverse(scene)
    return np.array(parameters[f"{name.rpartition('.')[0]}.faces"], np.int64).reshape(-1, 3)


def _prior(prior: KeyPrior, length: float | None, mesh: tuple[np.ndarray, np.ndarray] | None) -> Prior:
    if length is None or mesh is None:
        return Prior(deviation=prior.deviation, lower=prior.lower, upper=prior.upper)
    return Prior(deviation=prior.deviation, lower=prior.lower, upper=prior.upper, length=length, vertices=mesh[0],
                 faces=mesh[1])
