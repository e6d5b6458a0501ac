"""Derivatives of exact rays by the sound-speed profile and by their ends (NumPy).

With hat_k the share of node k in the speed at a depth, s the sine of grazing, positive down, p the ray parameter:

    dT/dc_k = -∫ hat_k / c² dl                      at fixed ends (Fermat: a ray's own shift costs no time)
    dT/dz0 = -s0 / c0,   dT/dz1 = s1 / c1,   dT/dX = p                      by the ends
    dX/dc_k = p ∫ hat_k / s³ dz - (p / c0) hat_k(z0) dX/dp                  at fixed launch angle and depths
    dX/dz0 = -p c0 / s0 - (p g0 / c0) dX/dp,   dX/dθ0 = -(s0 / c0) dX/dp   likewise

and at fixed launch angle dT = p dX + dT at fixed ends. k -> the nodes of ``profile``; 0 and 1 -> the source and the
target; g -> gradient of the layer that the ray starts into. The integrals are those of `arc_derivatives`, layer by
layer; the uniform water beyond the profile has the speed of its end.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.water.profile import SoundSpeedProfile

from ..device_rays.arc_derivatives import arc_derivatives
from .eigenrays import Eigenray

BLOCK = 1 << 18                    # numbers of a block of rays: memory stays bounded


@dataclass(frozen=True, kw_only=True)
class RayDerivatives:
    """Derivatives of rays; K nodes last, NaN where there is no ray.

    At fixed launch angle the time to the target's depth moves by ``time_by_speed + time_by_range * range_by_speed``.
    Those of the range are infinite or NaN for a ray that starts or arrives level.
    """

    time_by_speed: np.ndarray  # (..., K) [s²/m]: of the travel time between fixed ends
    time_by_source: np.ndarray  # (...) [s/m]: by the depth of the source
    time_by_target: np.ndarray  # (...) [s/m]: by the depth of the target
    time_by_range: np.ndarray  # (...) [s/m]: likewise by the horizontal distance
    range_by_speed: np.ndarray  # (..., K) [s]: of the horizontal range at the target's depth, at fixed launch angle
    range_by_source: np.ndarray  # (...): likewise by the source's depth
    range_by_launch: np.ndarray  # (...) [m/rad]: by the launch angle, positive down


def ray_derivatives(profile: SoundSpeedProfile, source_depth: ArrayLike, target_depth: ArrayLike,
                    ray: Eigenray) -> RayDerivatives:
    """Differentiate rays, direct or turned once.

    Relative error about 1e-15 / s² with s the least sine on the way, 1e-12 of rays that are not level somewhere.
    """
    # source_depth, target_depth [m]
    shape, nodes = np.shape(ray.travel_time), profile.depth.size
    try:
        ends = [np.broadcast_to(np.asarray(depth, float), shape).ravel() for depth in (source_depth, target_depth)]
    except ValueError:
        raise ValueError(f"ray derivatives: depths of the shapes {np.shape(source_depth)} and {np.shape(target_depth)} "
                         f"do not fit rays of the shape {shape}; give a depth for each ray.") from None
    names = "travel_time", "arc_length", "ray_parameter", "launch_angle", "arrival_angle", "turning_depth"
    time, length, parameter, launch, arrival, turning = (np.ravel(getattr(ray, name)) for name in names)
    exists = np.isfinite(time)
    level = exists & (ends[0] == ends[1]) & np.isnan(turning)
    integrals = np.full((2, len(time), nodes), np.nan)
    spread = np.full(len(time), np.nan)
    upwards = turning < np.minimum(*ends)
    mirrored = profile.upside_down()
    size = max(1, BLOCK // (nodes + 2))
    for water, sign, kind in ((profile, 1, ~upwards), (mirrored, -1, upwards)):
        some = np.flatnonzero(exists & ~level & kind)
        for start in range(0, some.size, size):
            rays = some[start:start + size]
            source, target = sign * ends[0][rays], sign * ends[1][rays]
            sines = np.abs(np.sin([launch[rays], arrival[rays]]))
            sums = _LayerSums(water, parameter[rays], np.where(source <= target, sines, sines[::-1]))
            sums.follow(np.minimum(source, target), np.maximum(source, target), sign * turning[rays])
            integrals[:, rays], spread[rays] = sums.integrals[..., ::sign], sums.spread
    speed = profile.at(ends[0])
    at_source = hats(profile, ends[0])
    integrals[0, level] = at_source[level] * (length / speed ** 2)[level, None]
    s0, s1 = np.sin(launch), np.sin(arrival)
    gradient = np.where(s0 < 0, profile.gradient(ends[0], "above"), profile.gradient(ends[0], "below"))
    with np.errstate(divide="ignore", invalid="ignore"):
        turned_by_speed = spread * parameter / speed
        by_speed = integrals[1] - turned_by_speed[:, None] * at_source
        by_source = -parameter * speed / s0 - turned_by_speed * gradient
    flat = {"time_by_source": -s0 / speed, "time_by_target": s1 / profile.at(ends[1]), "time_by_range": parameter,
            "range_by_source": by_source, "range_by_launch": -s0 / speed * spread}
    wide = {"time_by_speed": -integrals[0], "range_by_speed": by_speed}
    return RayDerivatives(**{name: values.reshape(shape) for name, values in flat.items()},
                          **{name: values.reshape(*shape, nodes) for name, values in wide.items()})


class PassageDerivatives(NamedTuple):
    """Return derivatives of N rays of given ray parameter between two depths, by K nodes."""

    time_by_speed: np.ndarray  # (N, K) [s²/m]: of the time between fixed ends
    range_by_speed: np.ndarray  # (N, K) [s]: of the range at fixed parameter
    range_by_parameter: np.ndarray  # (N,) [m²/s]


def passage_derivatives(profile: SoundSpeedProfile, parameter: np.ndarray, upper: np.ndarray,
                        lower: np.ndarray) -> PassageDerivatives:
    """Differentiate direct rays of given ray parameter (N,) [s/m] between two depths (N,) [m], which they reach."""
    nodes = profile.depth.size
    by_speed, spread = np.empty((2, len(parameter), nodes)), np.empty(len(parameter))
    size = max(1, BLOCK // (nodes + 2))
    for start in range(0, len(parameter), size):
        some = slice(start, start + size)
        p, ends = parameter[some], (upper[some], lower[some])
        sums = _LayerSums(profile, p, np.sqrt(np.maximum([1 - (p * profile.at(depth)) ** 2 for depth in ends], 0)))
        sums.follow(*ends, np.full(len(p), np.nan))
        by_speed[:, some], spread[some] = sums.integrals, sums.spread
    return PassageDerivatives(-by_speed[0], by_speed[1], spread)


def hats(profile: SoundSpeedProfile, depth: np.ndarray) -> np.ndarray:
    """Return the share of each node in the speed at depths (N,): (N, K), each row of sum 1."""
    nodes, rays = profile.depth, np.arange(len(depth))
    shares = np.zeros((len(depth), nodes.size))
    lower = np.clip(np.searchsorted(nodes, depth), 1, max(nodes.size - 1, 1)).clip(max=nodes.size - 1)
    upper = np.maximum(lower - 1, 0)
    gap = np.where(lower > upper, nodes[lower] - nodes[upper], 1.0)
    below = np.where(lower > upper, np.clip((depth - nodes[upper]) / gap, 0, 1), 0.0)
    np.add.at(shares, (rays, upper), 1 - below)
    np.add.at(shares, (rays, lower), below)
    return shares


class _LayerSums:
    """Sums over the arcs of rays, direct or turned below both ends.

    ``integrals`` are ∫ hat / (c² s) dz and p ∫ hat / s³ dz, (2, N, K), and ``spread`` is dX/dp (N,).
    """

    def __init__(self, profile: SoundSpeedProfile, parameter: np.ndarray, sines: np.ndarray):
        """Begin with rays of parameter (N,) and sines (2, N) at the upper and the lower end."""
        self.profile, self.parameter, self.sines = profile, parameter, sines
        self.slopes = profile.gradients
        self.integrals = np.zeros((2, len(parameter), profile.depth.size))
        self.spread = np.zeros(len(parameter))

    @np.errstate(divide="ignore", invalid="ignore")       # of vertical rays and in the form that a layer does not use
    def follow(self, upper: np.ndarray, lower: np.ndarray, turning: np.ndarray) -> None:
        """Add rays between two depths (N,), over a turning depth where that is not NaN."""
        nodes, turned = self.profile.depth, np.isfinite(turning)
        layer = self._layer_of(turning, turned)
        near = np.where(turned, np.maximum(nodes[layer - 1], lower), lower)
        near_sine = self._below(near, turning, layer, turned)
        # the sine at one depth gives it at all: of a turned ray at its last layer, else at the faster end
        speeds = np.array([self.profile.at(upper), self.profile.at(lower)])
        fast, rays = np.where(speeds[0] > speeds[1], 0, 1), np.arange(len(upper))
        known_sine = np.where(turned, near_sine, self.sines[fast, rays])
        known_speed = np.where(turned, self.profile.at(near), speeds[fast, rays])
        edges = np.r_[-np.inf, nodes, np.inf]
        for number in range(nodes.size + 1):
            for first, last, weight in ((upper, lower, 1.0), (lower, near, 2.0)):
                top, bottom = (np.clip(depth, edges[number], edges[number + 1]) for depth in (first, last))
                if not (bottom > top).any():
                    continue
                c1 = self.profile.at(top)
                c2 = c1 + self.slopes[number] * (bottom - top)
                s1, s2 = (np.sqrt(np.maximum(known_sine ** 2 - self.parameter ** 2 * (c - known_speed)
                                             * (c + known_speed), 0)) for c in (c1, c2))
                self._add(np.full(len(rays), number), top, bottom, c1, s1, s2, np.where(bottom > top, weight, 0.0))
        if turned.any():
            sine = np.where(turned, near_sine, 1.0)
            self._add(layer, near, near, self.profile.at(near), sine, np.where(turned, -sine, sine),
                      turned.astype(float))

    def _layer_of(self, turning: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Return the number of each ray's turning layer; rounding may put the turn slightly below it."""
        nodes = self.profile.depth
        number = np.clip(np.searchsorted(nodes, np.where(turned, turning, nodes[0])), 1, max(nodes.size - 1, 1))
        return np.where(turned & (self.slopes[number] <= 0), np.maximum(number - 1, 1), number)

    def _below(self, near: np.ndarray, turning: np.ndarray, layer: np.ndarray, turned: np.ndarray) -> np.ndarray:
        """Return the sine at `near` of rays that turn below: s² = p² (c_turn - c)(c_turn + c), c_turn = 1/p."""
        rise = self.slopes[layer] * np.where(turned, turning - near, 0.0)
        return self.parameter * np.sqrt(np.maximum(rise * (2 / self.parameter - rise), 0))

    def _add(self, number: np.ndarray, top: np.ndarray, bottom: np.ndarray, c1: np.ndarray, s1: np.ndarray,
             s2: np.ndarray, weight: np.ndarray) -> None:
        """Add arcs between two depths of the layers below the nodes ``number - 1``, so often."""
        nodes, slope, descent = self.profile.depth, self.slopes[number], bottom - top
        arc = arc_derivatives(self.parameter, slope, descent, c1, s1, c1 + slope * descent, s2)
        self.spread += weight * arc.spread
        above, below = np.maximum(number - 1, 0), np.minimum(number, nodes.size - 1)
        gap = np.where(below > above, nodes[below] - nodes[above], np.inf)
        rays = np.arange(len(top))
        for sums, whole, part in zip(self.integrals, (arc.time, arc.range), (arc.time_slope, arc.range_slope)):
            share = (whole * (top - nodes[above]) + part) / gap           # of the lower node; none beyond the profile
            sums[rays, below] += weight * share
            sums[rays, above] += weight * (whole - share)
