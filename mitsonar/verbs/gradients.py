"""Gradients of a sonar record by the parameters of its scene.

    I = F(x)  [µPa²],    L = 10 log I  [dB]

x -> parameters, named as in `mi.traverse`; I -> mean intensities (ping, row, bin), computed with fixed rays
(`gradients.record_field`). A row is a side of a sidescan, or a beam.
"""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.device.turns import one_at_a_time
from mitsonar.gradients.check.check import GradientCheck, check_parameters
from mitsonar.gradients.elements.coherent_picture import CoherentPicture
from mitsonar.gradients.elements.elements import ElementModel, attached_signals
from mitsonar.gradients.parameters.changes import DECIBELS
from mitsonar.gradients.parameters.scene_values import differentiable
from mitsonar.gradients.records.pictures import picture_of
from mitsonar.gradients.records.scene_model import SceneLinearised, SceneModel
from mitsonar.scene.errors import as_exception

from .images import checked_seed, opened

QUANTITIES = "level", "intensity"

Weights = np.ndarray | Callable[[np.ndarray], np.ndarray]


@one_at_a_time
def gradient(scene: mi.Scene | FilePath, keys: Sequence[str], weights: Weights, *, of: str = "level",
             sensor: int | str = 0, seed: int = 0) -> dict[str, np.ndarray]:
    """Return the gradient of a scalar function of a sonar record by parameters of the scene.

    The scalar is Σ w y, where y is the record: mean levels or intensities, without speckle. For any other function of
    the record, pass a callable as `weights` that returns the gradient of that function by the record.

    Parameters
    ----------
    scene, sensor, seed
        As in `mitsonar.render`.
    keys : sequence of str
        Parameter names of `mi.traverse(scene)`.
    weights : array (ping, row, bin), or callable
        The weights w, or a function that returns them for a record (ping, row, bin). Bins without an echo have the
        level -inf; their weights are ignored.
    of : str
        Quantity of the record: ``level`` [dB re 1 µPa] or ``intensity`` [µPa²].

    Returns
    -------
    dict[str, array]
        Gradient by each key, in the shape of the parameter.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if a name is unknown, or the weights do not fit the record.
    """
    _check_quantity(of)
    model = scene_model(scene, keys, sensor=sensor, seed=seed)
    linear = model.linearised({})
    record, slope = _record(linear, of)
    cotangent = np.asarray(weights(record.reshape(model.shape)) if callable(weights) else weights, float)
    if cotangent.shape != model.shape:
        raise ValueError(f"weights have the shape {cotangent.shape}, but the record has {model.shape} (ping, row, "
                         "bin); give one weight for each of its values")
    echo = slope > 0
    if not np.all(np.isfinite(cotangent.ravel()[echo])):
        raise ValueError("weights contain infinite values or NaN; give 0 for values of the record to leave out")
    return linear.backward(np.where(echo, cotangent.ravel(), 0) * slope)


@one_at_a_time
def directional_derivative(scene: mi.Scene | FilePath, tangents: Mapping[str, np.ndarray], *, of: str = "level",
                           sensor: int | str = 0, seed: int = 0) -> np.ndarray:
    """Return the derivative of a sonar record along a direction of its scene's parameters: a Jacobian product.

    Parameters
    ----------
    scene, sensor, seed, of
        As in `gradient`.
    tangents : dict[str, array]
        The direction: for names of `mi.traverse(scene)`, an array in the shape of the parameter.

    Returns
    -------
    (ping, row, bin) array [dB] or [µPa²]
        Change of the record per unit of the direction; 0 in bins without an echo.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if a name is unknown or a shape does not fit.
    """
    _check_quantity(of)
    model = scene_model(scene, list(tangents), sensor=sensor, seed=seed)
    linear = model.linearised({})
    return (_record(linear, of)[1] * linear.forward(tangents)).reshape(model.shape)


def scene_model(scene: mi.Scene | FilePath, keys: Sequence[str], *, sensor: int | str = 0, seed: int = 0,
                edges: bool = True, rays: int | None = None) -> SceneModel:
    """Return a model of a sonar record: its mean intensities as a function of parameters of the scene.

    The model writes the parameters into the scene and keeps rays and hits between products. Use it for fits, and for
    many products about the same values.

    Parameters
    ----------
    scene, sensor, seed
        As in `mitsonar.render`.
    keys : sequence of str
        Parameter names of `mi.traverse(scene)`.
    edges : bool
        Include in derivatives the motion of outlines, and of the edges of shadows.
    rays : int, optional
        Largest number of rays per ping; a fit to a speckled record needs fewer than an image. Default: the scene's.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if a name is unknown or ``rays`` is less than 1.
    """
    return _model(scene, keys, sensor, seed, edges, rays)


@one_at_a_time
def _model(scene: mi.Scene | FilePath, keys: Sequence[str], sensor: int | str, seed: int, edges: bool = True,
           rays: int | None = None, *, planned_anew: bool = False) -> SceneModel:
    """Return a `scene_model`; if `planned_anew`, it plans bins and beams again for every change of values."""
    seed = checked_seed(seed)
    if rays is not None and rays < 1:
        raise ValueError(f"rays is {rays}; give the most rays that a ping may have, 1 or more")
    scene, sonar, integrator = opened(scene, sensor)
    try:
        plan = partial(picture_of, scene, sonar, integrator, rays)
        return SceneModel(scene, [keys] if isinstance(keys, str) else keys, plan(), seed=sonar.own_seed(seed),
                          edges=edges, plan=plan if planned_anew else None)
    except RuntimeError as error:
        raise as_exception(error) from error


