"""Refraction smile: the effect of a wrong profile, or a wrong sound speed at the head, on a level bed, by ray theory.

A beam of slowness p arrives after the time t. With s = √(1 - p² c²), to first order in the error δc(z) of the profile

    δz = c_b s_b (∫ δc / (c² s) dz - p² ∫ δc / s³ dz)     δx = p ∫ δc / s³ dz + δz p c_b / s_b

by the derivatives of time and range at fixed p (`passage_derivatives`); the integrals run from the array to the bed, b
is at the bed. An error δc_h of the speed by which the sines of a level array are converted, δp = -p δc_h / c_h, has the
effect, with D = dx/dp:

    δz = c_b s_b p² D δc_h / c_h                          δx = -p D δc_h / c_h + δz p c_b / s_b

In uniform water this is δz = z (1 - tan²θ) δc / c and z tan²θ δc_h / c_h: the first changes sign at 45 degrees. The
neglected orders are smaller by a factor of about δc / (c s²).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.propagation.numpy_rays.profile_derivatives import PassageDerivatives, passage_derivatives
from mitsonar.water.profile import SoundSpeedProfile

__all__ = ["Smile", "smile_of_head", "smile_of_profile"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Smile:
    """Errors across a swath over a level bed.

    Attributes
    ----------
    across : array (...) [m]
        True places of the soundings across the track.
    depth_error, across_error : array (...) [m]
        Positive: too deep, and too far to starboard; NaN where no direct ray arrives.
    """

    across: np.ndarray
    depth_error: np.ndarray
    across_error: np.ndarray


def smile_of_profile(true: SoundSpeedProfile, used: SoundSpeedProfile, head_depth: float, bed_depth: float,
                     across: ArrayLike) -> Smile:
    """Return the smile of a wrong profile.

    Parameters
    ----------
    true, used : SoundSpeedProfile
        True and used profile; both or neither have the measured speed at the head as a node.
    head_depth, bed_depth : float [m]
    across : array (...) [m]
        True places across the track.

    Returns
    -------
    Smile

    Raises
    ------
    ValueError
        If the bed is not below the head.
    """
    nodes = np.union1d(true.depth, used.depth)
    ways = _SmileWays.to(SoundSpeedProfile(nodes, true.at(nodes)), head_depth, bed_depth, across)
    off = used.at(nodes) - true.at(nodes)
    return ways.smile(ways.by.time_by_speed @ off, ways.by.range_by_speed @ off)


def smile_of_head(true: SoundSpeedProfile, error: float, head_depth: float, bed_depth: float,
                  across: ArrayLike) -> Smile:
    """Return the smile of a wrong sound speed at the head, which converts the correct sines of a level array.

    Parameters
    ----------
    true : SoundSpeedProfile
        True profile.
    error : float [m/s]
        Error of the head's speed: measured minus true.
    head_depth, bed_depth : float [m]
    across : array (...) [m]
        True places across the track.

    Returns
    -------
    Smile

    Raises
    ------
    ValueError
        If the bed is not below the head.
    """
    ways = _SmileWays.to(true, head_depth, bed_depth, across)
    return ways.smile(0.0, -ways.slowness * ways.by.range_by_parameter * error / true.at(head_depth))


@dataclass(frozen=True, kw_only=True, eq=False)
class _SmileWays:
    """Rays from a head to a level bed, (N,); NaN where no direct ray arrives."""

    across: np.ndarray  # of any shape with N numbers
    slowness: np.ndarray
    by: PassageDerivatives
    end_speed: float

    @classmethod
    def to(cls, profile: SoundSpeedProfile, head_depth: float, bed_depth: float, across: ArrayLike) -> _SmileWays:
        if not head_depth < bed_depth:
            raise ValueError(f"the bed at {bed_depth:g} m is not below the head at {head_depth:g} m; give depths that "
                             "increase downwards.")
        across = np.asarray(across, float)
        ray = eigenray(profile, head_depth, bed_depth, np.abs(across.ravel()))
        slowness = np.where(np.isnan(ray.turning_depth), ray.ray_parameter, np.nan)
        ends = (np.full(slowness.shape, float(depth)) for depth in (head_depth, bed_depth))
        return cls(across=across, slowness=slowness, by=passage_derivatives(profile, slowness, *ends),
                   end_speed=float(profile.at(bed_depth)))

    def smile(self, later: np.ndarray | float, further: np.ndarray) -> Smile:
        """Return the smile of changes of the time between fixed ends [s] and of the range at fixed slowness [m]."""
        cosine = self.slowness * self.end_speed
        sine = np.sqrt(1 - cosine**2)
        deeper = -self.end_speed * sine * (later + self.slowness * further)
        aside = np.sign(self.across) * (further + deeper * cosine / sine).reshape(self.across.shape)
        return Smile(across=self.across, depth_error=deeper.reshape(self.across.shape), across_error=aside)
