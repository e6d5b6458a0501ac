"""Refraction smile: the effect of a wrong profile, or a wrong sound speed at the head, on a level bed, by ray theory.

A beam of slowness p arrives after the time t. With s = √(1 - p² c²), to first order in the error δc(z) of the profile

    δz = c_b s_b ∫ (1 - 2 p² c²) / (c² s³) δc dz          δx = ∫ p / s³ δc dz + δz p c_b / s_b

from the derivatives of time and range at fixed p; the integrals run from the array to the bed, b is at the bed. An
error δc_h of the speed by which the sines of a level array are converted, δp = -p δc_h / c_h, has the effect, with
D = dx/dp = ∫ c / s³ dz:

    δz = c_b s_b p² D δc_h / c_h                          δx = -p D δc_h / c_h + δz p c_b / s_b

In uniform water this is δz = z (1 - tan²θ) δc / c and z tan²θ δc_h / c_h: the first changes sign at 45 degrees. The
neglected orders are smaller by a factor of about δc / (c s²).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.propagation.numpy_rays.eigenrays import eigenray
from mitsonar.water.profile import SoundSpeedProfile

__all__ = ["Smile", "smile_of_head", "smile_of_profile"]

POINTS = 8                         # points of Gauss-Legendre quadrature in every layer


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
    ways = _SmileWays.to(true, head_depth, bed_depth, across, (used,))
    off = used.at(ways.depth) - ways.speed
    p, s, c = ways.slowness[..., None], ways.sines, ways.speed
    deeper = ways.end_speed * ways.end_sine * ways.integral((1 - 2 * (p * c) ** 2) / (c * c * s**3) * off)
    further = ways.integral(p / s**3 * off) + deeper * ways.slowness * ways.end_speed / ways.end_sine
    return Smile(across=ways.across, depth_error=deeper, across_error=np.sign(ways.across) * further)


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
    slope = ways.integral(ways.speed / ways.sines**3)
    change = error / true.at(head_depth)
    deeper = ways.end_speed * ways.end_sine * ways.slowness**2 * slope * change
    further = -ways.slowness * slope * change + deeper * ways.slowness * ways.end_speed / ways.end_sine
    return Smile(across=ways.across, depth_error=deeper, across_error=np.sign(ways.across) * further)


@dataclass(frozen=True, kw_only=True, eq=False)
class _SmileWays:
    """Rays from a head to a level bed, and depths (Q,) of the integration points; sines are (..., Q)."""

    across: np.ndarray
    slowness: np.ndarray
    depth: np.ndarray
    weight: np.ndarray
    speed: np.ndarray
    end_speed: float

    @classmethod
    def to(cls, profile: SoundSpeedProfile, head_depth: float, bed_depth: float, across: ArrayLike,
           others: tuple[SoundSpeedProfile, ...] = ()) -> _SmileWays:
        if not head_depth < bed_depth:
            raise ValueError(f"the bed at {bed_depth:g} m is not below the head at {head_depth:g} m; give depths that "
                             "increase downwards.")
        across = np.asarray(across, float)
        ray = eigenray(profile, head_depth, bed_depth, np.abs(across))
        slowness = np.where(np.isnan(ray.turning_depth), ray.ray_parameter, np.nan)
        nodes = np.concatenate([profile.depth, *(other.depth for other in others)])
        edges = np.unique(np.r_[head_depth, nodes[(nodes > head_depth) & (nodes < bed_depth)], bed_depth])
        place, weight = np.polynomial.legendre.leggauss(POINTS)
        half = 0.5 * np.diff(edges)
        depth = (0.5 * (edges[1:] + edges[:-1])[:, None] + half[:, None] * place).ravel()
        return cls(across=across, slowness=slowness, depth=depth, weight=np.outer(half, weight).ravel(),
                   speed=profile.at(depth), end_speed=float(profile.at(bed_depth)))

    @property
    def sines(self) -> np.ndarray:
        """Return the sines of grazing along the rays."""
        return np.sqrt(1 - (self.slowness[..., None] * self.speed) ** 2)

    @property
    def end_sine(self) -> np.ndarray:
        """Return the sine of grazing at the bed."""
        return np.sqrt(1 - (self.slowness * self.end_speed) ** 2)

    def integral(self, values: np.ndarray) -> np.ndarray:
        """Return the integral over depth of values (..., Q)."""
        return values @ self.weight
