"""Pieces of facets within reach of a ping and in the beams of an array.

A piece is a triangle of level L that holds scatterer p of its facet (`nested_points`), and with it every scatterer
p + 4^L j. Small facets are pieces as a whole; large ones are cut, level by level, until pieces are about `SHARE` of the
reach large.

A piece of radius r whose middle is d away fills an angle of r / (d - r). Because water bends rays, rays to its
scatterers leave within WIDER times that angle of the ray to its middle. b is the bound of `ElementBeams.bound` at the
middle, with that angle added to (+) or taken from (-) the angle that the bound allows for:

    b(+) negligible       no scatterer counts
    b(-) large enough     all scatterers count
    else                  each scatterer is evaluated
"""
from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Sources

from .element_beams import ElementBeams
from .scatterers import Scatterers

SHARE = 0.015                      # largest radius of a piece relative to the reach,
FEWEST = 32                        # unless it has fewer scatterers


@dataclass(frozen=True, kw_only=True)
class Pieces:
    """Pieces of facets, (P,) each."""

    facet: np.ndarray  # (P,)
    level: np.ndarray  # (P,): L
    first: np.ndarray  # (P,): p
    number: np.ndarray  # (P,): scatterers of the whole facet
    threshold: np.ndarray  # (P,): h of the facet
    centre: np.ndarray  # (P, 3) [m]
    radius: np.ndarray  # (P,) [m]: of a ball that holds the piece

    def chosen(self, index: np.ndarray) -> Pieces:
        """Return the pieces with these numbers, or under this mask."""
        return Pieces(**{name: value[index] for name, value in vars(self).items()})

    @property
    def cells(self) -> np.ndarray:
        """Return the number of scatterers of each piece, int64 (P,)."""
        return np.maximum(-(-(self.number - self.first) >> 2 * self.level), 0)

    def runs(self, share: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return runs of scatterers: facet, first k, step of k, and how many there are, (P,) each.

        With a `share` (P,) of the facet's scatterers, runs hold those that can exist (`nested_points.exists`).
        """
        count, step = self.cells, np.int64(1) << 2 * self.level
        if share is not None:
            last = np.minimum(share, 1) * self.number - self.threshold
            count = np.where(share < 1, np.clip(np.ceil((last - self.first) / step), 0, count), count).astype(np.int64)
        return self.facet, self.first, step, count


def pieces_in_reach(scatterers: Scatterers, facets: np.ndarray, origin: np.ndarray, nearest: float,
                    farthest: float) -> Pieces:
    """Cut facets (K,) and keep the pieces that reach from `nearest` to `farthest` [m] from `origin` (3,)."""
    start = np.zeros(len(facets), np.int64)
    pieces = Pieces(facet=facets, level=start, first=start, number=scatterers.cuts[facets].astype(np.int64) ** 2,
                    threshold=scatterers.threshold[facets], centre=scatterers.centre[facets].astype(float),
                    radius=scatterers.radius[facets].astype(float))
    done = []
    while len(pieces.facet):
        distance = np.linalg.norm(pieces.centre - origin, axis=1)
        pieces = pieces.chosen((distance - pieces.radius < farthest) & (distance + pieces.radius > nearest))
        large = (pieces.radius > SHARE * farthest) & (pieces.cells > FEWEST)
        done.append(pieces.chosen(~large))
        pieces = _cut(scatterers, pieces.chosen(large))
    return Pieces(**{name: np.concatenate([getattr(part, name) for part in done or [pieces]])
                     for name in vars(pieces)})


def _cut(scatterers: Scatterers, pieces: Pieces) -> Pieces:
    """Return the four quarters of each piece, as far as they have scatterers."""
    fields = {name: np.repeat(value, 4, axis=0) for name, value in vars(pieces).items()}
    fields["first"] = fields["first"] + (np.tile(np.arange(4), len(pieces.facet)) << 2 * fields["level"])
    fields["level"] = fields["level"] + 1
    fields["centre"], fields["radius"] = scatterers.balls(fields["facet"], fields["first"], fields["level"])
    quarters = Pieces(**fields)
    return quarters.chosen(quarters.cells > 0)


NEGLIGIBLE = 1e-8                  # two-way intensity of the beams below which a scatterer is ignored
WIDER = 2.0
LARGEST = 0.1                      # [rad] pieces that fill more are evaluated one by one,
FEWEST_CELLS = 4                   # and all pieces if they have fewer scatterers on average
ROUNDED = 1.001                    # allowance for the rounding of bounds


@dataclass(frozen=True, kw_only=True)
class SideLobes:
    """Thinning in the side lobes of beams: fewer scatterers carry the energy of all.

    Where the bound b of the beams (`element_beams`) is below b₀ -> ``below``, a facet has the share b / b₀ of its
    scatterers, each for as much more area. No echo is stronger than one at b₀ could be. As the sonar moves on, single
    scatterers come or go while the others stay (`nested_points`).
    """

    below: float  # b₀

    def share(self, bound: mi.Float) -> mi.Float:
        """Return the shares of scatterers from the bounds of the beams there, Float (R,)."""
        return dr.minimum(bound * dr.opaque(mi.Float, 1 / self.below), 1)

    def largest_share(self, bound: np.ndarray) -> np.ndarray:
        """Return the largest shares in pieces with bounds (P,)."""
        return np.minimum(ROUNDED * bound / self.below, 1)


def pieces_in_beams(pieces: Pieces, connector: Connector, beams: ElementBeams, sources: Sources, origin: dr.ArrayBase,
                    rotation: np.ndarray, enough: float = NEGLIGIBLE) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 for pieces whose scatterers all count, -1 for none, 0 for undecided, (P,); and bounds of beams (P,)."""
    # origin (1,) [m]; rotation (3, 3)
    if not len(pieces.facet) or pieces.cells.sum() < FEWEST_CELLS * len(pieces.facet):
        return np.zeros(len(pieces.facet), int), np.ones(len(pieces.facet))
    lib = arrays_of(mi.Float)
    point = lib.Array3f64(*(upload(mi.Float64, column) for column in pieces.centre.T))
    distance = dr.norm(point - origin)
    radius = upload(mi.Float64, pieces.radius)
    angle = mi.Float(WIDER * radius / dr.maximum(distance - radius, 1e-9))
    direction = connector.launch_direction(sources, origin, mi.UInt32(0), point)
    most, least = (beams.bound(direction, mi.Float(distance), rotation, wider) for wider in (angle, -angle))
    small = angle < WIDER * LARGEST
    dr.eval(small, most, least)
    inside, outside = ((small & decided).numpy() for decided in (least > enough, most <= NEGLIGIBLE))
    return inside.astype(int) - outside, np.where(small.numpy(), most.numpy(), 1.0)
