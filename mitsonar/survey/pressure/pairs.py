"""Pairs of echoes and elements: delay relative to the arrival at the source, and gain.

    delay    the difference of the method                                                `vector_approximation`
    gain     1 / (1 + x) of an echo that is later by x of its way, times the element's pressure towards the echo

The pattern of an element is taken in the direction of its own ray. With n towards the echo at the source, 1/R the
curvature of the wavefront there and d the element's offset, this direction is (n - d/R) / |n - d/R|.

Elements of one face, which all look one way, receive no echo from behind their rigid baffle; the test is made once per
echo. Along each straight line of such elements, delay and gain of an echo are polynomials if the bounds of their errors
are small (`line_difference`). For a face of the side L and directions that differ by up to β, the pressure's error is 2
(x/2)^N / ((N + 1) N!), x = π β L / λ, with N points; N is chosen so that the error is below `PATTERN_ERROR`. A floor f
of side lobes bends the pressure near its nulls: its singular points lie at least y = √(f/2) 2π/x half-ranges off the
real axis, and the error is at most 4 ρ^-N / (ρ - 1), ρ = y + √(1 + y²) (Trefethen 2013, Approximation theory and
approximation practice, theorem 8.2).
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial
from typing import TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of
from mitsonar.device.types import Bool, Float, Triple
from mitsonar.propagation.returns.line_difference import NODES, LineChange, polynomial, straight_runs
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.propagation.returns.straight_vectors import dot
from mitsonar.propagation.returns.vector_approximation import (
    ELEMENT_FIELDS,
    difference_of,
    level_difference,
    vector_element_fields,
)
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.element_patterns import element_pressure

from .ping_source import Method, View, opaque

CURVATURE = 6                      # index of 1/R in `straight_vectors.hit_fields`
SAME_PLANE = 1e-9                  # [m]
FEWEST_ON_A_LINE = 16              # least number of elements for which polynomials save time
MOST_LINES = 4                     # most lines of an array: an echo has 40 to 56 bytes of polynomials for each
LINE_ERROR = 1e-11                 # [s] largest error of their delays
PATTERN_ERROR = 2e-5              # largest error of their pressures, -94 dB

OfPair: TypeAlias = Callable[[Sequence[Float], Sequence[Float]], Float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Fields, delays and gains of pairs of echoes and elements, as `ImpulseResponses.add` needs them."""

    hits: list[Float]  # fields (H,) of the echoes
    elements: list[np.ndarray]  # fields (E,) of the elements
    delay: OfPair  # function of both fields
    gain: OfPair  # function of both fields


