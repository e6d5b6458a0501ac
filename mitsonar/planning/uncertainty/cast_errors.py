"""Depth errors of a swath that is reduced with a wrong sound-speed profile: the smile.

The sonar measures the angle of a beam at its head and the time of the echo. Its own sensor measures the sound speed at
the head, so p = sin(θ) / c(h) is right. The water bends the ray by the true profile c; the survey traces it through
another profile c',

    t = T(p, d; c)           d' : T(p, d'; c') = t           error = d' - d

where T is the time down to a depth (`ray_paths.misplaced`). The measured speed at the head is a node of the other
profile, as in `reduction` and instruments, so `mitsonar.soundings` makes the same errors with that profile.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.hydrography.reduction.ray_paths import misplaced
from mitsonar.hydrography.survey_orders import SurveyOrder
from mitsonar.water.profile import SoundSpeedProfile

MOST_NODES = 1000
_EDGE = 0.01                       # [m] over which the error of a surface layer ends


@dataclass(frozen=True, kw_only=True, eq=False)
class CastError:
    """Depth errors (A,) [m] of beams at angles (A,) [rad] over a level bed, NaN without an echo; allowed TVU [m]."""

    depth: float
    angle: np.ndarray
    error: np.ndarray
    allowed: float

    @property
    def outer(self) -> float:
        """Return the error [m] of the outermost beam."""
        return float(self.error[-1])

    @property
    def good_angle(self) -> float:
        """Return the angle [rad] up to which the error stays within the order."""
        return within_angle(self.angle, np.abs(self.error), self.allowed)


def within_angle(angle: np.ndarray, size: np.ndarray, allowed: float) -> float:
    """Return the angle [rad] up to which errors (A,) at angles (A,) stay within a size; 0 if the first does not."""
    bad = ~(size <= allowed)
    if not bad.any():
        return float(angle[-1])
    first = int(np.argmax(bad))
    if first == 0:
        return 0.0
    before, after = size[first - 1:first + 1]
    share = (allowed - before) / (after - before) if np.isfinite(after) else 0.0
    return float(angle[first - 1] + share * (angle[first] - angle[first - 1]))


def depth_error(true: SoundSpeedProfile, used: SoundSpeedProfile, head_depth: float, depth: float,
                angle: np.ndarray) -> np.ndarray:
    """Return the depth errors [m] of beams at angles (A,) [rad] over a level bed; NaN where no ray arrives."""
    speed = float(true.at(head_depth))
    return misplaced(true, used, head_depth, depth, np.sin(angle) / speed, head_speed=speed)[1] - depth


def cast_error(true: SoundSpeedProfile, used: SoundSpeedProfile, head_depth: float, depth: float, half_angle: float,
               order: SurveyOrder) -> CastError:
    """Return the depth errors of a swath over a level bed, with the error that a survey order allows."""
    angle = np.linspace(0.0, half_angle, 65)
    return CastError(depth=float(depth), angle=angle, error=depth_error(true, used, head_depth, depth, angle),
                     allowed=float(order.vertical(depth)))


def surface_layer_error(profile: SoundSpeedProfile, error: float, layer: float) -> SoundSpeedProfile:
    """Return a profile with an error [m/s] added from the surface down to ``layer`` [m], one node per metre."""
    edges = [layer, layer + _EDGE]
    depth = np.union1d(profile.depth, [*np.linspace(0, layer, min(int(np.ceil(layer)), MOST_NODES) + 1), *edges])
    share = np.interp(depth, edges, [1.0, 0.0])
    return SoundSpeedProfile(depth, profile.at(depth) + error * share)
