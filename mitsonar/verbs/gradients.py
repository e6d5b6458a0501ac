"""The verbs of gradients: how a record moves with what is in its scene.

    I = F(x)  [µPa²],    L = 10 log I  [dB]

x -> parameters by the names of `mi.traverse`; I -> mean intensities, (ping, row, bin), of rays that stay the same
(`gradients.record_field`). A row is a side of a sidescan, or a beam.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.gradients.check.check import GradientCheck, check_parameters
from mitsonar.gradients.elements.coherent_picture import CoherentPicture
from mitsonar.gradients.elements.elements import ElementModel, attached_signals
from mitsonar.gradients.parameters.scene_values import differentiable
from mitsonar.gradients.records.pictures import picture_of
from mitsonar.gradients.records.scene_model import SceneLinearised, SceneModel
from mitsonar.scene.errors import as_exception

from .images import checked_seed, opened

QUANTITIES = "level", "intensity"
DECIBELS = 10 / np.log(10)

Weights = np.ndarray | Callable[[np.ndarray], np.ndarray]


def gradient(scene: mi.Scene | FilePath, keys: Sequence[str], weights: Weights, *, of: str = "level",
             sensor: int | str = 0, seed: int = 0) -> dict[str, np.ndarray]:
    """Return the gradient of a number made of a sonar's record, by parameters of its scene.

    The number is Σ w y of the record y, mean levels or intensities without speckle; or any function of it whose own
    gradient by the record `weights` gives.

    Parameters
    ----------
    scene, sensor, seed
        As of `mitsonar.render`.
    keys : sequence of str
        Names of `mi.traverse(scene)`.
    weights : array (ping, row, bin), or callable
        w; or what gives them for a record (ping, row, bin): the gradient of the number by it. Bins into which no echo
        falls have the level -inf, and do not count.
    of : str
        ``level`` [dB re 1 µPa] or ``intensity`` [µPa²].

    Returns
    -------
    dict[str, array]
        One a key, in the shape of the parameter.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if a name is unknown, or the weights do not fit.
    """
    _check_quantity(of)
    model = scene_model(scene, keys, sensor=sensor, seed=seed)
    about = model.linearised({})
    record, slope = _record(about, of)
    chosen = weights(record.reshape(model.shape)) if callable(weights) else weights
    cotangent = np.asarray(chosen, float)
    if cotangent.shape != model.shape:
        raise ValueError(f"weights have the shape {cotangent.shape}, and the record {model.shape} (ping, row, "
                         "bin); give one for every value of it")
    there = slope > 0
    if not np.all(np.isfinite(cotangent.ravel()[there])):
        raise ValueError("weights hold numbers that are not finite; give 0 where a value does not count")
    return about.backward(np.where(there, cotangent.ravel(), 0) * slope)


def directional_derivative(scene: mi.Scene | FilePath, tangents: Mapping[str, np.ndarray], *, of: str = "level",
                           sensor: int | str = 0, seed: int = 0) -> np.ndarray:
    """Return how a sonar's record moves as parameters of its scene move in a direction: a Jacobian product.

    Parameters
    ----------
    scene, sensor, seed, of
        As of `gradient`.
    tangents : dict[str, array]
        The direction: names of `mi.traverse(scene)`, and an array in the shape of each parameter.

    Returns
    -------
    (ping, row, bin) array [dB] or [µPa²]
        Per unit of the direction; 0 where no echo falls.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if a name is unknown or a shape does not fit.
    """
    _check_quantity(of)
    model = scene_model(scene, list(tangents), sensor=sensor, seed=seed)
    about = model.linearised({})
    return (_record(about, of)[1] * about.forward(tangents)).reshape(model.shape)


def scene_model(scene: mi.Scene | FilePath, keys: Sequence[str], *, sensor: int | str = 0, seed: int = 0,
                edges: bool = True, rays: int | None = None) -> SceneModel:
    """Return the mean intensities of a sonar's record as a function of parameters of its scene.

    It writes the parameters into the scene, and keeps rays and hits between products: for fits, and for many products
    about the same values.

    Parameters
    ----------
    scene, sensor, seed
        As of `mitsonar.render`.
    keys : sequence of str
        Names of `mi.traverse(scene)`.
    edges : bool
        Whether derivatives know that outlines move, and with them what is lit and what lies in shadow.
    rays : int, optional
        A ping, at most: a fit to a speckled record needs fewer than a picture. Default: the scene's.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if a name is unknown or ``rays`` is less than 1.
    """
    return _model(scene, keys, sensor, seed, edges, rays)


def _model(scene: mi.Scene | FilePath, keys: Sequence[str], sensor: int | str, seed: int, edges: bool = True,
           rays: int | None = None, *, planned_anew: bool = False) -> SceneModel:
    """Return a `scene_model`, whose records of other values may be those that renders of these would plan."""
    seed = checked_seed(seed)
    if rays is not None and rays < 1:
        raise ValueError(f"rays is {rays}; give the most that a ping may have, 1 or more")
    scene, chosen, integrator = opened(scene, sensor)
    try:
        plan = partial(picture_of, scene, chosen, integrator, rays)
        names = [keys] if isinstance(keys, str) else keys
        return SceneModel(scene, names, plan(), seed=chosen.own_seed(seed), edges=edges,
                          plan=plan if planned_anew else None)
    except RuntimeError as error:
        raise as_exception(error) from error


def coherent_model(scene: mi.Scene | FilePath, keys: Sequence[str], *, of: str = "intensity",
                   pings: Sequence[int] | None = None, sensor: int | str = 0, seed: int = 0) -> CoherentPicture:
    """Return the picture of an array's beams, speckle and all, as a function of its elements and of point targets.

    Beams are formed with the arrays as the scene has them: changes are errors that they do not know of.

    Parameters
    ----------
    scene, sensor, seed
        As of `mitsonar.render`.
    keys : sequence of str
        Parameters, as `gradients.element_parameters` names them.
    of : str
        ``intensity`` [µPa²], or ``amplitude`` [µPa]: real and imaginary parts.
    pings : sequence of int, optional
        Default: all.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, if a name is unknown, or the sonar is neither an array nor a forward-looking one.
    """
    seed = checked_seed(seed)
    scene, chosen, _ = opened(scene, sensor)
    number = [one.id() for one in scene.sensors()].index(chosen.id())
    try:
        return CoherentPicture(scene, [keys] if isinstance(keys, str) else keys, pings=pings, sensor=number, seed=seed,
                               of=of)
    except RuntimeError as error:
        raise as_exception(error) from error


def differentiable_signals(scene: mi.Scene, params: Any, pings: Sequence[int] = (0,), *, sensor: int | str = 0,
                           seed: int = 0) -> mi.TensorXf:
    """Return the signals of a sonar's elements, attached to the parameters of its scene that carry gradients.

    It is `mitsonar.element_signals` for `dr.backward` and `dr.forward_to`: coherent, with phases, scatterers staying.
    What Dr.Jit makes of the signals, beams or pictures, can be differentiated as well.

    Parameters
    ----------
    scene : mitsuba.Scene
    params : mitsuba.SceneParameters
        ``mi.traverse(scene)``. Elements' positions, delays and weights, positions and strengths of point targets, and
        the track's offsets may carry gradients.
    pings : sequence of int
    sensor, seed
        As of `mitsonar.render`.

    Returns
    -------
    TensorXf (ping, receiver, sample, 2) [µPa]
        Real and imaginary part.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.element_signals`, or if nothing carries a gradient, or something that signals have none of.

    Notes
    -----
    Gradients leave out how spreading and strengths change with place, about 1/(k R) of them: `gradients.elements`.
    """
    seed = checked_seed(seed)
    scene, chosen, _ = opened(scene, sensor)
    keys = [key for key, value in params if dr.is_diff_v(value) and dr.grad_enabled(value)]
    if not keys:
        raise ValueError("no parameter carries a gradient; call dr.enable_grad(params[key]) of one, and then "
                         "params.update()")
    model = ElementModel(scene, keys, pings=pings, sensor=scene.sensors().index(chosen), seed=seed)
    return attached_signals(model, params, pings)


def gradient_check(scene: mi.Scene | FilePath, keys: Sequence[str] | None = None, *, sensor: int | str = 0,
                   seed: int = 0, directions: int = 3, tolerance: float = 0.01,
                   progress: Callable[[float, float], object] | None = None) -> GradientCheck:
    """Compare gradients of a scene's parameters, forward and backward, with differences, each parameter alone.

    Differences are of records in the bins and beams that `mi.render` plans for each changed scene, of the same rays.

    Parameters
    ----------
    scene, sensor, seed
        As of `mitsonar.render`.
    keys : sequence of str, optional
        Names of `mi.traverse(scene)`; default: all that gradients can be of.
    directions, tolerance
        See `gradients.check.check_gradients`.
    progress : function, optional
        Called with the parameters done and their number.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `scene_model`, or if an option is out of its range.
    """
    scene, *_ = opened(scene, sensor)
    scene_model(scene, differentiable(scene)[:1], sensor=sensor, seed=seed)        # what is wrong with sonar or scene
    return check_parameters(lambda key: _model(scene, [key], sensor, seed, planned_anew=True),
                            list(dict.fromkeys(keys)) if keys else differentiable(scene), refuse=keys is not None,
                            directions=directions, tolerance=tolerance, seed=seed, progress=progress)


def _check_quantity(of: str) -> None:
    if of not in QUANTITIES:
        raise ValueError(f"of is {of!r}{meant(of, QUANTITIES)}; give one of {', '.join(QUANTITIES)}")


def _record(about: SceneLinearised, of: str) -> tuple[np.ndarray, np.ndarray]:
    """The record (N,), and its slope by intensities."""
    intensity = about.value
    if of == "intensity":
        return intensity, np.ones_like(intensity)
    there = intensity > 0
    level = np.full_like(intensity, -np.inf)
    level[there] = 10 * np.log10(intensity[there])
    return level, np.divide(DECIBELS, intensity, out=np.zeros_like(intensity), where=there)
