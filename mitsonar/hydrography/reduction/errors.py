"""Errors of soundings by cause: the contributions of detection, refraction and motion to the depth.

The same times and angles are reduced three times, each time with one more assumed quantity in place of the true one:

    e_0    true water, true motion, true mounting
    e_1    assumed profile and sound speed at the head
    e_2    also assumed motion and mounting
    e_3    also an assumed tide, or an assumed separation, where there is one: the soundings of the line

    e_k = depth_k - bed(x_k, y_k)
    error_detection = e_0      error_refraction = e_1 - e_0      error_motion = e_2 - e_1
    error_tide or error_separation = e_3 - e_2             error = their sum

The depth of the bed is taken at the place of each sounding: on a slope, an error across the track is an error of depth.
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
    """Inputs of `mitsonar.hydrography.reduction.reduction.located`.

    Attributes
    ----------
    motion : PlatformMotion
    installation : Installation
    profile : SoundSpeedProfile
    head_speed : array (...) or float [m/s], or None
    node : bool
        False for the true water: the true profile already contains the head's speed.
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
    """Errors by cause [m], in the shape of the measurement, by the names of `record`.

    Attributes
    ----------
    true_depth : array (...) [m]
        Depth of the bed at the places of the soundings.
    error, error_detection, error_refraction, error_motion, error_tide, error_separation : array (...) [m]
        Errors of depth, positive: too deep. The first is the sum of the others. NaN for soundings without a place,
        with the assumed or the true quantities. `error_tide` is None without a tide, `error_separation` where depths
        are not reduced by heights above the ellipsoid.
    """

    true_depth: np.ndarray
    error: np.ndarray
    error_detection: np.ndarray
    error_refraction: np.ndarray
    error_motion: np.ndarray
    error_tide: np.ndarray | None = None
    error_separation: np.ndarray | None = None

    def variables(self) -> dict[str, np.ndarray]:
        """Return the errors by their names in a record."""
        return {one.name: value for one in fields(self) if (value := getattr(self, one.name)) is not None}


def errors(measured: Measured, true: Reduction, used: Reduction, bed: Bed, *,
           at_rest: Measured | None = None, refracted: Measured | None = None,
           tidal: Reduction | None = None, separated: Reduction | None = None) -> tuple[Located, Errors]:
    """Return soundings and their errors by cause.

    Parameters
    ----------
    measured : Measured
        Detected times and angles.
    true, used : Reduction
        True and assumed water, motion and mounting.
    bed : function of x and y [m], arrays (...)
        Function that returns the depth (...) [m] of the bed.
    at_rest : Measured or None
        Measurement of arrays at rest, if it differs; used in the first two stages.
    refracted : Measured or None
        Measurement for the second stage, if the head's sound speed changes it.
    tidal : Reduction or None
        Assumed quantities with an assumed tide, which `used` does not have.
    separated : Reduction or None
        Assumed quantities with heights above the ellipsoid less an assumed separation, in place of `tidal`; `used` has
        the same heights less the true one.

    Returns
    -------
    Located
        Soundings with the assumed quantities.
    Errors
        Their errors.
    """
    bent = replace(true, profile=used.profile, head_speed=used.head_speed, node=used.node)
    first = measured if at_rest is None else at_rest
    second = first if refracted is None else refracted
    stages = [true.located(first), bent.located(second), used.located(measured)]
    if (last := tidal or separated) is not None:
        stages.append(last.located(measured))
    true_depth = [np.asarray(bed(one.x, one.y), float) for one in stages]
    detection, refraction, motion, *rest = (one.depth - depth for one, depth in zip(stages, true_depth))
    return stages[-1], Errors(true_depth=true_depth[-1], error=rest[0] if rest else motion, error_detection=detection,
                              error_refraction=refraction - detection, error_motion=motion - refraction,
                              **{f"error_{'separation' if tidal is None else 'tide'}": rest[0] - motion for _ in rest})


def disturbed(motion: PlatformMotion, *, latency: float = 0.0, **added: ArrayLike) -> PlatformMotion:
    """Return the motion that sensors report for a true motion.

    Parameters
    ----------
    motion : Motion
        True motion.
    latency : float [s]
        Delay of the sensors' time stamps.
    **added : float or array (M,) [m], [rad]
        Errors of ``x``, ``y``, ``depth``, ``roll``, ``pitch`` and ``heading``: biases, or noise by sample.

    Raises
    ------
    ValueError
        If a name is unknown.
    """
    names = {one.name for one in fields(PlatformMotion)} - {"time"}
    unknown = sorted(set(added) - names)
    if unknown:
        raise ValueError(f"a motion has no {unknown[0]}; give {', '.join(sorted(names))} or latency.")
    changed = {name: getattr(motion, name) + np.asarray(value, float) for name, value in added.items()}
    return replace(motion, time=motion.time + latency, **changed)