@one_at_a_time
def coherent_model(scene: mi.Scene | FilePath, keys: Sequence[str], *, of: str = "intensity",
                   pings: Sequence[int] | None = None, sensor: int | str = 0, seed: int = 0) -> CoherentPicture:
    """Return a model of the beams of an array, with speckle, as a function of its elements and of point targets.

    Beams are formed with the arrays as the scene defines them. Changes of the elements therefore act as array errors
    that beamforming does not correct.

    Parameters
    ----------
    scene, sensor, seed
        As in `mitsonar.render`.
    keys : sequence of str
        Parameter names, as `gradients.element_parameters` lists them.
    of : str
        Quantity: ``intensity`` [µPa²], or ``amplitude`` [µPa] as real and imaginary parts.
    pings : sequence of int, optional
        Pings of the track. Default: all.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, if a name is unknown, or if the sonar is neither an array nor forward-looking.
    """
    seed = checked_seed(seed)
    scene, sonar, _ = opened(scene, sensor)
    try:
        return CoherentPicture(scene, [keys] if isinstance(keys, str) else keys, pings=pings,
                               sensor=scene.sensors().index(sonar), seed=seed, of=of)
    except RuntimeError as error:
        raise as_exception(error) from error


@one_at_a_time
def differentiable_signals(scene: mi.Scene, params: mi.SceneParameters, pings: Sequence[int] = (0,), *,
                           sensor: int | str = 0, seed: int = 0) -> mi.TensorXf:
    """Return element signals that Dr.Jit can differentiate by those parameters of the scene that carry gradients.

    The signals are those of `mitsonar.element_signals`, with phases and with fixed scatterers, for `dr.backward` and
    `dr.forward_to`. Beams and images that are computed from them with Dr.Jit can be differentiated as well.

    Parameters
    ----------
    scene : mitsuba.Scene
    params : mitsuba.SceneParameters
        ``mi.traverse(scene)``. Gradients are possible of positions, delays and weights of elements, positions and
        strengths of point targets, and offsets of the track.
    pings : sequence of int
        Pings of the track, from 0.
    sensor, seed
        As in `mitsonar.render`.

    Returns
    -------
    TensorXf (ping, receiver, sample, 2) [µPa]
        Real and imaginary part.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.element_signals`, or if no parameter carries a gradient, or if signals cannot be
        differentiated by one that does.

    Notes
    -----
    Gradients leave out the change of spreading and strength with position, about 1/(k R) of the gradient; see
    `gradients.elements`.
    """
    seed = checked_seed(seed)
    scene, sonar, _ = opened(scene, sensor)
    keys = [key for key, value in params if dr.is_diff_v(value) and dr.grad_enabled(value)]
    if not keys:
        raise ValueError("no parameter carries a gradient; call dr.enable_grad(params[key]) for at least one, and then "
                         "params.update()")
    model = ElementModel(scene, keys, pings=pings, sensor=scene.sensors().index(sonar), seed=seed)
    return attached_signals(model, params, pings)


@one_at_a_time
def gradient_check(scene: mi.Scene | FilePath, keys: Sequence[str] | None = None, *, sensor: int | str = 0,
                   seed: int = 0, directions: int = 3, tolerance: float = 0.01,
                   progress: Callable[[float, float], object] | None = None) -> GradientCheck:
    """Compare forward and backward gradients of a scene with finite differences, one parameter at a time.

    The differences are of records with the same rays, in the bins and beams that `mi.render` plans for each changed
    scene.

    Parameters
    ----------
    scene, sensor, seed
        As in `mitsonar.render`.
    keys : sequence of str, optional
        Parameter names of `mi.traverse(scene)`. Default: all differentiable parameters.
    directions, tolerance
        As in `gradients.check.check_gradients`.
    progress : callable(done, total), optional
        Called with the number of parameters done and of all parameters.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `scene_model`, or if an option is out of its range.
    """
    scene, *_ = opened(scene, sensor)
    # errors of the sonar and the scene are raised here, before any parameter is checked
    scene_model(scene, differentiable(scene)[:1], sensor=sensor, seed=seed)
    return check_parameters(lambda key: _model(scene, [key], sensor, seed, planned_anew=True),
                            list(dict.fromkeys(keys)) if keys else differentiable(scene), refuse=keys is not None,
                            directions=directions, tolerance=tolerance, seed=seed, progress=progress)


def _check_quantity(of: str) -> None:
    if of not in QUANTITIES:
        raise ValueError(f"of is {of!r}{meant(of, QUANTITIES)}; choose {' or '.join(QUANTITIES)}")


def _record(linear: SceneLinearised, of: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the record (N,) and its derivative by the intensities."""
    intensity = linear.value
    if of == "intensity":
        return intensity, np.ones_like(intensity)
    echo = intensity > 0
    level = np.full_like(intensity, -np.inf)
    level[echo] = 10 * np.log10(intensity[echo])
    return level, np.divide(DECIBELS, intensity, out=np.zeros_like(intensity), where=echo)