class ReceivedEchoes:
    """Echoes that the elements of one array receive."""
    # wavelength [m]; towards (H,), directions to the echoes; None if all elements are omnidirectional

    def __init__(self, back: ReturnPaths, view: View, receive: Array, *, wavelength: float, method: Method,
                 towards: Triple | None):
        self.back, self.view, self.receive = back, view, receive
        self.wavelength, self.towards = wavelength, towards
        self.method: Method = method
        self.flat = _one_face(receive)
        self.baffle = "none" if self.flat and receive.baffle == "hard" else receive.baffle

    @property
    def ahead(self) -> Bool | None:
        """Return True for echoes from the front of the common rigid baffle; None if there is none."""
        if self.towards is None or self.baffle == self.receive.baffle:
            return None
        offset = opaque(mi.Float, self.view.offsets(self.receive)[0])
        seen = offset_from(self.towards, offset, self.back.hit_fields[CURVATURE])
        return dot(seen, opaque(mi.Float, self.view.rotation @ self.receive.normal[0])) >= 0

    def pairs(self, rows: slice, nearest: float, speed: float) -> list[tuple[np.ndarray, Pairs]]:
        """Return numbers of elements and the pairs with them: a part for each line if polynomials suffice on all lines.

        All echoes lie beyond `nearest` [m]; `speed` [m/s] is that at the array.
        """
        view, receive, number = self.view, self.receive, np.arange(self.receive.elements)[rows]
        offsets = view.offsets(receive)[rows]
        difference = difference_of(self.method, offsets, view.profile, view.tilt, view.climb)
        if self.method == "vector":
            runs = straight_runs(offsets)
            lines = [self._line(offsets[run], nearest, speed, level=difference is level_difference)
                     for run in runs[:MOST_LINES]]
            along = [(number[run], self._along(line, difference)) for run, line in zip(runs, lines) if line]
            if len(along) == len(runs):
                return along
        fields = ELEMENT_FIELDS[self.method](offsets, view.depth, view.profile)
        faces = [] if self._alike else [*(receive.normal[rows] @ view.rotation.T).T,
                                        *(receive.along[rows] @ view.rotation.T).T]
        return [(number, self._each(difference, [*fields, *faces], len(fields)))]

    def _line(self, offsets: np.ndarray, nearest: float, speed: float, *, level: bool) -> LineChange | None:
        """Return the line through elements with few terms of polynomials that are accurate enough; None without."""
        view, reach = self.view, float(np.linalg.norm(offsets, axis=-1).max())
        height = float(np.abs(offsets[:, 2]).max()) + view.tilt * reach + view.climb * reach / speed
        for count in NODES if len(offsets) >= FEWEST_ON_A_LINE else ():
            line = LineChange.through(offsets, count)
            if line is not None and self._smooth(line, nearest, speed) and (level or line.water_error(
                    nearest, speed, depth=view.depth, profile=view.profile, height=height) < LINE_ERROR):
                return line
        return None

    @property
    def _alike(self) -> bool:
        """Return True if the elements' patterns, apart from `ahead`, are the same in all directions."""
        return self.towards is None or (self.receive.pattern == "omni" and self.baffle == "none")

    def _smooth(self, line: LineChange, nearest: float, speed: float) -> bool:
        """Return True if polynomials along a line are accurate enough."""
        if line.error(nearest, speed) > LINE_ERROR:
            return False
        side = max(self.receive.length, self.receive.height) / self.wavelength
        half, count = 0.5 * np.pi * side * line.angle(nearest), line.count
        error = 2 * half ** count / ((count + 1) * factorial(count))
        if self.receive.floor and half:
            off = np.sqrt(0.5 * self.receive.floor) * np.pi / half
            rho = off + np.sqrt(1 + off * off)
            error = max(error, 4 * rho ** -count / (rho - 1))
        return self._alike or (self.flat and self.baffle in ("none", "cardioid") and error < PATTERN_ERROR)

    def _each(self, difference: OfPair, elements: list[np.ndarray], fields: int) -> Pairs:
        """Return the pairs, each computed by itself; the first `fields` of `elements` belong to the difference."""
        lib, receive, alike, baffle = arrays_of(mi.Float), self.receive, self._alike, self.baffle
        count = len(self.back.hit_fields)
        hits = [*self.back.hit_fields, lib.Float(dr.rcp(self.back.return_time))]
        if self.towards is not None and not alike:
            sizes = self.wavelength, receive.length, receive.height
            hits += [*self.towards, *opaque(lib.Float, (*sizes, receive.floor) if receive.floor else sizes)]

        def delay(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            return difference(hit[:count], at[:fields])

        def gain(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            later = delay(hit, at) * hit[count]
            spread = 1 - later * (1 - later)
            if alike:
                return spread
            wavelength, length, height = hit[count + 4:count + 7]
            floor = hit[count + 7] if receive.floor else 0.0
            direction = seen_from(hit[count + 1:count + 4], at[:3], hit[CURVATURE])
            return spread * element_pressure(direction, wavelength, at[fields:fields + 3], at[fields + 3:],
                                             length=length, height=height, floor=floor, pattern=receive.pattern,
                                             baffle=baffle)

        return Pairs(hits=hits, elements=elements, delay=delay, gain=gain)

    def _along(self, line: LineChange, difference: OfPair) -> Pairs:
        """Return the pairs by polynomials through points of a line."""
        view, receive = self.view, self.receive
        fields = np.broadcast_arrays(*vector_element_fields(line.nodes, view.depth, view.profile))
        faces = [] if self._alike else [*(view.rotation @ receive.normal[0]), *(view.rotation @ receive.along[0])]
        exact = self._each(difference, [], len(fields))
        nodes = [opaque(mi.Float, [*node, *faces]) for node in np.transpose(fields)]
        delays, gains = (LineChange.coefficients([of_pair(exact.hits, node) for node in nodes])
                         for of_pair in (exact.delay, exact.gain))
        return Pairs(hits=[*delays, *gains], elements=[line.place],
                     delay=lambda hit, at: polynomial(hit[:line.count], at[0]),
                     gain=lambda hit, at: polynomial(hit[line.count:], at[0]))


def _one_face(array: Array) -> bool:
    """Return True if all elements lie in one plane, look one way and are turned alike."""
    plane = np.sum(array.position * array.normal, axis=-1)
    return bool(np.all(array.normal == array.normal[0]) and np.all(array.along == array.along[0])
                and np.ptp(plane) < SAME_PLANE)


def offset_from(towards: Triple, offset: Triple, curvature: Float) -> list[Float]:
    """Return vectors from an element towards echoes, not of unit length.

    `towards`: unit vectors from the source; `offset` of the element [m]; `curvature` of the wavefront there [1/m].
    """
    return [part - d * curvature for part, d in zip(towards, offset)]


def seen_from(towards: Triple, offset: Triple, curvature: Float) -> list[Float]:
    """Return unit vectors from an element towards echoes; see `offset_from`."""
    seen = offset_from(towards, offset, curvature)
    per_length = dr.rsqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2])
    return [part * per_length for part in seen]
