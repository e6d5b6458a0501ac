"""One pass of a ray through layers of constant gradient (`layer_arcs`), cut to size for a batch of rays.

The sine at any depth follows from the grazing angle at the fastest depth of the pass (speed ``fastest``), without the
cancellation of 1 - (p c)^2:

    s^2 = sine^2 + cosine^2 (1 - (c / fastest)^2),       p = cosine / fastest

`Layers` holds h, c and 1 - (c / fastest)^2 for a batch of rays; ``sine`` and ``cosine`` are those at the fastest depth.
"""
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitsonar.water.profile import SoundSpeedProfile

from .layer_arcs import LayerArc


class Pass(NamedTuple):
    """Sums over the layers of a pass, each (N,); sines are those at the D depths it was cut at, (N, D)."""

    range_per_parameter: np.ndarray  # x / p [m^2/s]
    range_slope: np.ndarray  # dx/dp [m^2/s]
    travel_time: np.ndarray  # [s]
    arc_length: np.ndarray  # [m]
    sines: np.ndarray


@dataclass(frozen=True)
class Layers:
    """Layers that N rays cross downwards, from depth to depth."""

    thickness: np.ndarray  # (N, L) [m]: zero where a ray does not reach the layer
    speed: np.ndarray  # (N, L+1) [m/s]: at the edges of the layers
    deficit: np.ndarray  # (N, L+1) [-]: 1 - (c / fastest)^2 at the edges, never negative
    fastest: np.ndarray  # (N,) [m/s]: the largest speed of the pass
    passes: np.ndarray  # (L,) [-]: how often a ray crosses each layer
    ends: list[int]  # the edges at which these depths lie

    @classmethod
    def between(cls, profile: SoundSpeedProfile, *depths: np.ndarray, passes: Sequence[int] = (1,)) -> "Layers":
        """Cut the profile at depths (N,) [m] that go downwards; the k-th stretch is crossed ``passes[k]`` times."""
        gradients = profile.gradients
        edges, slopes, repeats, ends = [depths[0][:, None]], [], [], [0]
        for upper, lower, count in zip(depths, depths[1:], passes):
            first, last = np.searchsorted(profile.depth, [upper.min(), lower.max()])
            edges += [np.clip(profile.depth[first:last], upper[:, None], lower[:, None]), lower[:, None]]
            slopes.append(gradients[first:last + 1])
            repeats += [count] * (last - first + 1)
            ends.append(len(repeats))
        thickness = np.diff(np.concatenate(edges, axis=1))
        # Speeds by adding up the gradients: between two depths a hair apart their difference is exact.
        rise = np.zeros((thickness.shape[0], thickness.shape[1] + 1))
        np.cumsum(thickness * np.concatenate(slopes), axis=1, out=rise[:, 1:])
        below_fastest = rise.max(axis=1, keepdims=True) - rise
        speed = profile.at(depths[0])[:, None] + rise
        fastest = speed[:, :1] + below_fastest[:, :1]
        deficit = below_fastest * (fastest + speed) / fastest**2
        return cls(thickness, speed, deficit, fastest[:, 0], np.array(repeats, float), ends)

    def __getitem__(self, rays: np.ndarray | slice) -> "Layers":
        return Layers(self.thickness[rays], self.speed[rays], self.deficit[rays], self.fastest[rays], self.passes,
                      self.ends)

    def sines(self, sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
        """Return the sines (N, L+1) at all edges."""
        return np.sqrt((sine**2)[:, None] + (cosine**2)[:, None] * self.deficit)

    def arcs(self, sines: np.ndarray) -> LayerArc:
        """Return the arcs (N, L) through every layer, of rays with sines (N, L+1) at the edges."""
        return LayerArc(self.thickness, self.speed[:, :-1], self.speed[:, 1:], sines[:, :-1], sines[:, 1:])

    def reach(self, sine: np.ndarray, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return only x / p and dx/dp (N,), for a search."""
        arcs = self.arcs(self.sines(sine, cosine))
        return arcs.stretch @ self.passes, arcs.slope @ self.passes

    def cross(self, sine: np.ndarray, cosine: np.ndarray) -> Pass:
        """Return all sums of a `Pass`."""
        sines = self.sines(sine, cosine)
        arcs = self.arcs(sines)
        length = arcs.length((cosine / self.fastest)[:, None])
        return Pass(arcs.stretch @ self.passes, arcs.slope @ self.passes, arcs.time @ self.passes,
                    length @ self.passes, sines[:, self.ends])
