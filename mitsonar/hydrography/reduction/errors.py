"""Errors of soundings by cause: what detection, refraction and motion add to the depth, one after the other.

The same times and angles are reduced three times, each time with one more thing as it is believed to be:

    e_0    true water, true motion, true mounting
    e_1    the profile and the head's sound speed that are used
    e_2    the motion and the mounting that are used, too: the soundings as they come out

    e_k = depth_k - bed(x_k, y_k)
    error_detection = e_0      error_refraction = e_1 - e_0      error_motion = e_2 - e_1      error = e_2, their sum

The depth of the bed is taken where each sounding lies: on a slope an error across track is one in depth.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.water.profile import SoundSpeedProfile

from .attitude import PlatformMotion
from .reduction import Installation, Located, Measured, located

__all__ = ["Errors", "Reduction", "disturbed", "errors"]


Bed = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class Reduction:
    """Arguments of `mitsonar.hydrography.reduction.reduction.located`.

    Attributes
    ----------
    motion : Motion
    installation : Installation
    profile : SoundSpeedProfile
    head_speed : array (...) or float [m/s], or None
    node : bool
        False of the truth: the true profile holds the head's speed already.
    """

    motion: PlatformMotion
    installation: Installation
    profile: SoundSpeedProfile
    head_speed: ArrayLike | None = None
    node: bool = True

    def located(self, measured: Measured) -> Located:
        """Return the places of soundings."""
        return located(measured, self.motion, self.installation, self.profile, head_speed=self.head_speed,
                       node=self.node)


@dataclass(frozen=True, kw_only=True, eq=False)
class Errors:
    """Errors by cause [m], of the shape of what was measured, as `record` names them.

    Attributes
    ----------
    true_depth : array (...) [m]
        Of the bed where the soundings lie.
    error, error_detection, error_refraction, error_motion : array (...) [m]
        Positive: too deep. The first is the sum of the others. NaN where a sounding has no place, or had none with
        what is true.
    """

    true_depth: np.ndarray
    error: np.ndarray
    error_detection: np.ndarray
    error_refraction: np.ndarray
    error_motion: np.ndarray

    def variables(self) -> dict[str, np.ndarray]:
        """Return them by name, as a record holds them."""
        return {one.name: getattr(self, one.name) for one in fields(self)}


def errors(measured: Measured, true: Reduction, used: Reduction, bed: Bed, *,
           at_rest: Measured | None = None, refracted: Measured | None = None) -> tuple[Located, Errors]:
    """Return soundings as they come out, and their errors by cause.

    Parameters
    ----------
    measured : Measured
        Times and angles as they were detected.
    true, used : Reduction
        What there was, and what is believed.
    bed : function of x and y [m], arrays (...)
        Its depth (...) [m].
    at_rest : Measured or None
        What arrays at rest would have measured, where it is another: the first two stages go by it.
    refracted : Measured or None
        What the second stage goes by, where the head's sound speed makes it another.

    Returns
    -------
    Located
        With what is used.
    Errors
    """
    bent = replace(true, profile=used.profile, head_speed=used.head_speed, node=used.node)
    first = measured if at_rest is None else at_rest
    second = first if refracted is None else refracted
    stages = [true.located(first), bent.located(second), used.located(measured)]
    true_depth = [np.asarray(bed(one.x, one.y), float) for one in stages]
    detection, refraction, motion = (one.depth - depth for one, depth in zip(stages, true_depth))
    return stages[-1], Errors(true_depth=true_depth[-1], error=motion, error_detection=detection,
                              error_refraction=refraction - detection, error_motion=motion - refraction)


def disturbed(motion: PlatformMotion, *, latency: float = 0.0, **added: ArrayLike) -> PlatformMotion:
    """Make the motion that sensors tell out of the true one.

    Parameters
    ----------
    motion : Motion
    latency : float [s]
        By which the sensors' samples are stamped too late.
    **added : float or array (M,) [m], [rad]
        What ``x``, ``y``, ``depth``, ``roll``, ``pitch`` and ``heading`` are off by: biases, or noise sample by sample.

    Raises
    ------
    ValueError
        If a name is none of these.
    """
    names = {one.name for one in fields(PlatformMotion)} - {"time"}
    unknown = sorted(set(added) - names)
    if unknown:
        raise ValueError(f"a motion has no {unknown[0]}; give {', '.join(sorted(names))} or latency.")
    changed = {name: getattr(motion, name) + np.asarray(value, float) for name, value in added.items()}
    return replace(motion, time=motion.time + latency, **changed)
