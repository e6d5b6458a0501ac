"""Legs of sound between an array and the bed: one pass down through the layers, of as many rays as there are.

A ray keeps its horizontal slowness p. In a layer of thickness h, from the speed c1 and the sine of grazing s1 to c2 and
s2 = √(1 - p² c2²), with d = c2 - c1 (the forms of `mitsonar.propagation.layers`, exact as d goes to 0):

    a = h (c1 + c2) / (s1 + s2)       x = p a,       dx/dp = a / (s1 s2)
    t = (2 h / e) atanh(d / e) / (d / e),            e = c2 s1 + c1 s2
    l = (2 h / (s1 + s2)) atan(w) / w,               w = p d / (s1 + s2)

In a layer of gradient g a ray goes within the time t, with u = g t and T = tanh u,

    s2 = (s1 - T) / (1 - s1 T),       h = c1 t (s1 - tanh(u/2)) sinhc u / (cosh u - s1 sinh u)

The head's own sensor: a ray may start with a speed that the cast does not have. That speed is then the profile's node
at the ray's start, and the water is linear from there to the next node of the cast below. That is what the real-time
processing of an EM 710 does: of the blends tried (the same, the head's speed down to the next node, a step to the cast,
the cast shifted, a ramp of 1 to 20 m) it alone gives that instrument's two-way times to 1.0 to 1.7 mm, one way and rms
over a ping, and its lever arms to centimetres; a step, or no node, leaves 6 to 9 mm.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..propagation.layers import atan_ratio, atanh_ratio
from ..water import SoundSpeedProfile
from ..water.profile import SAME_DEPTH

__all__ = ["Leg", "Starts"]

BLOCK = 2048                       # rays at a time: their layers stay in the processor's cache


class Leg(NamedTuple):
    """Rays from their starts to a depth each: (N,), NaN where a ray turns before.

    ``stretch`` is x / p and ``slope`` dx/dp [m²/s]; ``sine`` and ``speed`` are those at the end.
    """

    stretch: np.ndarray
    slope: np.ndarray
    time: np.ndarray
    length: np.ndarray
    sine: np.ndarray
    speed: np.ndarray

    @classmethod
    def joined(cls, blocks: list[Leg]) -> Leg:
        """Put blocks of rays one after another."""
        return cls(*map(np.concatenate, zip(*blocks)))


@dataclass(frozen=True, kw_only=True, eq=False)
class Starts:
    """Where rays start, in which water.

    Parameters
    ----------
    profile : SoundSpeedProfile
    depth : array (N,) [m]
    head_speed : array (N,) [m/s] or None
        Speed at the start, in place of the profile's; None: the profile's own. Below the profile's last node, where
        there is no node to go to, rays see the profile at once.
    """

    profile: SoundSpeedProfile
    depth: np.ndarray
    head_speed: np.ndarray | None = None

    @property
    def speed(self) -> np.ndarray:
        """At the start: (N,) [m/s]."""
        return self.profile.at(self.depth) if self.head_speed is None else self.head_speed

    def __getitem__(self, rays: np.ndarray | slice) -> Starts:
        head = None if self.head_speed is None else self.head_speed[rays]
        return Starts(profile=self.profile, depth=self.depth[rays], head_speed=head)

    def mirrored(self) -> Starts:
        """Turn the water upside down: what went up goes down."""
        return Starts(profile=SoundSpeedProfile(-self.profile.depth[::-1], self.profile.sound_speed[::-1]),
                      depth=-self.depth, head_speed=self.head_speed)

    def to_depth(self, slowness: np.ndarray, depth: np.ndarray) -> Leg:
        """Follow rays of horizontal slowness (N,) [s/m] down to depths (N,) [m]."""
        parts = range(0, len(depth), BLOCK)
        return Leg.joined([self[i:i + BLOCK]._cross(slowness[i:i + BLOCK], depth[i:i + BLOCK]) for i in parts])

    def depth_after(self, slowness: np.ndarray, time: np.ndarray) -> np.ndarray:
        """Follow rays that start downwards for a time (N,) [s]: depth (N,) [m], NaN of a ray that turned by then."""
        parts = range(0, len(time), BLOCK)
        return np.concatenate([self[i:i + BLOCK]._run(slowness[i:i + BLOCK], time[i:i + BLOCK]) for i in parts])

    def _edges(self, lowest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Depths and speeds (N, L + 1) of the edges of the layers from the starts down to `lowest` (N,)."""
        nodes = self.profile.depth
        known = self.depth[np.isfinite(self.depth)]
        first = np.searchsorted(nodes, known.min(initial=np.inf))
        last = np.searchsorted(nodes, np.max(lowest, initial=-np.inf, where=np.isfinite(lowest)))
        between = np.clip(nodes[first:last], self.depth[:, None], lowest[:, None])
        edges = np.concatenate([self.depth[:, None], between, lowest[:, None]], axis=1)
        speeds = self.profile.at(edges)
        if self.head_speed is not None:
            following = self._next()
            down = (edges - self.depth[:, None]) / (following - self.depth)[:, None]
            joined = self.head_speed[:, None] + down * (self.profile.at(following) - self.head_speed)[:, None]
            ramp = (edges < following[:, None]) & np.isfinite(following)[:, None]
            speeds = np.where(ramp, joined, speeds)
        return edges, speeds

    def _next(self) -> np.ndarray:
        """Depth (N,) of the cast's next node below the head's; infinite where there is none."""
        return np.r_[self.profile.depth, np.inf][np.searchsorted(self.profile.depth, self.depth + SAME_DEPTH)]

    def _cross(self, slowness: np.ndarray, depth: np.ndarray) -> Leg:
        edges, speed = self._edges(depth)
        thickness, step = np.diff(edges), np.diff(speed)
        with np.errstate(invalid="ignore", divide="ignore"):
            sines = np.sqrt(1 - (slowness[:, None] * speed) ** 2)
            upper, lower = sines[:, :-1], sines[:, 1:]
            both = upper + lower
            stretch = thickness * (speed[:, :-1] + speed[:, 1:]) / both
            slope = stretch / (upper * lower)
            across = speed[:, 1:] * upper + speed[:, :-1] * lower
            time = 2 * thickness / across * atanh_ratio(step / across)
            length = 2 * thickness / both * atan_ratio(slowness[:, None] * step / both)
        return Leg(stretch.sum(1), slope.sum(1), time.sum(1), length.sum(1), sines[:, -1], speed[:, -1])

    def _run(self, slowness: np.ndarray, time: np.ndarray) -> np.ndarray:
        fastest = max(float(self.profile.sound_speed.max()), float(np.max(self.speed, initial=0)))
        edges, speed = self._edges(self.depth + fastest * np.where(np.isfinite(time), time, 0.0))
        thickness, step = np.diff(edges), np.diff(speed)
        with np.errstate(invalid="ignore", divide="ignore"):
            sines = np.sqrt(1 - (slowness[:, None] * speed) ** 2)
            across = speed[:, 1:] * sines[:, :-1] + speed[:, :-1] * sines[:, 1:]
            spent = np.cumsum(2 * thickness / across * atanh_ratio(step / across), axis=1)
            spent = np.concatenate([np.zeros_like(spent[:, :1]), np.where(np.isnan(spent), np.inf, spent)], axis=1)
        # The last edge that a ray reaches in time; edges at one depth are passed in no time.
        at = np.minimum((spent <= time[:, None]).sum(1) - 1, thickness.shape[1] - 1).clip(0)
        rays = np.arange(len(time))
        rest = time - spent[rays, at]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            gradient = np.where(thickness[rays, at] > 0, step[rays, at] / thickness[rays, at], 0)
            sine, bend = sines[rays, at], gradient * rest
            sinhc = np.where(np.abs(bend) > 1e-6, np.sinh(bend) / np.where(bend == 0, 1, bend), 1 + bend * bend / 6)
            further = rest * (sine - np.tanh(bend / 2)) * sinhc / (np.cosh(bend) - sine * np.sinh(bend))
            turned = sine <= np.tanh(bend)
        return np.where(turned, np.nan, edges[rays, at] + speed[rays, at] * further)
