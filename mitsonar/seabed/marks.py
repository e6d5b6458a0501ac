"""Marks in a seabed: pock marks, furrows of what was dragged over it, and sand ribbons.

    pock mark     h = -depth (1 - q^2)^2,   q = 2 r / diameter < 1;            volume  pi depth diameter^2 / 12
    drag mark     h = -depth (1 - s^2 / 3)^2 (1 - s^2),   s = 2 v / width,  |s| < sqrt(3)
                  area of its cross-section  32 sqrt(3) / 105 depth width;  berms of 0.13 depth on both sides
    sand ribbon   h = height (1 - q^2)^2,   q = 2 (u - crest) / width,  |q| < 1;   mean  8/15 height width / spacing

r -> metres from the middle, v -> metres across the mark, u -> metres across the ribbons. Where two marks cross, the bed
is as deep as the deeper of them. Marks and ribbons are hashed by place: a longer bed shows more of the same.

References
----------
Hovland and Judd (1988), Seabed Pockmarks and Seepages: pock marks are some metres to some hundred metres wide, most of
them less than a tenth as deep.
Kenyon (1970), Sand ribbons of European tidal seas, Marine Geology 9, 25.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .places import around, tiles, wander
from .relief import Relief, along, check, step

STEEPEST = 16 / (3 * np.sqrt(3))     # slope of (1 - q^2)^2 over the whole width, per height over width
_PER_TILE = 8                        # marks in a tile, on average
_BERM = np.sqrt(3)                   # of half a furrow's width: outer edge of its berms
_ENDS = 2.0                          # widths over which a drag mark begins and ends
_LENGTHS = 0.5, 1.5                  # of the mean length: bounds of a uniform distribution
_BOW = 0.03                          # of the length: largest offset of the middle of a mark
_PIECE = 8.0                         # widths of a drag mark that are worked on together


@dataclass(frozen=True, kw_only=True)
class PockMarks(Relief):
    """Round hollows where gas or water has seeped out."""

    density: float  # [1/m^2]
    diameter: float  # [m]: mean, from rim to rim
    depth: float  # [m]: mean, of the middle below the rim
    spread: float = 0.3  # diameter and depth vary together, uniformly by factors from 1 - spread to 1 + spread
    seed: int = 0

    def __post_init__(self):
        for name, holds, expected in (
                ("density", 0 <= self.density < np.inf, "a finite number [1/m^2], at least 0"),
                ("diameter", 0 < self.diameter < np.inf, "a finite number [m] above 0"),
                ("depth", 0 <= self.depth * STEEPEST <= self.diameter,
                 f"from 0 to {self.diameter / STEEPEST:.3g} m, or its sides would be steeper than 45 degrees"),
                ("spread", 0 <= self.spread < 1, "at least 0 and below 1")):
            check("pock marks", name, getattr(self, name), holds, expected)
        check("pock marks", "density", self.density, self.density * self.diameter**2 <= 1,
              f"at most {self.diameter ** -2:.3g} per m^2 for marks of {self.diameter:g} m; more would cover the bed")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.asarray(x, float), np.asarray(y, float)
        heights = np.zeros((y.size, x.size))
        d_x, d_y = step("x", x), step("y", y)
        for place, factor in self._marks(x, y):
            radius = factor * self.diameter / 2
            columns, rows = around(place[0], radius, x, d_x), around(place[1], radius, y, d_y)
            share = np.square(x[columns] - place[0]) + np.square(y[rows, None] - place[1])
            hollow = -self.depth * factor * np.square(np.maximum(1 - share / radius**2, 0))
            np.minimum(heights[rows, columns], hollow, out=heights[rows, columns])
        return heights

    def _marks(self, x: np.ndarray, y: np.ndarray) -> Iterator[tuple[np.ndarray, float]]:
        """Yield the middle (2,) [m] and the factor of size of the marks that may reach the grid."""
        if self.density == 0:
            return
        side, margin = np.sqrt(_PER_TILE / self.density), (1 + self.spread) * self.diameter / 2
        for generator, corner in tiles(self.seed, 2, x, y, side=side, margin=margin):
            count = generator.poisson(_PER_TILE)
            yield from zip(corner + generator.uniform(0, side, (count, 2)),
                           generator.uniform(1 - self.spread, 1 + self.spread, count))


@dataclass(frozen=True, kw_only=True)
class DragMarks(Relief):
    """Furrows with berms: tracks of trawls, anchors or keels of ice."""

    density: float  # [1/m^2]: of the middles of the marks
    width: float  # [m]: between the berms, at the height of the bed
    depth: float  # [m]
    length: float  # [m]: mean; marks have half to one and a half of it
    heading: float = 0.0  # [rad]: mean compass heading along the marks
    heading_spread: float = 0.2  # [rad]: standard deviation of the heading
    seed: int = 0

    def __post_init__(self):
        for name, holds, expected in (
                ("density", 0 <= self.density < np.inf, "a finite number [1/m^2], at least 0"),
                ("width", 0 < self.width < np.inf, "a finite number [m] above 0"),
                ("depth", 0 <= self.depth <= self.width / 2, f"from 0 to {self.width / 2:g} m, half the width"),
                ("length", 12 * self.width <= self.length < np.inf,
                 f"a finite number, at least {12 * self.width:g} m, 12 widths"),
                ("heading_spread", 0 <= self.heading_spread < np.inf, "a finite number [rad], at least 0")):
            check("drag marks", name, getattr(self, name), holds, expected)
        check("drag marks", "density", self.density, self.density * self.width * self.length <= 1,
              f"at most {1 / (self.width * self.length):.3g} per m^2 for marks of this size; more would cover the bed")

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.asarray(x, float), np.asarray(y, float)
        lowered, raised = np.zeros((2, y.size, x.size))
        d_x, d_y = step("x", x), step("y", y)
        reach = self.width * (_PIECE + _BERM) / 2
        for middle, heading, length, bow in self._marks(x, y):
            ahead = np.array([np.sin(heading), np.cos(heading)])
            aside = np.array([ahead[1], -ahead[0]])
            pieces = (np.arange(int(np.ceil(length / (_PIECE * self.width)))) + 0.5) * _PIECE * self.width - length / 2
            offsets = bow * (1 - np.square(2 * pieces / length))
            for centre in middle + pieces[:, None] * ahead + offsets[:, None] * aside:
                columns, rows = around(centre[0], reach, x, d_x), around(centre[1], reach, y, d_y)
                east, north = x[columns] - middle[0], y[rows, None] - middle[1]
                if east.size * north.size == 0:
                    continue
                along_mark = east * ahead[0] + north * ahead[1]
                across = east * aside[0] + north * aside[1] - bow * (1 - np.square(2 * along_mark / length))
                furrow = self._furrow(np.square(2 * across / self.width)) * self._ends(along_mark, length)
                np.minimum(lowered[rows, columns], furrow, out=lowered[rows, columns])
                np.maximum(raised[rows, columns], furrow, out=raised[rows, columns])
        return lowered + raised

    def _furrow(self, square: np.ndarray) -> np.ndarray:
        return -self.depth * np.square(np.maximum(1 - square / 3, 0)) * (1 - square)

    def _ends(self, along_mark: np.ndarray, length: float) -> np.ndarray:
        share = np.clip((length / 2 - np.abs(along_mark)) / (_ENDS * self.width), 0, 1)
        return share * share * (3 - 2 * share)

    def _marks(self, x: np.ndarray, y: np.ndarray) -> Iterator[tuple[np.ndarray, float, float, float]]:
        """Yield the middle (2,) [m], heading [rad], length and bow [m] of the marks that may reach the grid."""
        if self.density == 0:
            return
        side = np.sqrt(_PER_TILE / self.density)
        margin = _LENGTHS[1] * self.length * (0.5 + _BOW) + _BERM * self.width
        for generator, corner in tiles(self.seed, 3, x, y, side=side, margin=margin):
            count = generator.poisson(_PER_TILE)
            place = corner + generator.uniform(0, side, (count, 2))
            heading = self.heading + self.heading_spread * generator.standard_normal(count)
            length = self.length * generator.uniform(*_LENGTHS, count)
            yield from zip(place, heading, length, length * generator.uniform(-_BOW, _BOW, count))


@dataclass(frozen=True, kw_only=True)
class SandRibbons(Relief):
    """Long low ridges along the current, side by side on a bed that stays bare between them."""

    spacing: float  # [m]: between the crests of neighbours
    height: float  # [m]: of the crest above the bed
    width: float | None = None  # [m]: of a ribbon, at most the spacing; None: half the spacing
    heading: float = 0.0  # [rad]: compass heading along the ribbons
    wander: float = 0.0  # [m]: root-mean-square displacement of the crests across the heading
    wander_length: float | None = None  # [m]: scale of the wander, at least 2 ``wander``; None: 4 spacings
    seed: int = 0

    def __post_init__(self):
        for name, holds, expected in (
                ("spacing", 0 < self.spacing < np.inf, "a finite number [m] above 0"),
                ("width", 0 < self._width <= self.spacing, f"above 0 and at most {self.spacing:g} m, the spacing"),
                ("height", 0 <= self.height * STEEPEST <= self._width,
                 f"from 0 to {self._width / STEEPEST:.3g} m, or its sides would be steeper than 45 degrees"),
                ("wander", 0 <= self.wander < np.inf, "a finite number [m], at least 0"),
                ("wander_length", self._wander_length >= 2 * self.wander,
                 f"at least twice the wander of {self.wander} m, or ribbons would overtake each other")):
            check("sand ribbons", name, getattr(self, name), holds, expected)

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x, y = np.asarray(x, float), np.asarray(y, float)
        across = along(self.heading + np.pi / 2, x, y)
        if self.wander:
            across += wander(self.seed, 4, x, y, rms=self.wander, length=self._wander_length)
        away = (across / self.spacing + 0.5) % 1 - 0.5                  # [spacings] from the nearest crest
        return self.height * np.square(np.maximum(1 - np.square(2 * away * self.spacing / self._width), 0))

    @property
    def _width(self) -> float:
        return self.spacing / 2 if self.width is None else self.width

    @property
    def _wander_length(self) -> float:
        return 4 * self.spacing if self.wander_length is None else self.wander_length
